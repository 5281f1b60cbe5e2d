"""Fly one flight of a scenario in virtual time, with its incidents.

The same arguments give the same flight, byte for byte. For a range of times, `Random(f"{scenario.name} {number}
{seed}")` draws the delay of incident `number` (from 0); the same source then draws the content of babble. A similar
source draws what a killed process loses.

Faults of the vehicle, its link and its surroundings are injected into the simulation. Faults of the host computer and
documents from agents take place here, between two turns of the loop.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from heapq import heappop, heappush
from random import Random  # noqa: TID251  seeded: the same seed draws the same
from traceback import format_exception
from typing import Any, Final, NamedTuple

import msgspec

from rtshcua.adapters.clock import StepWatch
from rtshcua.adapters.packs import manoeuvres, packs_of
from rtshcua.adapters.store.evidence_file import Lateness
from rtshcua.decision.evaluate import NO_PHASE, Condition, build
from rtshcua.decision.prepare import PreparedPolicy
from rtshcua.decision.situation import environment, situation
from rtshcua.decision.values import TRUE
from rtshcua.evidence.merkle import leaf_hash
from rtshcua.evidence.recovery import RECOVERABLE, Examination, ending
from rtshcua.model import faults
from rtshcua.model.faults import AgentFault, Fault, HostFault
from rtshcua.model.flat.situation import Now
from rtshcua.model.scenario import AfterStep, AtTime, OnCondition, Scenario
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded
from rtshcua.onboard.left import left_by
from rtshcua.onboard.ports import Action, Append, BoundaryKey, Command, Ending, Event, Presented, Readings
from rtshcua.onboard.runtime.monitor import StateMonitor
from rtshcua.simulation.config import Answers, AutopilotKind, Estimate, SimulationConfig
from rtshcua.simulation.surroundings import Wind
from rtshcua.simulation.world import Simulation
from rtshcua.virtual.fitting import fitting, with_room
from rtshcua.virtual.flight import MemorySink, VirtualFlight, claimed
from rtshcua.virtual.flight_record import (
    HeardReadings,
    IncidentOccurrence,
    Life,
    Reaction,
    ScenarioFlown,
    SentFrame,
    TrueImage,
    TruthSample,
    Turn,
)
from rtshcua.virtual.vehicle import SECOND, START, VirtualClock, VirtualVehicle
from rtshcua.wire import cose
from rtshcua.wire.approval import ApprovalDocument, confirms, sign_approval
from rtshcua.wire.boundary_chain import START as START_DIGEST
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.recall import RecallDocument, sign_recall
from rtshcua.wire.replacement import sign_replacement
from rtshcua.wire.request import STEP
from rtshcua.wire.trust import MAX_ROOT
from rtshcua.wire.untrusted import Untrusted


class Due(NamedTuple):
    """An incident, by its number, and its time, in us since the start of the run."""

    number: int
    at_us: int


class Triggers:
    """The triggers of a scenario's incidents; `chances` are their random sources."""

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self.chances = [Random(f"{scenario.name} {number} {seed}") for number in range(len(scenario.incidents))]
        self._whens = dict(enumerate(each.when for each in scenario.incidents))

    def begin(self, policy: PreparedPolicy) -> None:
        """Reset the known state for a new process of the runtime under this policy."""
        self._policy = policy
        self._monitor = StateMonitor(policy)
        self._conditions: dict[int, Condition] = {}

    def start(self) -> Iterator[Due]:
        """Yield the incidents that depend only on time."""
        yield from [self._due(number, 0) for number, when in list(self._whens.items()) if isinstance(when, AtTime)]

    def turned(self, now: Now, events: Sequence[Event], actions: Iterable[Action], at_us: int) -> Iterator[Due]:
        """Yield the incidents triggered by a turn of the loop."""
        if not self._whens:
            return
        for action in actions:
            if isinstance(action, Append) and b'"event":"dispatched"' in action.line:
                yield from self._sent(msgspec.json.decode(action.line), at_us)
        if any(isinstance(when, OnCondition) for when in self._whens.values()):
            yield from self._look(now, events, at_us)

    def _due(self, number: int, since_us: int) -> Due:
        when = self._whens.pop(number)
        return Due(number, since_us + self.chances[number].randint(when.from_us, when.to_us))

    def _sent(self, record: dict[str, Any], at_us: int) -> Iterator[Due]:
        for number, when in list(self._whens.items()):
            if isinstance(when, AfterStep) and record["kind"] == STEP and record["step"] == when.step:
                yield self._due(number, at_us)

    def _look(self, now: Now, events: Sequence[Event], at_us: int) -> Iterator[Due]:
        """Yield the incidents whose condition is true in the state known to the runtime."""
        monitor, policy = self._monitor, self._policy
        for event in events:
            if isinstance(event, Readings):
                monitor.update(event)
        monitor.observe(now)
        at = environment(situation(monitor.state(now.monotonic_us), policy, now), policy, (), NO_PHASE)
        for number, when in list(self._whens.items()):
            if not isinstance(when, OnCondition):
                continue
            condition = self._conditions.get(number)
            if condition is None:
                compiler = policy.compiler
                condition = self._conditions[number] = build(compiler.node(when.condition), compiler.tables)
            if condition(at) == TRUE:
                yield self._due(number, at_us)


