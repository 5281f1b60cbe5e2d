"""The time at which each step may begin, and the proof that its decision is still valid then (E0801, E0805).

The earliest begin after the mission's issue is the least time of the steps before. The latest is `START_WINDOW_US` plus
the approval, the deadline and the duration of each step before. An `outside` zone counts if it may exist at some time
between, or while the step lasts. An `inside` zone must exist at all of these times. If the time of issue is unknown,
one suitable time of issue must exist: the requirements of each step are collected here (`StepTime.requirements`), and
`issue_times` proves them for all steps together. Dates are not considered then.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from rtshcua.decision.evaluate import Environment
from rtshcua.decision.prepare import PreparedAirspace, PreparedInvocation
from rtshcua.decision.times import Window, daily, weekly, windows_of
from rtshcua.decision.values import FALSE, TRUE, Span
from rtshcua.decision.zones import PlaceSet, PreparedZone
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span as Where
from rtshcua.ground.analysis.daytime import IssueRequirement, arcs_where
from rtshcua.ground.analysis.space import reads_days
from rtshcua.ground.analysis.witness import local_time_text
from rtshcua.ground.prove.proof_context import EVER, ProofContext
from rtshcua.model.flat.code import Clause, Op
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.limits import DAY
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.ir.missions import Overrides, Step
from rtshcua.model.quantity import Dimension, display

#: longest time from the issue of a mission to its start
START_WINDOW_US = 300 * 1_000_000


def approval(proof: ProofContext, invocation: PreparedInvocation) -> int:
    """Return the longest time in us that a step may wait for approvals."""
    confirms = invocation.candidates.confirms
    at = proof.around(invocation) if confirms else None
    return max((each.rule.within_us for each in confirms if at and each.condition(at) & TRUE), default=0)


_EXACT = (0, 0)


class ClauseFailure(NamedTuple):
    """Whether a condition fails, and the UTC time at which it does, if it is known."""

    fails: bool
    moment: int | None = None


@dataclass(slots=True)
class StepTime:
    """The time of a step: it begins from `low` to `high` us after the issue and lasts at most `lasts_us`.

    `issued_at_us` is 0 if the time of issue is unknown. `requirements` of that time are added by the proofs.
    """

    proof: ProofContext
    issued_at_us: int
    low: int
    high: int
    lasts_us: int
    requirements: list[IssueRequirement] = field(default_factory=list)

    def utc(self, further: int) -> tuple[Span, ...]:
        """Return the times from its earliest begin to `further` us after its latest; all times if unknown."""
        if not self.issued_at_us:
            return ((0, EVER),)
        return ((self.issued_at_us + self.low, self.issued_at_us + self.high + further),)

    def present(self, airspace: PreparedAirspace, further: int) -> PreparedAirspace:
        """Return the airspace without `outside` zones that cannot exist until `further` us after the latest begin."""
        return airspace._replace(outside=tuple(each for each in airspace.outside if self._present(each, further)))

    def _present(self, zone: PreparedZone, further: int) -> bool:
        if zone.times is None:
            return True
        truth = zone.times.truth(self.utc(further), _EXACT, 0)
        return bool(truth & TRUE) if self.issued_at_us else truth == TRUE

    def avoidable(self, airspace: PreparedAirspace, further: int) -> Iterator[PreparedZone]:
        """Yield the `outside` zones that a suitable time of issue avoids, if that time is unknown."""
        if not self.issued_at_us:
            yield from (each for each in airspace.outside if not self._present(each, further))

    def labels(self, airspace: PreparedAirspace, place: PlaceSet, further: int) -> list[tuple[Where, str]]:
        """Return labels for the zones that a place may touch and that exist only at some times."""
        zones = (each for each in airspace.outside if each.times is not None and place.inside(each) != FALSE)
        return [
            (zone_span(self.proof, zone), f"this zone may exist then: the step may fly {self.from_to(further)}")
            for zone in zones
            if self.issued_at_us
        ]

    def avoid(self, zone: PreparedZone, further: int) -> None:
        """Require a time of issue with which a zone does not exist during the step. Zones with dates are ignored."""
        self._require_zone(zone, further, exists=False)

    def stay(self, zone: PreparedZone, further: int) -> None:
        """Require a time of issue with which an `inside` zone exists during the whole step."""
        self._require_zone(zone, further, exists=True)

    def _require_zone(self, zone: PreparedZone, further: int, *, exists: bool) -> None:
        flat = self.proof.policy.zones[zone.number]
        if not (flat.daily or flat.weekly) or flat.dates or self.issued_at_us:
            return
        windows = windows_of(flat, self.proof.prepared.tables.local)
        cycle = IssueCycle.of(self.proof, windows)
        wanted, (window,) = TRUE if exists else FALSE, windows
        arcs = arcs_where(
            cycle.edges(windows), lambda at: window.truth((cycle.at(at),), _EXACT) == wanted, cycle.period
        )
        sometimes = "at some times of the day" if flat.daily else "at some times of the week"
        label = (zone_span(self.proof, zone), f"`{flat.name}` exists only {sometimes}")
        self._require(IssueRequirement(arcs, self.low, self.high + further, cycle.period, (label,)))

    def missing(self, airspace: PreparedAirspace, further: int) -> PreparedZone | None:
        """Return an `inside` zone that may not exist during the whole step, if the time of issue is known."""
        if self.issued_at_us:
            for zone in airspace.inside:
                if zone.times is not None and zone.times.truth(self.utc(further), _EXACT, 0) != TRUE:
                    return zone
        return None

    def from_to(self, further: int) -> str:
        """Format the time until `further` us after the latest begin. The time of issue must be known."""
        local, day = self.proof.prepared.tables.local, reads_days(self.proof.policy)
        ((low, high),) = self.utc(further)
        return f"from {local_time_text(low, local, day=day)} to {local_time_text(high, local, day=day)}, local time"

    def fails(
        self, clause: Clause, arguments: Sequence[int], through: int, holds: Callable[[Span], bool]
    ) -> ClauseFailure:
        """Return whether a condition fails at some time at which the step may begin.

        `holds` evaluates the condition over a time span, and zones count until `through` us after it. If the time of
        issue is unknown, the condition fails only if it fails for every time of issue; else a requirement is added.
        """
        windows, dates = changes_read(self.proof, clause, arguments)
        if self.issued_at_us:
            ((low, high),) = self.utc(0)
            for moment in sorted({low, high, *_moments(windows, dates, low, high, through)}):
                if not holds((moment, moment)):
                    return ClauseFailure(True, moment)
            return ClauseFailure(False)
        if not windows and not dates:
            return ClauseFailure(not holds((0, EVER)))
        if dates:  # it must hold on some date, at some time of the day
            moments = sorted({0, EVER, *dates, *self._around_dates(windows, dates, through)})
            return ClauseFailure(not any(holds((moment, moment)) for moment in moments))
        cycle = IssueCycle.of(self.proof, windows)
        edges = {each - back for each in cycle.edges(windows) for back in (0, through)}
        arcs = arcs_where(edges, lambda at: holds(cycle.at(at)), cycle.period)
        if arcs and arcs[0].length < cycle.period:
            label = (self.proof.span(clause), "the contract contains this condition")
            self._require(IssueRequirement(arcs, self.low, self.high, cycle.period, (label,)))
        return ClauseFailure(not arcs)

    def _around_dates(self, windows: Sequence[Window], dates: Sequence[int], through: int) -> Iterator[int]:
        """Yield the times around dates, and around an ordinary day, at which a window or a date changes the value."""
        period = max((window.period for window in windows), default=DAY)
        for start in {self.proof.prepared.tables.local.steady(), *(date - period for date in dates)}:
            yield from (start, *_moments(windows, dates, start, start + 2 * period + DAY, through))

    def timed(self, clause: Clause, arguments: Sequence[int]) -> bool:
        """Whether the value of a condition depends on the time."""
        return any(changes_read(self.proof, clause, arguments))

    def _require(self, requirement: IssueRequirement) -> None:
        if requirement not in self.requirements:
            self.requirements.append(requirement)


def zone_span(proof: ProofContext, zone: PreparedZone) -> Where:
    """Return the span of the name in a zone's declaration."""
    return proof.context.symbols.zones[proof.policy.zones[zone.number].name].name.span


