"""X3 through the whole runtime, in virtual time: a flight in which a case strikes at the moment at which a step is
released, and what was dispatched from then on.

Signals are troubled between the driver and the runtime, from the event on that releases the step, so that the step
before it ends untroubled; a stale position is withheld somewhat earlier, within that step's grace. Slack expires
because the sending of the command before takes longer than the deadline. A binding is tampered with, and a request
is replayed, between the runtime and the boundary. The remaining two cases are bundles that a compiler of ours refuses.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from re import findall
from typing import Any, Final, NamedTuple

from msgspec.structs import replace

from rtshcua.adapters.loop import RunLoop
from rtshcua.evaluation import cases
from rtshcua.evaluation.cases import BY_NAME, CASES, EvaluationCase
from rtshcua.evaluation.design import POINTS, EvaluationPoint, WorkUnit
from rtshcua.evaluation.results import CaseFlight
from rtshcua.evaluation.sources import fitted
from rtshcua.evaluation.worlds import FlatProgram, program_at, root_of
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.situation import Now
from rtshcua.model.outcome import Outcome
from rtshcua.onboard.ports import Command, Ending, Event, Readings, Sent, Succeeded
from rtshcua.simulation.config import AutopilotKind, SimulationConfig
from rtshcua.simulation.world import Truth
from rtshcua.virtual import development_keys
from rtshcua.virtual.fitting import with_room
from rtshcua.virtual.flight import VirtualFlight
from rtshcua.wire.keys import Duty
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP, decode

#: the experiment of these flights, and of the checks without flights
NAME: Final = "X3"
FLAVOURS: Final = tuple(each.value for each in AutopilotKind)
#: cases that strike a takeoff too: it reads no link, obstacle and wind, and no command before it uses up its slack
ON_GROUND: Final = tuple(each for each in CASES if each.number not in (2, 4, 5, 6))
#: us beyond its `stale after` before the release from which on a stale position is withheld
_STALE_SOONER_US: Final = 300_000
#: us by which the sending of the command before seems to take longer than the deadline
_LONGER_US: Final = 10_000
#: mm: how far a vehicle moves at most that is to stay, with the way in which it stops; at least on a survey; and how
#: far from where it is to land
_STAYS_MM, _SURVEYS_MM, _LANDS_MM = 20_000, 20_000, 10_000
#: us by which a fallback may be later than its deadline
_LATE_US: Final = 200_000
_TICK_US, _WAIT_US = 50_000, 100_000


def units(points: Sequence[EvaluationPoint] = (), *, quick: bool = False) -> list[WorkUnit]:
    """One unit for each flight: each case with each flavour in the air, and on the ground. Every case flies at all
    `points`, by default at one of its own; `quick`: each on the ground only, where it stays there, and four in the air,
    in the shortest mission.
    """
    if quick:
        points = POINTS[:1]
    return [
        WorkUnit(NAME, ("flight", case.name, *point, flavour, place))
        for number, case in enumerate(CASES)
        for turn, flavour in enumerate(FLAVOURS)
        for point in points or (POINTS[(number * 5 + turn * 11) % len(POINTS)],)
        for place in (("aloft", "ground") if case in ON_GROUND else ("aloft",))
        if not quick or (place == "ground" and case is not cases.ALLOWED) or (place == "aloft" and number % 6 == turn)
    ]


def run(unit: WorkUnit) -> list[CaseFlight]:
    """Fly the case of a unit."""
    _, name, mission, deadline_us, flavour, place = unit.key
    point, case = EvaluationPoint(str(mission), int(deadline_us)), BY_NAME[str(name)]
    aloft, program = place == "aloft", program_at(point)
    step = cases.struck_step(program.mission) if aloft else 0
    released_us = _released_us(program, str(flavour), step) if case.stale and aloft else 0
    flown = _Struck(cases.program_of(case, program, step), case, step, str(flavour), released_us).fly()
    found = _judge(flown, program.mission.invocations[step], case, aloft=aloft)
    return [
        CaseFlight(
            case=case.name, mission=point.mission, deadline_us=point.deadline_us, flavour=str(flavour), seed=_SEED,
            aloft=aloft, expected=_expected(case, aloft=aloft),
            dispatched=tuple(each.text for each in flown.dispatched), ending=flown.ending, holds=not found,
            differs="; ".join(found),
        )
    ]  # fmt: skip


_SEED: Final = 1


class Dispatched(NamedTuple):
    """A dispatched command: when, in us since the start of the flight, its subject, and its text."""

    at_us: int
    kind: int
    step: int
    link: int
    text: str


class Sample(NamedTuple):
    """The true state of the vehicle at a moment."""

    at_us: int
    truth: Truth


class Flown(NamedTuple):
    """What followed since the case struck: the first decision about the step, commands, and motion."""

    struck_us: int
    decided: tuple[str, str]
    dispatched: tuple[Dispatched, ...]
    samples: tuple[Sample, ...]
    ending: str


@lru_cache(maxsize=64)
def _released_us(program: FlatProgram, flavour: str, step: int) -> int:
    """When the step is released in an untroubled flight, in us since its start."""
    flight = _Struck(program, cases.ALLOWED, step, flavour, 0)
    flight.fly(only_to_release=True)
    return flight.struck_us


class _Struck:
    """The vehicle of a flight, as the runtime sees it: troubled by a case from the release of one step on."""

    def __init__(self, program: FlatProgram, case: EvaluationCase, step: int, flavour: str, released_us: int) -> None:
        self._case, self._step, self._released_us = case, step, released_us
        policy, mission = program
        config = simulated(program, flavour=AutopilotKind(flavour), seed=_SEED)
        self._flight = flight = VirtualFlight(
            development_keys.seal(policy, mission), lambda _: config, root=root_of(policy),
            log_key=development_keys.keys()[Duty.LOG], tick_us=_TICK_US, wait_us=_WAIT_US,
            boundary=development_keys.keys()[Duty.BOUNDARY],
        )  # fmt: skip
        flight.loop = RunLoop(
            flight.runtime, self, flight.sink, flight.clock, lambda *_: None, _WAIT_US, prepares=False
        )
        signals = {each.name: each for each in policy.signals}
        self._values: Mapping[int, int | None] = {signals[name].slot: each for name, each in case.values.items()}
        self._stale = signals.get(case.stale)
        self._deadline_us = mission.invocations[step].contract.deadline_us
        if case in (cases.TAMPERED, cases.REPLAY):
            self._stand_between()
        if case is cases.EXPIRED_SLACK:
            self._delay()
        #: when the step was released, in us since the start of the flight; -1 before
        self.struck_us = -1
        self._samples: list[Sample] = []

    def fly(self, *, only_to_release: bool = False) -> Flown:
        """Fly to the end, or to the release of the step."""
        flight = self._flight
        ending = flight.prepare()
        while ending is None and not (only_to_release and self.struck_us >= 0):
            ending = flight.turn()
            if self.struck_us >= 0:
                self._samples.append(Sample(flight.clock.elapsed_us, flight.vehicle.simulation.truth()))
        flown = flight.close(ending or Ending.INTERRUPTED)
        start_us = flight.clock.start_us
        sent = (
            Dispatched(each["at_us"] - start_us, each["kind"], each["step"], each["link"], each["detail"])
            for each in flown.effects("dispatched")
        )
        about = [(outcome, reason) for step, outcome, reason in flown.decisions() if step == self._step]
        return Flown(
            self.struck_us, about[0] if about else ("undecided", ""),
            tuple(each for each in sent if each.at_us >= self.struck_us), tuple(self._samples), flown.ending.value,
        )  # fmt: skip

    # ------------------------------------------------------------ the vehicle, as the port of the runtime

    def poll(self, now_us: int, timeout_us: int) -> Sequence[Event]:
        """The events of the vehicle, with the case's trouble."""
        found: list[Event] = []
        for event in self._flight.vehicle.poll(now_us, timeout_us):
            if self.struck_us < 0 and self._releases(event):
                self.struck_us = self._flight.clock.elapsed_us
                if self._values:
                    found.append(Readings(self._flight.clock.monotonic_us, tuple(self._values.items())))
            found.append(self._troubled(event) if isinstance(event, Readings) else event)
        return found

    def begin(self, command: Command, now_us: int) -> None:
        """Begin a command."""
        self._flight.vehicle.begin(command, now_us)

    def release(self) -> None:
        """Release the vehicle."""
        self._flight.vehicle.release()

    def announce(self, severity: int, text: str) -> None:
        """Send a text."""
        self._flight.vehicle.announce(severity, text)

    def expect(self, steps: Sequence[Invocation]) -> None:
        """Request reports."""
        self._flight.vehicle.expect(steps)

    def _current(self) -> int:
        return self._flight.runtime.view(self._flight.clock.now()).step

    def _releases(self, event: Event) -> bool:
        """Whether an event releases the step: the success of the one before, or, for the first, any event."""
        return self._step == 0 or (isinstance(event, Succeeded) and self._current() == self._step - 1)

    def _troubled(self, readings: Readings) -> Readings:
        values = readings.values
        if self.struck_us >= 0:
            values = tuple((slot, self._values.get(slot, value)) for slot, value in values)
        stale = self._stale
        if stale is not None:
            from_us = self._released_us - stale.stale_us - _STALE_SOONER_US
            if self._flight.clock.elapsed_us >= from_us:
                values = tuple(each for each in values if each[0] not in stale.slots)
        return Readings(readings.at_us, values)

    def _delay(self) -> None:
        """Report the commands before the step as sent later than they were, by more than the deadline."""
        runtime, later_us = self._flight.runtime, self._deadline_us + _LONGER_US
        react = runtime.react

        def delayed(now: Now, events: Sequence[Event]) -> Command | None:
            late = [replace(each, at_us=each.at_us + later_us) if isinstance(each, Sent) else each for each in events]
            return react(now, late if self._current() == self._step - 1 else events)

        vars(runtime)["react"] = delayed

    def _stand_between(self) -> None:
        """Tamper with the request for the step, or use it up before it arrives."""
        boundary, policy = self._flight.loaded.boundary, self._flight.loaded.policy
        honest, slots, monitors = boundary.enforce, policy.policy.slots, len(policy.monitors)

        def enforce(request: bytes) -> bytes:
            asked = decode(request, slots, monitors)
            if getattr(asked, "kind", None) != STEP or getattr(asked, "step", None) != self._step:
                return honest(request)
            if self._case is cases.REPLAY:
                honest(request)
                return honest(request)
            binding = self._flight.loaded.invocations[self._step].invocation.binding
            return honest(request.replace(binding, binding[:-1] + bytes([binding[-1] ^ 1])))

        vars(boundary)["enforce"] = enforce