#: the sampling interval of the true state, and the longest wait of the loop, in us
SAMPLE_US: Final = 50_000
WAIT_US: Final = 50_000
#: the delay before a failed restart is repeated
AGAIN_US: Final = 5 * SECOND
#: the time limit of a run, in addition to twice the vehicle's endurance
AROUND_US: Final = 1_800 * SECOND
#: the waits of `rtshcua run`: for a heartbeat, then for the landed state
_HEARTBEAT_US: Final = 10 * SECOND
_AIR_US: Final = 5 * SECOND
#: after the last process, the vehicle is observed until it rests or has hovered for the first time, at most the second
STILL_US: Final = 5 * SECOND
SETTLE_US: Final = 240 * SECOND
#: mm/s: the horizontal and vertical speed of a hovering vehicle with noise and gusts
STILL_MM_S: Final = 700
LEVEL_MM_S: Final = 300
#: the validity of a submitted document
_SPEAKS_US: Final = 300 * SECOND
_LONGEST_BABBLE: Final = 400


@dataclass(frozen=True, slots=True)
class Keys:
    """The signing keys of the log, of the approvers by role (the first of all signs recalls) and of replacement
    missions. The trust root must name them. The second person of a role answers if a rule requires two.
    """

    log: SigningKey
    approvals: Mapping[str, Sequence[SigningKey]]
    mission: SigningKey
    boundary: SigningKey | None = None

    def session(self, number: int, before: bytes) -> BoundaryKey | None:
        """Return the boundary's key for a session; None if the root names no such key."""
        return None if self.boundary is None else BoundaryKey(self.boundary, number, before)


def fly(
    bundle: bytes, root: bytes, keys: Keys, scenario: Scenario, flavour: str, seed: int, *, utc_us: int | None = None,
    tick_us: int = SAMPLE_US, chosen: Callable[..., SimulationConfig] = fitting,
) -> ScenarioFlown:  # fmt: skip
    """Fly the bundle once under the signed trust root, on the simulated autopilot `flavour`, with this seed.

    `chosen` makes the configuration of the simulated vehicle, as `fitting` does. An exception of a run, or a run that
    has not ended after twice the vehicle's endurance plus `AROUND_US` (as long as a run waits for a silent vehicle), is
    recorded in `fault`. Raise ValueError for a refused bundle, and whatever `open_root` raises.
    """
    return _Flight(bundle, root, keys, scenario, flavour, seed, utc_us, tick_us, chosen).fly()


class _Killed(Exception):
    """The process of the runtime dies."""


class _Sink(MemorySink):
    """Evidence of a process that may be killed, in memory, with the time at which each line was stored."""

    def __init__(self, clock: VirtualClock, *, full: bool) -> None:
        super().__init__()
        self.full = full
        self.written = 0  # lines stored before the last turn
        self.kept_us: list[int] = []
        self._clock = clock
        self._lateness = Lateness()

    def append(self, line: bytes, durability: int) -> int:
        given = super().append(line, durability)
        self._lateness.given(given, durability)
        return given

    def keep(self) -> None:
        super().keep()
        self.kept_us += [self._clock.elapsed_us] * (self.kept - len(self.kept_us))

    def trouble(self) -> str | None:
        return self._lateness.stuck(self.kept, self._clock.elapsed_us / SECOND) if self._waiting else None

    def late(self) -> str | None:
        return self._lateness.late(self.kept, self._clock.elapsed_us / SECOND) if self._waiting else None


