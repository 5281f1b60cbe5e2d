"""The service `gateway`: its processes, its clients, and one flight after the other.

The loop passes what arrives to the pure core (`ground/gateway`) and carries out its actions. It owns no decision: the
core refuses what is certainly not permitted, the compiler what it cannot prove, and the flight's enforcement boundary
decides.
"""

import gc
import json
import re
import select
import socket
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any, Final, NamedTuple, Protocol

import msgspec

from rtshcua.adapters.clock import SystemClock
from rtshcua.adapters.gateway.frames import parcels
from rtshcua.adapters.gateway.messages import RelayKind, RelayMessage, Up
from rtshcua.adapters.store.writing import append
from rtshcua.app.fly.stop_wishes import Interrupts
from rtshcua.app.gateway.configuration import ConfiguredClient, reached
from rtshcua.app.gateway.flight_process import AgentLink, FlightProcess
from rtshcua.app.gateway.policy_in_force import PolicyInForce
from rtshcua.app.gateway.proposals import FlightMission, ProposalMoment, Proposals
from rtshcua.app.gateway.relay_process import StartedRelay
from rtshcua.app.gateway.vehicle_state import VehicleFrames
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.gateway import interface
from rtshcua.ground.gateway.accepted import accepted_commands
from rtshcua.ground.gateway.client_link import ClientLink
from rtshcua.ground.gateway.interface import ClientSettings, Event, GatewaySettings
from rtshcua.ground.gateway.translator import Gateway
from rtshcua.mavlink import dialect
from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1 as AUTOPILOT
from rtshcua.mavlink.framing import HEADER, MARKER, frames_in, message_id, sender_of
from rtshcua.mavlink.layouts import HEARTBEAT
from rtshcua.mavlink.modes import is_vehicle
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Now
from rtshcua.wire.clock import DRIFT_US

#: the longest wait of the loop, in ms, and the interval of ticks, in us
_TURN_MS: Final = 50
_TICK_US: Final = 50_000
#: how long the vehicle may be silent at the start, in seconds
HEARTBEAT_S: Final = 20.0
#: the wait before a flight is started again: after one that flew, and after each one in a row that did not
_AGAIN_S: Final = (0.2, 1.0, 2.0, 5.0, 15.0)
#: lines about each client that wait for the log, and the least interval between two, in seconds (docs/agents.md)
_MOST_RECORDS: Final = 50
_RECORD_S: Final = 0.25
#: how much earlier than now, besides the error of UTC, a mission is issued, us
_ISSUED_BEFORE_US: Final = 100_000
#: the lines of the agent socket with the flight's time: of a flight that waits, and records of the log
_DATED: Final = ("decision", "effect", "vehicle")
#: lines about clients that wait for the disk
_MOST_UNWRITTEN: Final = 1_000
#: how often the relay is started again
_MOST_RELAYS: Final = 3
#: exit codes of a flight that it would have again
_LASTING: Final = (ExitCode.USAGE, ExitCode.INPUT, ExitCode.UNTRUSTED)
_DESCRIPTOR: Final = re.compile(r"\bfd:[0-9]+\b", re.ASCII)
#: the offsets of `type` and `autopilot` in the payload of HEARTBEAT
_TYPE_AT, _AUTOPILOT_AT = 4, 5


class GatewayConsole(Protocol):
    """Where the gateway tells what happens."""

    def tell(self, event: Mapping[str, object]) -> None:
        """Show an event: `event` is its name, the other keys depend on it."""
        ...


@dataclass(frozen=True, slots=True)
class FlightWords:
    """How a flight is started: the options of `rtshcua run` besides bundle and link, the path of its agent socket, its
    environment, and the trust root that its log is verified with.
    """

    options: tuple[str, ...]
    agent_socket: Path
    environment: Mapping[str, str]
    root: Path


