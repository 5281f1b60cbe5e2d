"""`rtshcua run --wait`: a vehicle that is connected under a policy, and flies nothing until a bundle is handed in.

The bundle that the run was given says under which policy, on which vehicle; its mission does not fly. What is handed in
at the sockets is a bundle, which is admitted or refused by what `run` asks of one, or a recall, which ends the wait.
Nothing that moves the vehicle is sent meanwhile, and its geofence stays as it is.
"""

import time
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import msgspec

from rtshcua.adapters.clock import LinkClock
from rtshcua.adapters.vehicle.connected import ConnectedVehicle
from rtshcua.app.fly.agents import Agents
from rtshcua.app.fly.console import Console
from rtshcua.app.fly.interrupts import Interrupts
from rtshcua.app.fly.refused import Refused
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Event, Presented, Readings
from rtshcua.onboard.runtime.monitor import StateMonitor
from rtshcua.onboard.runtime.seen import value_in_words
from rtshcua.wire import names
from rtshcua.wire.document import kind_of
from rtshcua.wire.receipt import Receipt, decode
from rtshcua.wire.untrusted import Untrusted

#: how often who follows is told how the vehicle is, in seconds
TOLD_S: Final = 1.0
#: the least time between two refusals that a person is told of, in seconds: whoever hands in may do so by the hundred
SAID_S: Final = 1.0
#: what ground stations on the link are told
ANNOUNCED: Final = "waits for a mission"

_INFO: Final = 6  # MAV_SEVERITY_INFO
_POLL_S: Final = 0.05
_ADMITTED: Final = "admitted: the flight begins, and each step is decided before it is sent"
_NOTHING_FLIES: Final = "nothing flies yet: a bundle is handed in first"

_encode = msgspec.json.Encoder().encode


class Admitted(NamedTuple):
    """The bundle that flies, as it was handed in and as it was loaded."""

    data: bytes
    loaded: Loaded


class Waiting:
    """One wait. `admit` says whether a bundle may fly, and `expect` raises `Refused` once none may any more. `most_s`:
    how long it waits at most, in seconds. `notes`: what there is to tell first.
    """

    def __init__(
        self, base: Loaded, admit: Callable[[bytes], Loaded | Refusal], expect: Callable[[], None],
        vehicle: ConnectedVehicle, clock: LinkClock, interrupts: Interrupts, agents: Agents, *,
        console: Console, most_s: float, notes: Sequence[str] = (),
    ) -> None:  # fmt: skip
        self._base = base
        self._admit = admit
        self._expect = expect
        self._vehicle = vehicle
        self._clock = clock
        self._interrupts = interrupts
        self._agents = agents
        self._most_s = most_s
        self._console = console
        self._notes = notes
        self._monitor = StateMonitor(base.policy)
        self._refused = 0
        self._said_s = -SAID_S

    def follow(self, events: Sequence[Event]) -> Admitted:
        """Wait until a bundle is admitted. `events` came while the vehicle was met. Raises `Refused`."""
        policy = self._base.bundle.policy
        begun_s = time.monotonic()
        told_s, unready = begun_s - TOLD_S, ""
        text = f"{self._base.vehicle} waits under {policy.name}@{policy.version}: nothing flies until a bundle comes in"
        for note in self._notes:
            self._tell("note", f"note: {note}")
        self._tell("waiting", f"{text}; Ctrl-C or a recall ends it", vehicle=self._base.vehicle)
        self._vehicle.announce(_INFO, ANNOUNCED)
        while True:
            if self._interrupts.wish() is not None:
                raise Refused(ExitCode.INTERRUPTED, "interrupted", "interrupted while it waited: nothing was flown")
            now_s = time.monotonic()
            if now_s - begun_s >= self._most_s:
                text = f"no bundle was admitted within {self._most_s:g} s: nothing was flown"
                raise Refused(ExitCode.REFUSED, "nothing-handed-in", text)
            for event in events:
                if isinstance(event, Readings):
                    self._monitor.update(event)
            if now_s - told_s >= TOLD_S:
                self._expect()
                told_s, before, unready = now_s, unready, self._vehicle.driver.unready or ""
                if unready != before:
                    self._tell("vehicle", f"not ready yet: {unready}" if unready else "the vehicle is ready")
                self._agents.tell(self._state(unready))
            admitted = self._handed_in()
            if admitted is not None:
                return admitted
            events = self._vehicle.poll(self._clock.now().monotonic_us, self._clock.us_in(_POLL_S))

    def _handed_in(self) -> Admitted | None:
        found = self._agents.events(self._clock.now())
        for text in self._agents.notes():
            self._console.say(f"note: {text}")
        for number, event in enumerate(found):
            if isinstance(event, Presented):
                admitted = self._take(event)
                if admitted is not None:
                    self._agents.fly(admitted.loaded, found[number + 1 :])
                    return admitted
        return None

    def _take(self, event: Presented) -> Admitted | None:
        kind = _kind_of(event.document)
        if kind is names.RECALL:
            receipt = decode(self._base.boundary.present(event.document, self._clock.now(), 0))
            assert isinstance(receipt, Receipt)
            self._agents.answer(event.sender, receipt.slug, receipt.text)
            if receipt.accepted:
                raise Refused(ExitCode.ABORTED, "recalled", "recalled while it waited: nothing was flown")
            self._refusal(receipt.slug, receipt.text)
            return None
        outcome = Refusal("not-flying", _NOTHING_FLIES) if kind is not None else self._admit(event.document)
        if isinstance(outcome, Refusal):
            self._agents.answer(event.sender, outcome.slug, outcome.text)
            self._refusal(outcome.slug, outcome.text)
            return None
        self._agents.answer(event.sender, "accepted", _ADMITTED)
        mission = outcome.bundle.mission.name
        self._tell("admitted", f"`{mission}` was handed in and admitted", mission=mission)
        return Admitted(event.document, outcome)

    def _refusal(self, slug: str, text: str) -> None:
        """Tell a person of a refusal, at most once in `SAID_S`."""
        self._refused += 1
        now_s = time.monotonic()
        if now_s - self._said_s >= SAID_S:
            self._said_s = now_s
            self._tell("not-admitted", f"refused what was handed in: {text} ({slug})", slug=slug, refused=self._refused)

    def _state(self, unready: str) -> bytes:
        """How the vehicle is, for who follows: what keeps it from being ready, and every signal with its age."""
        seen, now_us = self._vehicle.driver.seen, self._clock.now().monotonic_us
        state, current = self._monitor.state(now_us), self._monitor.current(now_us)
        signals = [
            {
                "name": signal.name,
                "value": value_in_words(signal, state),
                "age_us": max(state.ages[slot] for slot in signal.slots),
                "stale": not current.issuperset(signal.slots),
            }
            for signal in self._base.bundle.policy.signals
        ]
        told = {
            "type": "vehicle",
            "ready": not unready,
            "unready": unready or None,
            "armed": bool(seen.armed),
            "airborne": bool(seen.airborne),
            "signals": signals,
        }
        return _encode(told) + b"\n"

    def _tell(self, event: str, text: str, **more: object) -> None:
        """Say how it stands: a line for a person, an object for a program."""
        if self._console.as_json:
            self._console.emit({"event": event, "text": text} | more)
        else:
            self._console.say(text)


def _kind_of(data: bytes) -> names.Artefact | None:
    """Which kind of document these bytes are, if they are one."""
    try:
        return kind_of(data)
    except Untrusted:
        return None