def simulated(program: FlatProgram, **chosen: Any) -> SimulationConfig:
    """A simulated vehicle for a program, with a fence of its own that holds the mission; `chosen` overrides fields."""
    policy, mission = program
    return with_room(fitted(policy, **chosen), policy, mission.invocations)


# ---------------------------------------------------------------- what must follow


def _expected(case: EvaluationCase, *, aloft: bool) -> str:
    if case.outcome is Outcome.ALLOW:
        return "the step's own command, and the mission is completed"
    if not aloft:
        return "nothing"
    return {
        Outcome.FALLBACK: "the first admissible link of the step's fallback, down to a landing",
        Outcome.DEFER: "nothing until the deadline, or sooner the end of the grace of what the step maintains; then "
        "the first admissible link, down to a landing",
        Outcome.DENY: "the contingency, down to a landing",
    }[case.outcome]


def _judge(flown: Flown, step: Invocation, case: EvaluationCase, *, aloft: bool) -> list[str]:
    """What differs from what must follow, in words."""
    found = []
    if flown.decided != (case.outcome.name.lower(), case.reason.value):
        found.append(f"decided: {' because '.join(flown.decided)}")
    if case.outcome is Outcome.ALLOW:
        return [*found, *_judge_allowed(flown, step)]
    if not aloft:
        if flown.dispatched or any(each.truth.in_air or each.truth.armed for each in flown.samples):
            found.append("something was dispatched on the ground, or the vehicle was armed")
        return found
    return [*found, *_judge_links(flown, step, case)]