class MissionStep(NamedTuple):
    """A step of a mission: as declared, as prepared on board, and the time at which it may begin."""

    declared: Step
    prepared: PreparedInvocation
    time: StepTime

    @property
    def span(self) -> Where:
        """The span of the step in the source."""
        return self.declared.span

    @property
    def overrides(self) -> Overrides | None:
        """The step's own block, which changes the contract of its skill."""
        return self.declared.overrides

    @property
    def flat(self) -> Invocation:
        """The step in the flat form."""
        return self.prepared.invocation

    @property
    def contract(self) -> Contract:
        """The contract of the step."""
        return self.prepared.invocation.contract


def mission_steps(
    proof: ProofContext, declared: Sequence[Step], invocations: Sequence[PreparedInvocation]
) -> Iterator[MissionStep]:
    """Yield the steps of a mission, each with the time at which it may begin."""
    earliest, latest = 0, START_WINDOW_US
    for step, invocation in zip(declared, invocations, strict=True):
        flat = invocation.invocation
        latest += approval(proof, invocation) + flat.contract.deadline_us
        yield MissionStep(step, invocation, StepTime(proof, flat.issued_at_us, earliest, latest, invocation.lasts_us))
        latest += flat.contract.duration_us
        time = flat.contract.motion.time
        earliest += flat.arguments[time] if time >= 0 else 0


