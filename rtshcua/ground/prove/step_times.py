"""When each step may begin. E0801, E0805: even on the slowest way its validity is not over by then.

A step begins no sooner after the mission's issue than those before it take at least, and no later than they take at
most: up to `START_WINDOW_US` to the start, and for each step its approval, its deadline, and as long as its contract
allows. A zone to stay out of counts as present if it may exist at some moment between, or while the step lasts; a zone
to stay inside of must exist at all of them. Without a time of issue some one must do: what a step asks of the time of
day is collected here (`StepTime.asked`) and asked of all steps together in `issue_times`, dates excepted.
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

#: how long after its issue a mission may begin
START_WINDOW_US = 300 * 1_000_000


def approval(proof: ProofContext, invocation: PreparedInvocation) -> int:
    """How long a step may wait for approvals."""
    confirms = invocation.candidates.confirms
    at = proof.around(invocation) if confirms else None
    return max((each.rule.within_us for each in confirms if at and each.condition(at) & TRUE), default=0)


_EXACT = (0, 0)


class ClauseFailure(NamedTuple):
    """Whether a condition fails, and at which moment of UTC, where one is known."""

    fails: bool
    moment: int | None = None


@dataclass(slots=True)
class StepTime:
    """A step may begin from `low` to `high` us after the issue, which is 0 where it is not known, and lasts at most
    `lasts_us`. `asked` is what it asks of a time of issue, once it is looked at.
    """

    proof: ProofContext
    issued_at_us: int
    low: int
    high: int
    lasts_us: int
    asked: list[IssueRequirement] = field(default_factory=list)

    def utc(self, further: int) -> tuple[Span, ...]:
        """All moments from its earliest begin to `further` us after its latest, as far as they are known."""
        if not self.issued_at_us:
            return ((0, EVER),)
        return ((self.issued_at_us + self.low, self.issued_at_us + self.high + further),)

    def present(self, airspace: PreparedAirspace, further: int) -> PreparedAirspace:
        """The airspace with those of the zones to stay out of that may exist in that time."""
        return airspace._replace(outside=tuple(each for each in airspace.outside if self._present(each, further)))

    def _present(self, zone: PreparedZone, further: int) -> bool:
        if zone.times is None:
            return True
        truth = zone.times.truth(self.utc(further), _EXACT, 0)
        return bool(truth & TRUE) if self.issued_at_us else truth == TRUE

    def avoidable(self, airspace: PreparedAirspace, further: int) -> Iterator[PreparedZone]:
        """The zones to stay out of that some time of issue avoids, where none is known."""
        if not self.issued_at_us:
            yield from (each for each in airspace.outside if not self._present(each, further))

    def labels(self, airspace: PreparedAirspace, place: PlaceSet, further: int) -> list[tuple[Where, str]]:
        """Which of the zones to stay out of that a place is not clear of exist at some times only."""
        zones = (each for each in airspace.outside if each.times is not None and place.inside(each) != FALSE)
        return [
            (zone_span(self.proof, zone), f"this may exist then: the step may fly {self.from_to(further)}")
            for zone in zones
            if self.issued_at_us
        ]

    def avoid(self, zone: PreparedZone, further: int) -> None:
        """Ask for a time of issue with which a zone does not exist in that time; of one with dates, its issue tells."""
        self._ask_zone(zone, further, exists=False)

    def stay(self, zone: PreparedZone, further: int) -> None:
        """Ask for a time of issue with which a zone to stay inside of exists all that time."""
        self._ask_zone(zone, further, exists=True)

    def _ask_zone(self, zone: PreparedZone, further: int, *, exists: bool) -> None:
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
        label = (zone_span(self.proof, zone), f"`{flat.name}` exists {sometimes} only")
        self._ask(IssueRequirement(arcs, self.low, self.high + further, cycle.period, (label,)))

    def missing(self, airspace: PreparedAirspace, further: int) -> PreparedZone | None:
        """A zone to stay inside of that may not exist all that time; for a time of issue that is known."""
        if self.issued_at_us:
            for zone in airspace.inside:
                if zone.times is not None and zone.times.truth(self.utc(further), _EXACT, 0) != TRUE:
                    return zone
        return None

    def from_to(self, further: int) -> str:
        """That time in words; it is known."""
        local, day = self.proof.prepared.tables.local, reads_days(self.proof.policy)
        ((low, high),) = self.utc(further)
        return f"from {local_time_text(low, local, day=day)} to {local_time_text(high, local, day=day)}, local time"

    def fails(
        self, clause: Clause, arguments: Sequence[int], through: int, holds: Callable[[Span], bool]
    ) -> ClauseFailure:
        """Whether a condition fails at some moment at which the step may begin, or whatever the time of issue: what
        `holds` says of a moment. `through` is how far after it the zones count. What it asks of a time of issue that
        is not known is collected.
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
        if dates:  # on some date it must hold, at some time of the day
            period = max((window.period for window in windows), default=DAY)
            starts = {self.proof.prepared.tables.local.steady(), *(date - period for date in dates)}
            moments = {
                moment
                for start in starts
                for moment in (start, *_moments(windows, dates, start, start + 2 * period + DAY, through))
            }
            return ClauseFailure(not any(holds((moment, moment)) for moment in sorted({0, EVER, *dates, *moments})))
        cycle = IssueCycle.of(self.proof, windows)
        edges = {each - back for each in cycle.edges(windows) for back in (0, through)}
        arcs = arcs_where(edges, lambda at: holds(cycle.at(at)), cycle.period)
        if arcs and arcs[0].length < cycle.period:
            label = (self.proof.span(clause), "the contract asks for this")
            self._ask(IssueRequirement(arcs, self.low, self.high, cycle.period, (label,)))
        return ClauseFailure(not arcs)

    def timed(self, clause: Clause, arguments: Sequence[int]) -> bool:
        """Whether what a condition says depends on the time."""
        return any(changes_read(self.proof, clause, arguments))

    def _ask(self, asked: IssueRequirement) -> None:
        if asked not in self.asked:
            self.asked.append(asked)