class _Watched(Simulation):
    """The simulation, with samples of its true state and a record of received frames."""

    def __init__(self, config: SimulationConfig) -> None:
        super().__init__(config)
        self.samples: list[TruthSample] = []
        self.frames: list[SentFrame] = []
        self._sent: dict[bytes, int] = {}  # the index of the last sent frame with these octets
        self._come: dict[bytes, int] = {}  # the index of received frames that the autopilot has not handled
        self._due_us = 0
        self.heard, self.obeyed = self._hear, self._get_to

    def send(self, frame: bytes) -> bool:
        """Record a sent frame; return False: it is not dropped here."""
        self._sent[frame] = len(self.frames)
        self.frames.append(SentFrame(self._now_us, None, frame))
        return False

    def _hear(self, at_us: int, frame: bytes) -> None:
        number = self._sent.pop(frame, None)
        if number is not None:
            self._come[frame] = number
            self.frames[number] = self.frames[number]._replace(heard_us=at_us)

    def _get_to(self, at_us: int, frame: bytes) -> None:
        number = self._come.pop(frame, None)
        if number is not None:
            self.frames[number] = self.frames[number]._replace(obeyed_us=at_us)

    def advance(self, to_us: int) -> list[bytes]:
        """Advance as the simulation does, and take every sample."""
        datagrams: list[bytes] = []
        while True:
            until_us = max(min(to_us, self._due_us), self._now_us)
            datagrams += super().advance(until_us)
            if self._now_us >= self._due_us:
                self._sample()
            if until_us >= to_us:
                return datagrams

    def _sample(self) -> None:
        self._due_us = self._now_us + SAMPLE_US
        truth = self.truth()
        self.samples.append(
            TruthSample(
                self._now_us, truth.latitude, truth.longitude, truth.up_mm, truth.speed_mm_s, truth.climb_mm_s,
                truth.armed, truth.in_air, truth.crashed, truth.mode, truth.battery,
                truth.distance_to_obstacle_mm,
                truth.taken_over_us,
                truth.taken_over_by,
            )
        )  # fmt: skip