def _judge_links(flown: Flown, step: Invocation, case: EvaluationCase) -> list[str]:
    """Whether the links that must follow in the air were dispatched, and in time."""
    found = []
    waits_us = _waits_us(step, case)
    # while a step waits the vehicle is held, where it can be
    after = [each for each in flown.dispatched if each.at_us >= flown.struck_us + waits_us]
    held = flown.dispatched[: len(flown.dispatched) - len(after)]
    found += [f"dispatched while the step was deferred: `{each.text}`" for each in held if each.text != "hover"]
    denied = case.outcome is Outcome.DENY
    expected = (CONTINGENCY_LINK, -1, 0) if denied else (FALLBACK_LINK, step.step, _link(step, case))
    if not after or after[0][1:4] != expected:
        return [*found, f"dispatched first: {after[:1]}, not {expected}"]
    if any(each.kind == STEP for each in after):
        found.append("a step was dispatched")
    late_us = after[0].at_us - flown.struck_us - waits_us
    if late_us > _LATE_US:
        found.append(f"the link was dispatched {late_us} us after it had to be")
    return [*found, *_judge_descent(flown, after, case)]


def _waits_us(step: Invocation, case: EvaluationCase) -> int:
    """For how long a step waits in the air: while it is deferred until its deadline. What it maintains holds for the
    wait too, so that a signal of it that stays unknown ends the wait after the step's grace.
    """
    if case.outcome is not Outcome.DEFER:
        return 0
    contract = step.contract
    unknown = (*case.values, case.stale)
    maintained = any(
        name and name in findall(r"[\w.]+", clause.text) for clause in contract.maintain for name in unknown
    )
    return min(contract.deadline_us, contract.grace_us) if maintained else contract.deadline_us