def at_moment(at: Environment, utc: Span) -> Environment:
    """Return an environment at another time."""
    return Environment(at.slots, at.arguments, (utc,), (0, 0), at.place, at.monitors, at.phase, at.through)


class IssueCycle(NamedTuple):
    """A day or a week that represents all times: `period` us from `base` on, with one offset of local time.

    Changes of the offset, as for daylight saving time, are not represented.
    """

    base: int
    period: int

    @classmethod
    def of(cls, proof: ProofContext, windows: Sequence[Window]) -> "IssueCycle":
        """Return the cycle for some windows: a week if one of them depends on the day of the week, else a day."""
        return cls(proof.prepared.tables.local.steady(), max((each.period for each in windows), default=DAY))

    def at(self, moment: int) -> Span:
        """Return the UTC span of a time in the cycle, given in us since its begin."""
        return (self.base + moment, self.base + moment)

    def edges(self, windows: Sequence[Window]) -> list[int]:
        """Return the times in the cycle at which one of the windows opens or closes."""
        return [at - self.base for each in windows for at in each.changes(self.base - 1, self.base + self.period - 1)]


def zones_read(proof: ProofContext, clause: Clause, arguments: Sequence[int]) -> Iterator[int]:
    """Yield the zones that a condition reads, with some arguments."""
    tables = proof.prepared.tables.tables
    for op, a, b in zip(clause.code[::3], clause.code[1::3], clause.code[2::3], strict=True):
        match op:
            case Op.POSITION_IN:
                yield a
            case Op.ARGUMENT_POINT_IN:
                yield b
            case Op.POSITION_IN_ARGUMENT:
                yield tables[b][arguments[a]]


def changes_read(proof: ProofContext, clause: Clause, arguments: Sequence[int]) -> tuple[list[Window], list[int]]:
    """Return the windows of the local day or week, and the dates, on which the value of a condition depends."""
    policy, local = proof.policy, proof.prepared.tables.local
    read = [policy.zones[number] for number in zones_read(proof, clause, arguments)]
    windows: list[Window] = []
    for op, a, b in zip(clause.code[::3], clause.code[1::3], clause.code[2::3], strict=True):
        if op == Op.TIME_IN:
            windows.append(daily(a, b, local))
        elif op == Op.WEEK_IN:
            windows.append(weekly(policy.sets[a], local))
    windows += [window for zone in read for window in windows_of(zone, local)]
    return windows, [date for zone in read if zone.dates for date in (zone.dates[0], zone.dates[1] + 1)]


def _moments(windows: Sequence[Window], dates: Sequence[int], low: int, high: int, through: int) -> Iterator[int]:
    """Yield the times from `low` to `high` at which a window or a date changes the value, `through` included."""
    for back in {0, through}:
        for window in windows:
            yield from (moment - back for moment in window.changes(low + back - 1, high + back))
        yield from (date - back for date in dates if low <= date - back <= high)


def prove_validity(proof: ProofContext, steps: Sequence[MissionStep]) -> None:
    """Report the first step whose decision may have expired when its turn comes."""
    latest = START_WINDOW_US
    for step in steps:
        contract = step.contract
        skill = proof.skills[contract.name]
        if not contract.duration_us:
            proof.report.add(
                codes.ENDLESS_STEP,
                step.span,
                f"`{contract.name}` has no end, so no step after this one would ever begin",
                help="add `lasts at most` to the skill",
                labels=[(skill.name.span, "declared here, without `lasts at most`")],
            )
            return
        latest += approval(proof, step.prepared) + contract.deadline_us
        if latest > contract.validity_us:
            validity = (step.overrides and step.overrides.validity) or skill.validity
            assert validity is not None
            proof.report.add(
                codes.VALIDITY_TOO_SHORT,
                step.span,
                f"this step may begin {display(latest, Dimension.DURATION)} after the issue of the mission, but "
                f"`{contract.name}` is valid for {display(contract.validity_us, Dimension.DURATION)}",
                help="move the step forward, or shorten the steps before it; the time includes "
                f"{display(START_WINDOW_US, Dimension.DURATION)} to the start, and all deadlines, approvals and "
                "durations before the step",
                labels=[(validity.span, "declared here")],
            )
            return
        latest += contract.duration_us