class _Flight:
    """One flight of a scenario: one simulated vehicle, and one or more processes of the runtime in turn."""

    def __init__(
        self, bundle: bytes, root: bytes, keys: Keys, scenario: Scenario, flavour: str, seed: int, utc_us: int | None,
        tick_us: int, chosen: Callable[..., SimulationConfig],
    ) -> None:  # fmt: skip
        self._bundle, self._root, self._keys, self._scenario = bundle, root, keys, scenario
        self._flavour, self._seed, self._tick_us = flavour, seed, tick_us
        self._configs: list[SimulationConfig] = []
        self._stepped_us = 0  # the total step of the machine's time of day
        self._full_until_us: int | None = 0  # None: forever
        self._slow_until_us = 0
        self._lives: list[Life] = []
        self._happened: list[IncidentOccurrence] = []
        self._notes: list[str] = []
        self._triggers = Triggers(scenario, seed)
        self._agenda: list[tuple[int, int]] = []  # times and numbers of incidents of the host and of agents
        self._dead_us = 0
        self._babble: list[tuple[int, int, bytes]] = []  # times, order and documents
        self._drawn = 0

        apart = any(isinstance(each.fault, faults.BoundaryKilled) for each in scenario.incidents)
        self._mode = EnforcementMode.PROCESS if apart else EnforcementMode.SOFTWARE

        def vehicle(policy: Any) -> SimulationConfig:
            config = self._config(chosen, policy)
            self._configs.append(with_room(config, policy, claimed(bundle)[1].invocations))
            return self._configs[-1]

        self._flight = VirtualFlight(
            bundle, vehicle, root=root, log_key=keys.log, utc_us=utc_us, wait_us=WAIT_US, tick_us=tick_us,
            sink=lambda clock: _Sink(clock, full=False), boundary=keys.session(1, START_DIGEST), mode=self._mode,
        )  # fmt: skip
        self._most_us = 2 * self._flight.loaded.bundle.policy.vehicle.endurance_us + AROUND_US
        self._kept = self._flight.loaded.attestation.digest  # of the boundary's own evidence, as stored
        self._world = self._watch(self._flight.vehicle)
        self._utc_us = self._flight.clock.now().utc_us
        self._began_us = 0
        self._begin_life(self._flight)
        self._schedule(self._triggers.start())

    def _config(self, chosen: Callable[..., SimulationConfig], policy: object) -> SimulationConfig:
        start = self._scenario.start
        asked: dict[str, object] = {
            "flavour": AutopilotKind(self._flavour), "seed": self._seed, "answers": Answers.RECORDED,
            "estimate": Estimate.REAL,
        }  # fmt: skip
        equipped = {"camera": self._scenario.has_camera, "gimbal": self._scenario.has_gimbal}
        asked |= {name: fitted for name, fitted in equipped.items() if fitted is not None}
        if start.battery is not None:
            asked["battery"] = start.battery
        if start.wind_mm_s is not None:
            asked["wind"] = Wind(start.wind_mm_s, start.wind_from_deg, start.gust_mm_s)
        return chosen(policy, **asked)

    def _watch(self, vehicle: VirtualVehicle) -> _Watched:
        world = _Watched(self._configs[-1])
        self._connect(vehicle, world)
        return world

    def _connect(self, vehicle: VirtualVehicle, world: _Watched) -> None:
        vehicle.simulation = world
        vehicle.lose = world.send

    # -------------------------------------------------------- incidents

    def _schedule(self, due: Iterable[Due]) -> None:
        for number, at_us in due:
            incident = self._scenario.incidents[number]
            if isinstance(incident.fault, HostFault | AgentFault):
                heappush(self._agenda, (at_us, number))
            else:
                fault = replace(incident.fault, at_us=at_us)
                self._world.inject(fault)
                self._happened.append(IncidentOccurrence(number, at_us, fault, incident.text))

    def _begin_life(self, flight: VirtualFlight) -> None:
        self._flight = flight
        self._began_us = flight.clock.elapsed_us
        self._reactions: list[Reaction] = []
        self._turns: list[Turn] = []
        self._heard_us = flight.clock.elapsed_us
        self._triggers.begin(flight.loaded.policy)
        self._steps = StepWatch(self._machine_us)
        flight.loop._watch = self._stepped  # replaces the flight's own counter

    def _machine_us(self) -> tuple[int, int]:
        clock = self._flight.clock
        return clock.monotonic_us, self._utc_us + clock.elapsed_us + self._stepped_us

    def _stepped(self, now: Now, events: Sequence[Event], actions: Sequence[Action]) -> None:
        """Record a turn of the loop."""
        at_us = self._flight.clock.elapsed_us
        heard = tuple([HeardReadings(event.at_us, event.values) for event in events if isinstance(event, Readings)])
        self._turns.append(Turn(now.monotonic_us - START.monotonic_us, heard))
        for action in actions:
            if isinstance(action, Command) and not action.needs_record:
                self._reactions.append(Reaction(self._heard_us, at_us))
        self._schedule(self._triggers.turned(now, events, actions, at_us))
        self._heard_us = at_us

    # -------------------------------------------------------- processes

    def fly(self) -> ScenarioFlown:
        """Fly until the last process has ended and the vehicle rests or hovers."""
        left: str | None = None
        fault: str | None = None
        also: list[Event] = []
        try:
            while True:
                try:
                    self._live(also)
                    break
                except _Killed:
                    self._bury(lost=True)
                also, left = self._restart()
                if left is not None:
                    break
        except Exception as error:  # noqa: BLE001  any exception of the runtime is a finding
            fault = "".join(format_exception(error))
            self._bury(lost=False)
        ended_us = self._flight.clock.elapsed_us
        self._settle(ended_us)
        return self._flown(ended_us, left, fault)

    def _live(self, also: list[Event]) -> None:
        """Run turns until the end. Raise `_Killed`, or TimeoutError for a run that does not end."""
        flight = self._flight
        while True:
            if flight.clock.elapsed_us >= self._most_us:
                raise TimeoutError(
                    f"no end after {self._most_us // SECOND} s: {flight.runtime.view(flight.clock.now())}"
                )
            sink = self._check_disk()
            also += self._happen()
            also += self._steps.events(flight.clock.now())
            sink.written = sink.kept
            how, also = flight.loop.turn(also), []
            if how is not None:
                self._close(how)
                return

    def _close(self, how: Ending) -> None:
        flight = self._flight
        waits = flight.vehicle.driver.unready if how is Ending.REFUSED else None
        if waits is not None:
            self._notes.append(f"the vehicle was never ready: {waits}")
        flight.close(how)
        self._lives.append(self._life(how.value, tuple(flight.sink.lines)))

    def _check_disk(self) -> _Sink:
        sink = self._flight.sink
        assert isinstance(sink, _Sink)
        sink.full, was_slow = self._is_full(), sink.slow
        sink.slow = self._flight.clock.elapsed_us < self._slow_until_us
        if was_slow and not sink.slow and not sink.full:
            sink.keep()
        return sink

    def _is_full(self) -> bool:
        until_us = self._full_until_us
        return until_us is None or self._flight.clock.elapsed_us < until_us

    def _happen(self) -> list[Event]:
        """Apply due incidents of the host, and return the documents submitted now."""
        events: list[Event] = []
        clock = self._flight.clock
        while self._agenda and self._agenda[0][0] <= clock.elapsed_us:
            _, number = heappop(self._agenda)
            incident = self._scenario.incidents[number]
            fault = replace(incident.fault, at_us=clock.elapsed_us)
            happened = IncidentOccurrence(number, clock.elapsed_us, fault, incident.text)
            self._happened.append(happened)
            if isinstance(fault, AgentFault):
                documents = list(self._documents(number, fault))
                if not documents:
                    self._happened[-1] = happened._replace(note="no step of the mission requires it")
                self._present(fault, documents)
            else:
                self._hurt(fault)
        now_us = clock.now().monotonic_us
        while self._babble and self._babble[0][0] <= clock.elapsed_us:
            events.append(Presented(now_us, heappop(self._babble)[2], 1))
        return events

    def _present(self, fault: AgentFault, documents: Sequence[bytes]) -> None:
        """Submit documents at once; babble comes one document per tick."""
        apart_us = self._tick_us if isinstance(fault, faults.Babble) else 0
        for count, document in enumerate(documents):
            self._drawn += 1
            heappush(self._babble, (fault.at_us + count * apart_us, self._drawn, document))

    def _hurt(self, fault: Fault) -> None:
        """Apply a fault of the host computer."""
        match fault:
            case faults.RuntimeKilled(_, for_us):
                self._dead_us = for_us
                raise _Killed
            case faults.BoundaryKilled():
                self._flight.served.dead = True
            case faults.HostStall(_, for_us):
                self._flight.vehicle.stand_still(for_us)
            case faults.DiskFull(at_us, for_us):
                self._full_until_us = None if for_us is None else at_us + for_us
                self._check_disk()
            case faults.DiskStall(at_us, for_us):
                self._slow_until_us = at_us + for_us
                self._check_disk()
            case faults.ClockStep(_, by_us):
                self._stepped_us += by_us

    def _bury(self, *, lost: bool) -> None:
        """Keep the log of a dead process, recovered as the next run would.

        A process that is killed between two turns may have been writing: in half of the cases the last line of its last
        turn is truncated, or the beginning of a new line is added if that turn wrote none.
        """
        flight, sink = self._flight, self._flight.sink
        assert isinstance(sink, _Sink)
        lines = list(sink.lines)
        chance = Random(f"{self._scenario.name} killed {len(self._lives)} {self._seed}")
        if lost and chance.random() < 0.5:
            line = lines.pop() if len(lines) > sink.written else b'{"_prev":"%s"' % leaf_hash(lines[-1]).hex().encode()
            lines.append(line[: chance.randrange(1, len(line))])
        recovered = self._recovered(lines, flight.clock.now())
        self._lives.append(self._life(None, recovered))

    def _life(self, ending: str | None, lines: tuple[bytes, ...]) -> Life:
        """Return the record of the process that ends now."""
        sink = self._flight.sink
        assert isinstance(sink, _Sink)
        return Life(
            self._began_us, self._flight.clock.elapsed_us, ending, lines, tuple(self._reactions), tuple(self._turns),
            tuple(sink.kept_us),
        )  # fmt: skip

    def _recovered(self, lines: Sequence[bytes], now: Now) -> tuple[bytes, ...]:
        key = self._keys.log
        examination = Examination(key.public)
        kept = [line for line in lines if examination.take(line)]
        found = examination.examined()
        if found.state not in RECOVERABLE:
            self._notes.append(f"a log is `{found.state.value}` and cannot be recovered")
            return tuple(lines)
        draw = partial(int.to_bytes, 1 << 128 | len(self._lives), 32)
        tail = ending(found, now, lambda text: key.sign(text, duty=Duty.LOG), key.public, draw)
        return (*kept, *tail.splitlines(keepends=True))

    def _restart(self) -> tuple[list[Event], str | None]:
        """Start the next run as `rtshcua run` does; return its first events, or why no run was started."""
        while True:
            self._world.advance(self._flight.clock.elapsed_us + self._dead_us)
            self._flight.clock.elapsed_us += self._dead_us
            self._skip()
            if self._flight.clock.elapsed_us >= self._most_us:
                return [], "no run could be started in time"
            events, why = self._meet()
            truth = self._world.truth()
            if why is None or not (truth.in_air or truth.armed):
                return events, why
            self._notes.append(f"a run was not started: {why}")
            self._dead_us = AGAIN_US

    def _skip(self) -> None:
        """Skip due incidents of a process that did not exist; faults of the disk and the clock still apply."""
        clock = self._flight.clock
        while self._agenda and self._agenda[0][0] <= clock.elapsed_us:
            at_us, number = heappop(self._agenda)
            incident = self._scenario.incidents[number]
            fault = replace(incident.fault, at_us=at_us)
            if isinstance(fault, faults.DiskFull | faults.DiskStall | faults.ClockStep):
                self._happened.append(IncidentOccurrence(number, at_us, fault, incident.text))
                self._hurt(fault)
        self._babble = []

    def _meet(self) -> tuple[list[Event], str | None]:
        """Let a new process listen to the vehicle and start a run if it flies; return its events, or why it did not
        start.
        """
        before = self._flight
        clock = VirtualClock(Now(START.monotonic_us, self._utc_us + self._stepped_us, START.utc_error_us))
        clock.elapsed_us = before.clock.elapsed_us
        self._world.advance(clock.elapsed_us)  # frames from before it listened are lost
        bundle = before.loaded.bundle
        policy = bundle.policy
        vehicle = VirtualVehicle(
            policy, self._configs[-1], clock, FrameSession(), manoeuvres=manoeuvres(packs_of(policy.sources)),
            tick_us=self._tick_us,
        )  # fmt: skip
        self._connect(vehicle, self._world)
        vehicle.driver.left = left_by(self._lives[-1].lines, self._bundle, policy, bundle.mission)
        events: list[Event] = []

        def hear(until_us: int, enough: Callable[[], object]) -> None:
            while not enough() and clock.elapsed_us < until_us:
                events.extend(vehicle.poll(clock.monotonic_us, WAIT_US))

        hear(clock.elapsed_us + _HEARTBEAT_US, lambda: vehicle.driver.flavour is not None)
        if vehicle.driver.flavour is not None:
            hear(clock.elapsed_us + _AIR_US, lambda: vehicle.driver.seen.landed_state)
        self._flight.clock.elapsed_us = clock.elapsed_us
        if vehicle.driver.flavour is None:
            return [], "no-vehicle"
        if not (vehicle.driver.seen.airborne or vehicle.driver.seen.armed):
            return [], "replayed"
        full = self._is_full()
        before_hash = leaf_hash(self._lives[-1].lines[-1]).hex()
        session = self._keys.session(len(self._lives) + 1, self._kept)
        try:
            flight = VirtualFlight(
                self._bundle, root=self._root, log_key=self._keys.log, wait_us=WAIT_US, resumed=True, vehicle=vehicle,
                sink=lambda clock: _Sink(clock, full=full), tick_us=self._tick_us, before=before_hash,
                boundary=session,
            )  # fmt: skip
        except OSError as error:
            return [], str(error.strerror)
        except (Untrusted, ValueError) as error:
            return [], str(error)
        self._kept = flight.loaded.attestation.digest
        self._begin_life(flight)
        return events, None

    def _settle(self, since_us: int) -> None:
        """Observe the vehicle without commands until it rests disarmed or has hovered for a while."""
        world, still_us = self._world, since_us
        while world.now_us < since_us + SETTLE_US:
            truth = world.truth()
            if not (truth.in_air or truth.armed or truth.climb_mm_s):
                break
            if truth.speed_mm_s > STILL_MM_S or abs(truth.climb_mm_s) > LEVEL_MM_S:
                still_us = world.now_us
            elif truth.in_air and world.now_us - still_us >= STILL_US:
                break
            world.advance(world.now_us + SAMPLE_US)
        world.advance(world.now_us + SAMPLE_US)

    def _flown(self, ended_us: int, left: str | None, fault: str | None) -> ScenarioFlown:
        bundle, last_us = self._flight.loaded.bundle, self._world.now_us
        return ScenarioFlown(
            scenario=self._scenario,
            flavour=self._flavour,
            seed=self._seed,
            policy=bundle.policy,
            mission=bundle.mission,
            root=cose.unverified(self._root, limit=MAX_ROOT).kid,
            start_us=START.monotonic_us,
            utc_us=self._utc_us,
            tick_us=self._tick_us,
            wait_us=WAIT_US,
            lives=tuple(self._lives),
            happened=tuple(sorted((each for each in self._happened if each.at_us <= last_us), key=lambda h: h.at_us)),
            samples=tuple(self._world.samples),
            frames=tuple(self._world.frames),
            ended_us=ended_us,
            left=left,
            fault=fault,
            notes=tuple(self._notes),
            images=tuple(
                TrueImage(each.utc_us, *each.globe(self._configs[-1].home)) for each in self._world.shots if each.stored
            ),
        )

    # -------------------------------------------------------- documents

    def _documents(self, number: int, fault: AgentFault) -> Iterator[bytes]:
        """Yield the documents of an agent's incident, signed or not."""
        loaded, utc_us = self._flight.loaded, self._flight.clock.now().utc_us
        match fault:
            case faults.Approval(_, role, copies):
                yield from copies * self._answers(loaded, role, 1, utc_us)
            case faults.Disapproval(_, role, copies):
                yield from copies * self._answers(loaded, role, 0, utc_us)
            case faults.Recall(_, copies):
                yield from copies * [self._recall(loaded, utc_us)]
            case faults.Replacement(_, copies):
                yield from copies * [self._replacement(loaded)]
            case faults.Babble(_, copies):
                yield from self._babbled(loaded, utc_us, copies, self._triggers.chances[number])

    def _answers(self, loaded: Loaded, role: str, granted: int, utc_us: int) -> list[bytes]:
        """Return the answers of a role to all requests for its approval."""
        bundle = loaded.bundle
        policy, vehicle = bundle.policy, bundle.policy.vehicle.identity
        if role not in policy.roles:
            return []
        number, people = policy.roles.index(role), self._keys.approvals.get(role, ())
        return [
            sign_approval(
                ApprovalDocument(
                    loaded.in_force.flight, bundle.mission_digest, step.invocation_id, step.binding, vehicle, role,
                    granted, utc_us, utc_us + _SPEAKS_US,
                ),
                key,
            )
            for step in bundle.mission.invocations
            if (asked := confirms(policy, step, number))
            for key in people[: 2 if any(policy.rules[each].second == number for each in asked) else 1]
        ]  # fmt: skip

    def _recall(self, loaded: Loaded, utc_us: int) -> bytes:
        vehicle = loaded.bundle.policy.vehicle.identity
        flight, mission = loaded.in_force.flight, loaded.bundle.mission_digest
        said = RecallDocument(vehicle, flight, mission, b"", utc_us, utc_us + _SPEAKS_US)
        anybody = next(key for people in self._keys.approvals.values() for key in people)
        return sign_recall(said, anybody)

    def _replacement(self, loaded: Loaded) -> bytes:
        """Return a replacement with the mission in force, where later steps have new ids."""
        bundle = loaded.bundle
        present = self._flight.runtime.view(self._flight.clock.now()).step
        kept = min(present + 1, len(bundle.mission.invocations))
        return sign_replacement(
            bundle.mission, over=bundle, flight=loaded.in_force.flight, kept=kept, key=self._keys.mission
        )

    def _babbled(self, loaded: Loaded, utc_us: int, copies: int, chance: Random) -> Iterator[bytes]:
        """Yield random octets, and real documents with a flipped bit, a truncation or repeated octets."""
        real = [self._recall(loaded, utc_us), self._replacement(loaded)]
        for role in loaded.bundle.policy.roles:
            real += self._answers(loaded, role, 1, utc_us)
        for _ in range(copies):
            if chance.random() < 0.3:
                yield chance.randbytes(chance.randrange(_LONGEST_BABBLE))
                continue
            document = bytearray(chance.choice(real))
            at = chance.randrange(len(document))
            match chance.randrange(3):
                case 0:
                    document[at] ^= 1 << chance.randrange(8)
                case 1:
                    del document[at:]
                case _:
                    document[at:at] = document[at : at + 8]
            yield bytes(document)