def _link(step: Invocation, case: EvaluationCase) -> int:
    """The first link that may fly: `return_home` alone needs something, a fix of the receiver and its position."""
    names = [each.text.partition(" ")[0].partition("(")[0] for each in step.contract.fallback]
    lacks = "gps.fix" in case.values or bool(case.stale)
    return next(at for at, name in enumerate(names) if not (lacks and name == "return_home"))


def _judge_allowed(flown: Flown, step: Invocation) -> list[str]:
    first = flown.dispatched[0] if flown.dispatched else None
    if first is None or (first.kind, first.step) != (STEP, step.step):
        return [f"dispatched first: {first}"]
    found = [] if flown.ending == Ending.COMPLETED else [f"the mission ended: {flown.ending}"]
    moved_mm = _moved_mm(flown, first, flown.dispatched[1] if len(flown.dispatched) > 1 else None)
    surveys = step.plan.kind == MotionKind.COVER
    if moved_mm < _SURVEYS_MM if surveys else moved_mm > _STAYS_MM:
        found.append(f"the vehicle moved by {moved_mm} mm in `{step.contract.name}`")
    return found


def _judge_descent(flown: Flown, links: Sequence[Dispatched], case: EvaluationCase) -> list[str]:
    """Whether a held vehicle stayed, and whether it landed where the last link leads."""
    found = []
    struck, first = flown.samples[0].truth, links[0]
    after = links[1] if len(links) > 1 else None
    if case.outcome is Outcome.DEFER and (moved_mm := _moved_mm(flown, flown.samples[0], first)) > _STAYS_MM:
        found.append(f"the vehicle moved by {moved_mm} mm while the step was deferred")
    if "hover" in first.text and (moved_mm := _moved_mm(flown, first, after)) > _STAYS_MM:
        found.append(f"the vehicle moved by {moved_mm} mm in `{first.text}`")
    last = flown.samples[-1].truth
    if last.in_air or last.crashed:
        found.append("the vehicle is in the air, or crashed")
    at = (0, 0) if "return_home" in links[-1].text else (struck.north_mm, struck.east_mm)
    if max(abs(last.north_mm - at[0]), abs(last.east_mm - at[1])) > _LANDS_MM:
        found.append(f"landed at {last.north_mm}, {last.east_mm} mm after `{links[-1].text}`")
    return found


def _moved_mm(flown: Flown, since: Dispatched | Sample, until: Dispatched | None) -> int:
    """The greatest distance from its place at a moment, along either axis, up to a later one."""
    during = [
        each.truth
        for each in flown.samples
        if since.at_us <= each.at_us and (until is None or each.at_us <= until.at_us)
    ]
    return max(
        (max(abs(each.north_mm - during[0].north_mm), abs(each.east_mm - during[0].east_mm)) for each in during),
        default=0,
    )
