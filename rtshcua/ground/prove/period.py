"""When a step may come, and what of zones and of conditions changes then.

A step comes no sooner after the mission's issue than those before it take at least, and no later than they take at
most. A zone to stay out of counts as present if it may exist at some moment between, or while the step lasts; a zone to
stay inside of must exist at all of them. Without a time of issue there must be some one that will do: what a step asks
of the time of day is collected here (`Period.asked`), and all of a mission is asked together (`some_time`). Dates are
left for the time of issue.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from rtshcua.decision.evaluate import Environment
from rtshcua.decision.prepare import PreparedAirspace, PreparedInvocation
from rtshcua.decision.times import Window, daily, weekly, windows_of
from rtshcua.decision.values import AND, FALSE, NOT, TRUE, Span, Truth
from rtshcua.decision.zones import Place, PreparedZone
from rtshcua.diagnostics.span import Span as Where
from rtshcua.ground.analysis.daytime import Asked, arcs_where
from rtshcua.ground.analysis.space import reads_days
from rtshcua.ground.analysis.words import clock
from rtshcua.ground.prove.line import Line
from rtshcua.ground.prove.situation import EVER, Ground
from rtshcua.ground.prove.timing import START_WINDOW_US, approval
from rtshcua.model.flat.code import Clause, Op
from rtshcua.model.flat.limits import DAY

_EXACT = (0, 0)


class Found(NamedTuple):
    """Whether a condition fails, and at which moment of UTC, where one is known."""

    fails: bool
    moment: int | None = None


@dataclass(slots=True)
class Period:
    """A step may begin from `low` to `high` us after the issue, which is 0 where it is not known, and lasts at most
    `lasts_us`. `asked` is what it asks of a time of issue, once it is looked at.
    """

    ground: Ground
    issued_at_us: int
    low: int
    high: int
    lasts_us: int
    asked: list[Asked] = field(default_factory=list)

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

    def labels(self, airspace: PreparedAirspace, place: Place, further: int) -> list[tuple[Where, str]]:
        """Which of the zones to stay out of that a place is not clear of exist at some times only."""
        zones = (each for each in airspace.outside if each.times is not None and place.inside(each) != FALSE)
        return [
            (zone_span(self.ground, zone), f"this may exist then: the step may fly {self.from_to(further)}")
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
        flat = self.ground.prepared.policy.zones[zone.number]
        if not (flat.daily or flat.weekly) or flat.dates or self.issued_at_us:
            return
        windows = windows_of(flat, self.ground.prepared.tables.local)
        cycle = Cycle.of(self.ground, windows)
        wanted, (window,) = TRUE if exists else FALSE, windows
        arcs = arcs_where(
            cycle.edges(windows), lambda at: window.truth((cycle.at(at),), _EXACT) == wanted, cycle.period
        )
        sometimes = "at some times of the day" if flat.daily else "at some times of the week"
        label = (zone_span(self.ground, zone), f"`{flat.name}` exists {sometimes} only")
        self._ask(Asked(arcs, self.low, self.high + further, cycle.period, (label,)))

    def missing(self, airspace: PreparedAirspace, further: int) -> PreparedZone | None:
        """A zone to stay inside of that may not exist all that time; for a time of issue that is known."""
        if self.issued_at_us:
            for zone in airspace.inside:
                if zone.times is not None and zone.times.truth(self.utc(further), _EXACT, 0) != TRUE:
                    return zone
        return None

    def from_to(self, further: int) -> str:
        """That time in words; it is known."""
        local, day = self.ground.prepared.tables.local, reads_days(self.ground.prepared.policy)
        ((low, high),) = self.utc(further)
        return f"from {clock(low, local, day=day)} to {clock(high, local, day=day)}, local time"

    def fails(
        self,
        clause: Clause,
        arguments: Sequence[int],
        through: int,
        holds: Callable[[Span], bool],
    ) -> Found:
        """Whether a condition fails at some moment at which the step may begin, or whatever the time of issue: what
        `holds` says of a moment. `through` is how far after it the zones count. What it asks of a time of issue that
        is not known is collected.
        """
        windows, dates = changes(self.ground, clause, arguments)
        if self.issued_at_us:
            ((low, high),) = self.utc(0)
            for moment in sorted({low, high, *_moments(windows, dates, low, high, through)}):
                if not holds((moment, moment)):
                    return Found(True, moment)
            return Found(False)
        if not windows and not dates:
            return Found(not holds((0, EVER)))
        if dates:  # on some date it must hold, at some time of the day
            period = max((window.period for window in windows), default=DAY)
            starts = {self.ground.prepared.tables.local.steady(), *(date - period for date in dates)}
            moments = {
                moment
                for start in starts
                for moment in (start, *_moments(windows, dates, start, start + 2 * period + DAY, through))
            }
            return Found(not any(holds((moment, moment)) for moment in sorted({0, EVER, *dates, *moments})))
        cycle = Cycle.of(self.ground, windows)
        edges = {each - back for each in cycle.edges(windows) for back in (0, through)}
        arcs = arcs_where(edges, lambda at: holds(cycle.at(at)), cycle.period)
        if arcs and arcs[0].length < cycle.period:
            label = (self.ground.span(clause), "the contract asks for this")
            self._ask(Asked(arcs, self.low, self.high, cycle.period, (label,)))
        return Found(not arcs)

    def timed(self, clause: Clause, arguments: Sequence[int]) -> bool:
        """Whether what a condition says depends on the time."""
        return any(changes(self.ground, clause, arguments))

    def _ask(self, asked: Asked) -> None:
        if asked not in self.asked:
            self.asked.append(asked)


def zone_span(ground: Ground, zone: PreparedZone) -> Where:
    """Where a zone of the airspace is declared."""
    return ground.context.symbols.zones[ground.prepared.policy.zones[zone.number].name].name.span


def periods(ground: Ground, invocations: Sequence[PreparedInvocation]) -> list[Period]:
    """When each step of a mission may begin."""
    earliest, latest = 0, START_WINDOW_US
    found: list[Period] = []
    for invocation in invocations:
        flat = invocation.invocation
        latest += approval(ground, invocation) + flat.contract.deadline_us
        found.append(Period(ground, flat.issued_at_us, earliest, latest, invocation.lasts_us))
        latest += flat.contract.duration_us
        time = flat.contract.motion.time
        earliest += flat.arguments[time] if time >= 0 else 0
    return found


def along(
    comes: Sequence[Period], invocations: Sequence[PreparedInvocation], lines: Sequence[Line | None]
) -> Iterator[Period]:
    """The periods for all arguments on lines: a step comes no sooner than those before it take at least with any of
    them, and asks for all of them what its period says.
    """
    earliest = 0
    for period, invocation, line in zip(comes, invocations, lines, strict=True):
        yield replace(period, low=earliest, asked=[each._replace(low=earliest) for each in period.asked])
        flat = invocation.invocation
        time = flat.contract.motion.time
        earliest += 0 if time < 0 else flat.arguments[time] if line is None else line.least(time)


def keeps(place: Place, airspace: PreparedAirspace) -> Truth:
    """Whether a place is in the airspace, as if all its zones existed."""
    truth = TRUE
    for zone in airspace.inside:
        truth = AND[truth][place.inside(zone)]
    for zone in airspace.outside:
        truth = AND[truth][NOT[place.inside(zone)]]
    return truth


def at_moment(at: Environment, utc: Span) -> Environment:
    """The same at some moment."""
    return Environment(at.slots, at.arguments, (utc,), (0, 0), at.place, at.monitors, at.phase, at.through)


class Cycle(NamedTuple):
    """What stands for all times: a day or a week, `period` us from `base` on, in which local time has one offset. The
    nights in which clocks are set are left for the time of issue.
    """

    base: int
    period: int

    @classmethod
    def of(cls, ground: Ground, windows: Sequence[Window]) -> "Cycle":
        """The one that shows all that some windows do: a week where one of them is of some days of the week."""
        return cls(ground.prepared.tables.local.steady(), max((each.period for each in windows), default=DAY))

    def at(self, moment: int) -> Span:
        """A moment of it, in us since it began."""
        return (self.base + moment, self.base + moment)

    def edges(self, windows: Sequence[Window]) -> list[int]:
        """When in it something changes of the windows."""
        return [at - self.base for each in windows for at in each.changes(self.base - 1, self.base + self.period - 1)]


def zones_read(ground: Ground, clause: Clause, arguments: Sequence[int]) -> Iterator[int]:
    """The zones that a condition asks about, given the arguments."""
    tables = ground.prepared.tables.tables
    for op, a, b in zip(clause.code[::3], clause.code[1::3], clause.code[2::3], strict=True):
        match op:
            case Op.POSITION_IN:
                yield a
            case Op.ARGUMENT_POINT_IN:
                yield b
            case Op.POSITION_IN_ARGUMENT:
                yield tables[b][arguments[a]]


def changes(ground: Ground, clause: Clause, arguments: Sequence[int]) -> tuple[list[Window], list[int]]:
    """The windows of the local day or week, and the dates, by which something changes that a condition reads."""
    policy, local = ground.prepared.policy, ground.prepared.tables.local
    read = [policy.zones[number] for number in zones_read(ground, clause, arguments)]
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