def zone_span(proof: ProofContext, zone: PreparedZone) -> Where:
    """Where a zone of the airspace is declared."""
    return proof.context.symbols.zones[proof.policy.zones[zone.number].name].name.span


class MissionStep(NamedTuple):
    """A step of a mission as it is declared, as it is prepared on board, and when it may begin."""

    declared: Step
    prepared: PreparedInvocation
    time: StepTime

    @property
    def span(self) -> Where:
        """Where it is written."""
        return self.declared.span

    @property
    def overrides(self) -> Overrides | None:
        """Its own block, which changes the contract of its skill."""
        return self.declared.overrides

    @property
    def flat(self) -> Invocation:
        """What the bundle carries of it."""
        return self.prepared.invocation

    @property
    def contract(self) -> Contract:
        """The contract under which it flies."""
        return self.prepared.invocation.contract


def mission_steps(
    proof: ProofContext, declared: Sequence[Step], invocations: Sequence[PreparedInvocation]
) -> Iterator[MissionStep]:
    """The steps of a mission, each with the time at which it may begin."""
    earliest, latest = 0, START_WINDOW_US
    for step, invocation in zip(declared, invocations, strict=True):
        flat = invocation.invocation
        latest += approval(proof, invocation) + flat.contract.deadline_us
        yield MissionStep(step, invocation, StepTime(proof, flat.issued_at_us, earliest, latest, invocation.lasts_us))
        latest += flat.contract.duration_us
        time = flat.contract.motion.time
        earliest += flat.arguments[time] if time >= 0 else 0


def at_moment(at: Environment, utc: Span) -> Environment:
    """The same at some moment."""
    return Environment(at.slots, at.arguments, (utc,), (0, 0), at.place, at.monitors, at.phase, at.through)


class IssueCycle(NamedTuple):
    """What stands for all times: a day or a week, `period` us from `base` on, in which local time has one offset. The
    nights in which clocks are set are left for the time of issue.
    """

    base: int
    period: int

    @classmethod
    def of(cls, proof: ProofContext, windows: Sequence[Window]) -> "IssueCycle":
        """The one that shows all that some windows do: a week where one of them is of some days of the week."""
        return cls(proof.prepared.tables.local.steady(), max((each.period for each in windows), default=DAY))

    def at(self, moment: int) -> Span:
        """A moment of it, in us since it began."""
        return (self.base + moment, self.base + moment)

    def edges(self, windows: Sequence[Window]) -> list[int]:
        """When in it something changes of the windows."""
        return [at - self.base for each in windows for at in each.changes(self.base - 1, self.base + self.period - 1)]


def zones_read(proof: ProofContext, clause: Clause, arguments: Sequence[int]) -> Iterator[int]:
    """The zones that a condition asks about, given the arguments."""
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
    """The windows of the local day or week, and the dates, by which something changes that a condition reads."""
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
    """The moments of a time at which something changes, for zones count until `through` us after it."""
    for back in {0, through}:
        for window in windows:
            yield from (moment - back for moment in window.changes(low + back - 1, high + back))
        yield from (date - back for date in dates if low <= date - back <= high)


def prove_validity(proof: ProofContext, steps: Sequence[MissionStep]) -> None:
    """Report every step whose decision may mean nothing any more when its turn comes."""
    latest = START_WINDOW_US
    for step in steps:
        contract = step.contract
        skill = proof.skills[contract.name]
        if not contract.duration_us:
            proof.report.add(
                codes.ENDLESS_STEP,
                step.span,
                f"`{contract.name}` does not end, so nothing after this step would ever begin",
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
                f"this step may begin {display(latest, Dimension.DURATION)} after the mission was issued, and "
                f"`{contract.name}` is valid for {display(contract.validity_us, Dimension.DURATION)}",
                help=f"{display(START_WINDOW_US, Dimension.DURATION)} to the start, then all deadlines, approvals and "
                "durations before it count; move the step forward, or shorten those before it",
                labels=[(validity.span, "declared here")],
            )
            return
        latest += contract.duration_us