class FlightTime(NamedTuple):
    """A flight's time of day by one of its records: monotonic time, UTC and the bound on the error of UTC, in us."""

    monotonic_us: int
    utc_us: int
    utc_error_us: int

    @classmethod
    def of(cls, line: Mapping[str, Any]) -> "FlightTime | None":
        """The time in a line of the agent socket; None if it has none, or the flight does not know the time of day."""
        values = [line.get(each) for each in ("at_us", "utc_us", "utc_error_us")]
        monotonic_us, utc_us, error_us = (each if isinstance(each, int) else None for each in values)
        if monotonic_us is None or utc_us is None or error_us is None or error_us >= UTC_UNKNOWN_US:
            return None
        return cls(monotonic_us, utc_us, error_us)

    def now(self, monotonic_us: int) -> Now:
        """The present moment by it; the error grows."""
        since_us = monotonic_us - self.monotonic_us
        return Now(monotonic_us, self.utc_us + since_us, self.utc_error_us + max(since_us, 0) * DRIFT_US // 1_000_000)


@dataclass(slots=True)
class GatewaySession:
    """One flight: its process, what it reported, the mission in force and the number of its released steps."""

    process: FlightProcess
    link: AgentLink
    hello: Mapping[str, Any] = field(default_factory=dict)
    waiting: bool = False
    in_force: FlightMission | None = None
    accepted: Mission | None = None  # by the flight, but not announced yet
    began: bool = False  # a mission flies: that of clients, or of an earlier flight that is brought down
    released: int = 0
    time: FlightTime | None = None  # of its last line with one
    close: Mapping[str, Any] = field(default_factory=dict)
    summary: dict[str, Any] = field(default_factory=dict)

    @property
    def ready(self) -> bool:
        """Whether it can take a document."""
        if self.link.descriptor is None or self.accepted is not None:
            return False
        return self.waiting or self.in_force is not None

    @property
    def flies(self) -> bool:
        """Whether a mission is in force, or soon will be."""
        return self.began or self.accepted is not None

    def hear(self, line: Mapping[str, Any]) -> None:
        """Take in a line of the agent socket."""
        if line.get("type") in _DATED:
            self.time = FlightTime.of(line) or self.time
        match line.get("type"):
            case "hello":
                self.hello = line
            case "waiting":
                self.waiting = True
            case "mission":
                self.began, self.waiting = True, False
                if self.accepted is not None:
                    with suppress(ValueError):
                        digest = bytes.fromhex(str(line.get("digest")))
                        self.in_force, self.accepted = FlightMission(self.accepted, digest), None
            case "effect" if line.get("event") == "dispatched" and isinstance(line.get("step"), int):
                self.released = max(self.released, int(line["step"]) + 1)
            case "close":
                self.close = line


class ClientRecords:
    """The lines about clients that wait for the flight's log: of each client at most so many, and one in its turn."""

    def __init__(self) -> None:
        self._waiting: dict[str, deque[str]] = {}

    def add(self, client: str, text: str) -> None:
        """Add a line; the oldest of this client gives way."""
        self._waiting.setdefault(client, deque(maxlen=_MOST_RECORDS)).append(text)

    def next(self) -> str | None:
        """The next line; None if none waits."""
        client = next(iter(self._waiting), None)
        if client is None:
            return None
        lines = self._waiting.pop(client)
        text = lines.popleft()
        if lines:
            self._waiting[client] = lines  # behind the others
        return text


class ClientJournal:
    """The lines about all clients in `gateway.jsonl`, written by another thread: no client waits for the disk."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._writer = ThreadPoolExecutor(1, thread_name_prefix="journal")
        self._waiting: deque[Future[None]] = deque()
        self._dropped = 0

    def keep(self, line: Mapping[str, object]) -> None:
        """Write a line. If the disk is far behind, lines are left out and counted."""
        while self._waiting and self._waiting[0].done():
            self._waiting.popleft()
        if len(self._waiting) >= _MOST_UNWRITTEN:
            self._dropped += 1
            return
        told = {**line, "dropped": self._dropped} if self._dropped else line
        self._dropped = 0
        data = json.dumps(told, ensure_ascii=False).encode() + b"\n"
        self._waiting.append(self._writer.submit(append, self._path, data))

    def close(self) -> None:
        """Write what waits."""
        self._writer.shutdown()


def answers_first(actions: Sequence[interface.Action]) -> Iterator[interface.Action]:
    """The actions in the order in which they are carried out: first the answers, for which clients wait, and what is
    withheld from clients. Answers to one client are sent together, because each datagram wakes the relay.
    """
    for client, some in groupby(sorted(actions, key=_waits), key=_answered):
        if client is None:
            yield from some
        else:
            frames = [each.frame for each in some if isinstance(each, interface.ToClient)]
            yield from (interface.ToClient(client, datagram) for datagram in parcels(frames))


def _waits(action: interface.Action) -> bool:
    return not isinstance(action, interface.ToClient | interface.Withhold)


def _answered(action: interface.Action) -> int | None:
    """The client that an action sends a frame to; None for any other action."""
    return action.client if isinstance(action, interface.ToClient) else None


class GatewayService:
    """A gateway that runs. `renew` gives the policy for the next session, or None to keep the present one."""

    def __init__(
        self, relay: StartedRelay, policy: PolicyInForce, clients: Sequence[ConfiguredClient], words: FlightWords,
        console: GatewayConsole, runs: Path, *, system: int | None, utc_error_us: int,
        renew: Callable[[VehicleFrames | None, Now], PolicyInForce | None], sessions: int | None = None,
    ) -> None:  # fmt: skip
        self._relay, self._policy, self._sides, self._words = relay, policy, tuple(clients), words
        self._console, self._renew = console, renew
        self._system, self._utc_error_us, self._left = system, utc_error_us, sessions
        self._clock = SystemClock()
        self._core: Gateway | None = None
        self._frames: VehicleFrames | None = None
        self._heard: tuple[int, int] | None = None  # system and autopilot of the vehicle's heartbeat
        self._clients: dict[int, ClientSettings] = {}
        self._early: dict[int, ClientLink] = {}  # the clients that sent something before the vehicle was heard
        self._early_actions: list[interface.Action] = []
        self._session: GatewaySession | None = None
        self._failed, self._next_s, self._relays, self._flown = 0, 0.0, 0, 0
        self._numbers = 0
        self._requests: dict[int, int] = {}
        self._poll, self._polled, self._tick_us = select.poll(), list[int](), 0
        self._handed: int | None = None  # the number of the document that the flight has not answered
        self._journal = ClientJournal(runs / "gateway.jsonl")
        self._records = ClientRecords()
        self._record_s = 0.0
        self._wakes, self._wake = socket.socketpair()
        for each in (self._wakes, self._wake):
            each.setblocking(False)
        self._proposals = self._new_proposals()

    def _new_proposals(self) -> Proposals:
        def wake() -> None:
            with suppress(OSError):
                self._wake.send(b"\0")

        return Proposals(self._policy.missions, self._policy.signer, wake)

    # ---------------------------------------------------------------- the loop

    def run(self) -> ExitCode | Refusal:
        """Run until it is interrupted, or until the number of sessions was flown. The summary is told last."""
        ended = self._run()
        if not isinstance(ended, Refusal):
            self._console.tell({"event": "summary", "exit_code": int(ended), "sessions": self._flown})
        return ended

    def _run(self) -> ExitCode | Refusal:
        gc.collect()
        gc.freeze()  # what is there stays: looking through it again and again takes longer than a refusal
        began_s, ending = time.monotonic(), False
        with Interrupts() as interrupts:
            while True:
                if interrupts.wish() is not None:
                    if self._session is None or not self._session.flies:
                        return ExitCode.INTERRUPTED if ending else ExitCode.OK
                    if not ending:
                        self._console.tell({"event": "interrupted"})
                    ending = True
                    self._session.process.interrupt()
                if (refusal := self._turn(self._wait())) is not None:
                    return refusal
                if self._heard is None and time.monotonic() - began_s > HEARTBEAT_S:
                    return Refusal("link", "the vehicle sends no heartbeat", "check its address", ExitCode.LINK)
                done = self._next_session(ending=ending)
                if done is not None:
                    return done

    def close(self) -> None:
        """End the flight, the relay and the worker; a flight in the air lands first."""
        if self._session is not None:
            self._session.link.close()
            self._session.process.stop()
        self._relay.close()
        self._journal.close()
        self._proposals.close()
        self._wakes.close()
        self._wake.close()

    def _wait(self) -> frozenset[int]:
        """Wait until something arrives. Return the descriptors that have something, besides those of the relay."""
        session = self._session
        wanted = [self._relay.control.fileno(), self._relay.telemetry.fileno(), self._wakes.fileno()]
        if session is not None:
            wanted += [each for each in (*session.process.descriptors, session.link.descriptor) if each is not None]
        if wanted != self._polled:
            self._poll, self._polled = select.poll(), wanted
            for descriptor in wanted:
                self._poll.register(descriptor, select.POLLIN)
        ready = frozenset(descriptor for descriptor, _ in self._poll.poll(_TURN_MS))
        if self._wakes.fileno() in ready:
            with suppress(BlockingIOError):
                self._wakes.recv(1 << 10)
        return ready

    def _turn(self, ready: frozenset[int]) -> Refusal | None:
        """Take in everything that has arrived: clients first, who wait for answers."""
        now = self._now()
        try:
            for message in self._relay.messages():
                self._from_relay(message, now)
        except (ConnectionError, ValueError):
            return self._relay_ended(now)
        for datagram in self._relay.frames():
            for frame in frames_in(datagram):
                if frame[0] == MARKER:  # of MAVLink 1, of which clients and the flight may have some, nothing is read
                    self._from_vehicle(frame, now)
        ticks = now.monotonic_us - self._tick_us >= _TICK_US
        if ticks or not ready.isdisjoint(self._polled[3:]):
            self._from_flight(now)
        if ticks:
            self._tick_us = now.monotonic_us
            if self._frames is not None:
                self._frames.read()
            self._take(interface.Tick(), now)
            self._hand_in_records()
        self._advance(now)
        return None

    def _relay_ended(self, now: Now) -> Refusal | None:
        """Start the relay again, and a flight that brings the vehicle down if it is in the air."""
        self._relays += 1
        if self._relays > _MOST_RELAYS:
            text = f"the relay ended {self._relays} times: the vehicle cannot be reached"
            return Refusal("relay", text, "its own failsafe acts; start the gateway again", ExitCode.FAULT)
        self._console.tell({"event": "note", "text": "the relay ended, and is started again"})
        for client in [*self._clients]:
            self._take(interface.ClientDown(client, relay_ended=True), now)
        self._clients.clear()
        if self._session is not None:
            self._session.process.kill()
        relay = self._relay.again()
        if isinstance(relay, Refusal):
            return relay
        self._relay = relay
        if self._heard is not None:
            relay.know_vehicle(self._heard[0])
        return None

    def _now(self) -> Now:
        """The present moment by the flight's time of day, which may be the vehicle's; every take-off has it, because
        it waits for the flight's first `vehicle` line. While the flight knows none, it is this machine's, with the
        stated error; the flight decides on the first step once it knows a time.
        """
        now = self._clock.now()
        if self._session is not None and self._session.time is not None:
            return self._session.time.now(now.monotonic_us)
        return Now(now.monotonic_us, now.utc_us, min(now.utc_error_us, self._utc_error_us))

    def _take(self, event: Event, now: Now) -> None:
        """Give the core an event, and carry out what it wants done."""
        if self._core is not None:
            self._carry_out(self._core.take(event, now), now)

    def _carry_out(self, actions: list[interface.Action], now: Now) -> None:
        for action in answers_first(actions):
            self._do(action, now)

    # ---------------------------------------------------------------- what arrives

    def _from_vehicle(self, frame: bytes, now: Now) -> None:
        if self._heard is None and self._is_heartbeat(frame):
            self._heard = sender_of(frame)[0], frame[HEADER + _AUTOPILOT_AT]
            self._relay.know_vehicle(self._heard[0])
            self._begin_core(now)
        if self._frames is not None:
            self._frames.take(frame, now.monotonic_us)
            self._take(interface.FromVehicle(frame), now)

    def _is_heartbeat(self, frame: bytes) -> bool:
        """Whether it is a heartbeat of the vehicle's autopilot."""
        system, component = sender_of(frame)
        if message_id(frame, 0) != HEARTBEAT or component != AUTOPILOT or self._system not in (None, system):
            return False
        return frame[1] > _AUTOPILOT_AT and is_vehicle(frame[HEADER + _TYPE_AT], frame[HEADER + _AUTOPILOT_AT])

    def _begin_core(self, now: Now) -> None:
        """Start the core for the vehicle and the policy, and tell it which clients there are; or renew its policy."""
        assert self._heard is not None
        system, autopilot = self._heard
        missions, prepared = self._policy.missions, self._policy.prepared
        frames = self._frames = VehicleFrames(prepared, system)
        settings = GatewaySettings(
            system, autopilot, prepared, missions.defaults(),
            accepted_commands(missions.program, dialect.load(), missions.policy), frames.state, frames.needed_us,
        )  # fmt: skip
        if self._core is not None:
            self._carry_out(self._core.renew(settings, now), now)
            return
        self._core = Gateway(settings)
        self._early.clear()
        for number, client in self._clients.items():
            self._take(interface.ClientUp(number, client), now)
        if self._session is not None and self._session.hello:
            self._take(interface.FlightLine(self._session.hello), now)

    def _from_relay(self, message: RelayMessage, now: Now) -> None:
        client = message.client
        match message.kind:
            case RelayKind.UP:
                up = msgspec.json.decode(message.payload, type=Up)
                side = self._sides[up.index]
                self._clients[client] = ClientSettings(side.name, side.role, side.rank, side.pilot, side.requests)
                peer = reached(up.peer)
                self._console.tell({"event": "client-up", "client": client, "name": side.name, "peer": peer})
                self._take(interface.ClientUp(client, self._clients[client]), now)
            case RelayKind.DOWN:
                gone = self._clients.pop(client, None)
                self._early.pop(client, None)
                if gone is not None:
                    why = message.payload.decode("utf-8", "replace")
                    self._console.tell({"event": "client-down", "client": client, "name": gone.name, "why": why})
                    self._take(interface.ClientDown(client), now)
            case RelayKind.CLIENT | RelayKind.PILOT:
                pilot = message.kind is RelayKind.PILOT
                for frame in frames_in(message.payload):
                    if self._core is None:
                        self._without_vehicle(client, frame, now)
                    else:
                        of = interface.FromPilot if pilot else interface.FromClient
                        self._take(of(client, frame), now)

    def _without_vehicle(self, client: int, frame: bytes, now: Now) -> None:
        """A frame of a client before the vehicle was heard."""
        if client not in self._early and client in self._clients:
            self._early[client] = ClientLink(client, self._clients[client], 0, self._early_actions, now.monotonic_us)
        if client in self._early:
            self._early[client].answer_without_vehicle(frame, now.monotonic_us)
        actions = self._early_actions[:]
        self._early_actions.clear()
        self._carry_out(actions, now)

    def _from_flight(self, now: Now) -> None:
        session = self._session
        if session is None:
            return
        for event in session.process.events():
            self._told_by_run(session, event)
        if not session.close:
            session.link.connect()
        for line in session.link.lines():
            if line.get("type") == "answer":
                self._answered(line, now)
                continue
            session.hear(line)
            self._take(interface.FlightLine(line), now)

    def _told_by_run(self, session: GatewaySession, event: Mapping[str, Any]) -> None:
        """Keep what `run --json` says at the end, and show what it says about the vehicle."""
        if event.get("event") in ("refused", "not-admitted", "note", "summary"):
            told = {key: self._of_vehicle(value) if isinstance(value, str) else value for key, value in event.items()}
            self._console.tell({"event": "flight", "told": told})
        session.summary.update({key: event[key] for key in ("log", "run", "ending", "exit_code") if key in event})

    def _of_vehicle(self, text: str) -> str:
        """A text of the flight, whose vehicle is an inherited descriptor, with the vehicle's address."""
        return _DESCRIPTOR.sub(lambda _: self._relay.vehicle, text)

    def _answered(self, line: Mapping[str, Any], now: Now) -> None:
        number, slug, text = line.get("id"), str(line.get("slug", "")), str(line.get("text", ""))
        if isinstance(number, int) and number in self._requests:
            self._take(interface.RequestAnswered(self._requests.pop(number), slug), now)
        elif number is not None and number == self._handed:
            self._handed = None
            events, mission = self._proposals.answered(slug, text)
            if mission is not None and self._session is not None:
                self._session.accepted = mission
            for event in events:
                self._take(event, now)

    # ---------------------------------------------------------------- what is done

    def _do(self, action: interface.Action, now: Now) -> None:
        match action:
            case interface.ToClient(client, frames):
                self._relay.answer(client, frames)
            case interface.Withhold(client, messages):
                assert self._heard is not None
                self._relay.withhold(client, self._heard[0], messages)
            case interface.Propose():
                for event in self._proposals.add(action):
                    self._take(event, now)
            case interface.Withdraw(number):
                self._proposals.withdraw(number)
            case interface.RequestFrame(number, _, frame):
                self._request(number, frame, now)
            case interface.Cancel(_, reason):
                self._cancel(reason, now)
            case interface.ClientNote(said):
                self._console.tell({"event": "client", "told": said})
                self._journal.keep({"at_us": time.time_ns() // 1_000, **said})
                self._records.add(str(said["client"]), action.text)

    def _request(self, number: int, frame: bytes, now: Now) -> None:
        if self._session is None or self._session.link.descriptor is None:
            self._take(interface.RequestAnswered(number, "refused"), now)
            return
        self._numbers += 1
        self._requests[self._numbers] = number
        self._session.link.request(self._numbers, frame)

    def _cancel(self, reason: str, now: Now) -> None:
        document = self._proposals.cancellation(self._moment(now))
        if document is not None and self._session is not None:
            self._numbers += 1
            self._session.link.hand_in(self._numbers, document)
            self._console.tell({"event": "cancelled", "why": reason})

    def _hand_in_records(self) -> None:
        session = self._session
        if session is None or session.in_force is None or time.monotonic() < self._record_s:
            return
        text = self._records.next()
        if text is not None:
            self._record_s = time.monotonic() + _RECORD_S
            session.link.record(0, text)

    def _moment(self, now: Now) -> ProposalMoment:
        session = self._session
        flight = b"" if session is None else bytes.fromhex(str(session.hello.get("flight") or ""))
        start = None if self._frames is None else self._frames.start(now)
        in_force, released = (None, 0) if session is None else (session.in_force, session.released)
        # a mission issued within the error of UTC would be deferred, because it may be issued in the future
        issued_us = now.utc_us - now.utc_error_us - _ISSUED_BEFORE_US
        return ProposalMoment(issued_us, start, flight, in_force, released)

    def _advance(self, now: Now) -> None:
        """Go on with the proposals of clients."""
        if not self._proposals.busy:
            return
        ready = self._session is not None and self._session.ready and self._handed is None
        events, signed = self._proposals.advance(self._moment(now), ready=ready)
        if signed is not None and self._session is not None:
            self._numbers += 1
            self._handed = self._numbers
            self._session.link.hand_in(self._numbers, signed.document)
        for event in events:
            self._take(event, now)

    # ---------------------------------------------------------------- sessions

    def _next_session(self, *, ending: bool) -> ExitCode | Refusal | None:
        """Collect a flight that ended, and start the next one. Return how the gateway ends, if it does."""
        if self._session is not None:
            code = self._session.process.ended()
            if code is None:
                return None
            refusal = self._ended(self._session, code)
            if refusal is not None:
                return refusal
            if ending:
                return ExitCode.INTERRUPTED
            if self._left == 0:
                return exit_code_in(code)
        if time.monotonic() >= self._next_s and not ending:
            return self._begin()
        return None

    def _begin(self) -> Refusal | None:
        """Start a flight that waits for the first command."""
        renewed = self._renew(self._frames, self._now())
        if renewed is not None:
            self._proposals.close()
            self._policy = renewed
            self._proposals = self._new_proposals()
            if self._heard is not None:
                self._begin_core(self._now())
        try:
            link = self._relay.session()
            with link:
                words = [str(self._policy.base), *self._words.options]
                process = FlightProcess(words, link, self._words.environment)
        except OSError as error:
            return Refusal("flight", f"the flight cannot be started: {error}", "", ExitCode.FAULT)
        self._session = GatewaySession(process, AgentLink(self._words.agent_socket))
        return None

    def _ended(self, session: GatewaySession, code: int) -> Refusal | None:
        """Take in the end of a flight."""
        now = self._now()
        self._from_flight(now)
        session.link.close()
        self._session, self._handed = None, None
        for number in self._requests.values():
            self._take(interface.RequestAnswered(number, "refused"), now)
        self._requests.clear()
        for event in self._proposals.forget():
            self._take(event, now)
        self._take(interface.FlightEnded(), now)
        flew, errors = bool(session.close), session.process.errors
        session.process.close()
        if flew:
            self._failed = 0
            self._flown += 1
            self._left = None if self._left is None else self._left - 1
            self._console.tell(
                {
                    "event": "session", "ending": session.close.get("ending"), "exit_code": code,
                    "log": session.summary.get("log"), "root": str(self._words.root),
                }
            )  # fmt: skip
        else:
            why = self._of_vehicle(_last(errors))
            if code in _LASTING:
                return Refusal("flight", f"the flight cannot begin: {why}", "", exit_code_in(code))
            self._failed += 1
            self._console.tell({"event": "flight-failed", "exit_code": code, "text": why})
        self._next_s = time.monotonic() + _AGAIN_S[min(self._failed, len(_AGAIN_S) - 1)]
        return None


def exit_code_in(code: int) -> ExitCode:
    """The exit code of a process with this one; that of a fault if it is none of ours."""
    return next((each for each in ExitCode if each == code), ExitCode.FAULT)


def _last(errors: str) -> str:
    """The error in what a flight printed."""
    lines = [line.strip() for line in errors.splitlines() if line.strip()]
    return next((line for line in lines if line.startswith("error")), lines[-1] if lines else "no reason was given")
