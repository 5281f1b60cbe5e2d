"""Compiles conditions once, at load, into functions from an environment to an abstract truth."""

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, TypeAlias

from rtshcua.decision import tree
from rtshcua.decision.times import LocalTime, Window, daily, weekly
from rtshcua.decision.values import ABSENT, AND, FALSE, NOT, OR, TRUE, UNKNOWN, Span, Truth, Value
from rtshcua.decision.zones import PlaceSet, PreparedZone, WellKnown, here

#: the phase of an invocation without a mission, and of a phase that the policy does not name
NO_PHASE: Final = -1


class Environment:
    """The inputs of a condition: a value for each slot (and MISSING after the last), the arguments, the vehicle's
    position (None to derive it from the state, on first use), UTC with its error, the truth of each temporal
    monitor (empty if nothing is known), and the index of the invocation's phase among the policy's phase names.
    Zones are evaluated at every moment from now to `through` us from now.
    """

    __slots__ = ("arguments", "error", "monitors", "phase", "place", "slots", "through", "utc")

    def __init__(
        self,
        slots: Sequence[Value],
        arguments: Sequence[Value],
        utc: tuple[Span, ...],
        error: Span,
        place: PlaceSet | None = None,
        monitors: Sequence[Truth] = (),
        phase: int = NO_PHASE,
        through: int = 0,
    ) -> None:
        self.slots, self.arguments = slots, arguments
        self.utc, self.error = utc, error
        self.place = place
        self.monitors, self.phase, self.through = monitors, phase, through

    def over(self, slots: Sequence[Value], place: PlaceSet | None, through: int) -> "Environment":
        """A copy with other slot values and another vehicle position, until `through` us from now."""
        return Environment(slots, self.arguments, self.utc, self.error, place, self.monitors, self.phase, through)


Condition: TypeAlias = Callable[[Environment], Truth]


class Tables(NamedTuple):
    """The tables that code refers to by index, prepared for evaluation."""

    zones: tuple[PreparedZone, ...]
    tables: tuple[tuple[int, ...], ...]
    sets: tuple[frozenset[int], ...]
    known: WellKnown
    local: LocalTime


def within(place: PlaceSet, zone: PreparedZone, at: Environment, through: int) -> Truth:
    """Whether a place is inside a zone at some moment from now to `through` us from now."""
    truth = place.inside(zone)
    return truth if zone.times is None else AND[truth][zone.times.truth(at.utc, at.error, through)]


def always(_: Environment) -> Truth:
    """The condition of a rule that has none: always true."""
    return TRUE


def build(node: tree.Node, tables: Tables) -> Condition:
    """Compile a condition into a function."""
    match node:
        case tree.Both(left, right):
            return _both(build(left, tables), build(right, tables))
        case tree.Either(left, right):
            return _either(build(left, tables), build(right, tables))
        case tree.Negation(operand):
            return _not(build(operand, tables))
        case tree.AtMost(terms, bound):
            return _at_most(terms, bound)
        case tree.Equal(terms, value):
            return _equal(terms, value)
        case tree.Member(argument, index, members):
            return _member(argument, index, tables.sets[members])
        case tree.SlotKnown(index):
            return _known(index)
        case tree.InsideZone(zone):
            return _inside(tables.zones[zone], tables.known)
        case tree.InsideArgument(cell, table):
            return _inside_argument(cell, tables.tables[table], tables)
        case tree.PointInside(cell, zone):
            return _point_inside(cell, tables.zones[zone])
        case tree.PhaseIn(members):
            return _in_phase(tables.sets[members])
        case tree.MonitorSays(monitor):
            return _monitored(monitor)
        case tree.InWeek(windows):
            return _in_window(weekly(windows, tables.local))
        case _:
            return _in_window(daily(node.start, node.end, tables.local))


def _known(index: int) -> Condition:
    def run(at: Environment) -> Truth:
        return known(TRUE, at.slots[index][2])

    return run


def _both(left: Condition, right: Condition) -> Condition:
    def run(at: Environment) -> Truth:
        truth = left(at)
        if truth == TRUE:
            return right(at)
        return FALSE if truth == FALSE else AND[truth][right(at)]

    return run


def _either(left: Condition, right: Condition) -> Condition:
    def run(at: Environment) -> Truth:
        truth = left(at)
        if truth == FALSE:
            return right(at)
        return TRUE if truth == TRUE else OR[truth][right(at)]

    return run


def _not(operand: Condition) -> Condition:
    def run(at: Environment) -> Truth:
        return NOT[operand(at)]

    return run


def known(truth: Truth, gap: int) -> Truth:
    """The truth of a statement about a value that may be missing."""
    if not gap:
        return truth
    return UNKNOWN if gap == ABSENT else truth | UNKNOWN


def total(terms: tuple[tree.LinearTerm, ...], at: Environment) -> tuple[int, int, int]:
    """The least and the greatest possible sum, and whether one of its parts is missing."""
    low = high = gap = 0
    for argument, index, factor in terms:
        least, most, missing, _ = at.arguments[index] if argument else at.slots[index]
        if factor < 0:
            least, most = most, least
        low += factor * least
        high += factor * most
        if missing > gap:
            gap = missing
    return low, high, gap


def at_most(low: int, high: int, bound: int) -> Truth:
    """Whether a value in `low`..`high` is at most `bound`."""
    if high <= bound:
        return TRUE
    return FALSE if low > bound else TRUE | FALSE


def _at_most(terms: tuple[tree.LinearTerm, ...], bound: int) -> Condition:
    if len(terms) == 1 and terms[0].factor in (1, -1):
        (argument, index, factor) = terms[0]
        return _upper(argument, index, bound) if factor == 1 else _lower(argument, index, -bound)

    def run(at: Environment) -> Truth:
        low, high, gap = total(terms, at)
        truth = at_most(low, high, bound)
        return known(truth, gap) if gap else truth

    return run


def _upper(argument: bool, index: int, bound: int) -> Condition:
    def run(at: Environment) -> Truth:
        low, high, gap, _ = at.arguments[index] if argument else at.slots[index]
        truth = TRUE if high <= bound else FALSE if low > bound else TRUE | FALSE
        return known(truth, gap) if gap else truth

    return run


def _lower(argument: bool, index: int, bound: int) -> Condition:
    def run(at: Environment) -> Truth:
        low, high, gap, _ = at.arguments[index] if argument else at.slots[index]
        truth = TRUE if low >= bound else FALSE if high < bound else TRUE | FALSE
        return known(truth, gap) if gap else truth

    return run


def _equal(terms: tuple[tree.LinearTerm, ...], value: int) -> Condition:
    def run(at: Environment) -> Truth:
        low, high, gap = total(terms, at)
        truth = FALSE if low > value or high < value else TRUE if low == high else TRUE | FALSE
        return known(truth, gap) if gap else truth

    return run


def _member(argument: bool, index: int, wanted: frozenset[int]) -> Condition:
    ordered = sorted(wanted)

    def run(at: Environment) -> Truth:
        low, high, gap, elements = at.arguments[index] if argument else at.slots[index]
        if low == high:
            truth = TRUE if low in wanted else FALSE
        elif elements is None:
            common = bisect_right(ordered, high) - bisect_left(ordered, low)
            truth = FALSE if not common else TRUE if common == high - low + 1 else TRUE | FALSE
        else:
            truth = FALSE if elements.isdisjoint(wanted) else TRUE if elements <= wanted else TRUE | FALSE
        return known(truth, gap) if gap else truth

    return run


def _inside(zone: PreparedZone, where: WellKnown) -> Condition:
    def run(at: Environment) -> Truth:
        place = at.place
        if place is None:
            place = at.place = here(at.slots, where)
        return place.inside(zone)

    times = zone.times
    if times is None:
        return run

    def run_in_time(at: Environment) -> Truth:
        return AND[run(at)][times.truth(at.utc, at.error, at.through)]

    return run_in_time


def _inside_argument(cell: int, table: tuple[int, ...], tables: Tables) -> Condition:
    each = tuple(_inside(tables.zones[zone], tables.known) for zone in table)

    def inside(zone: int, at: Environment) -> Truth:
        return each[zone](at) if 0 <= zone < len(each) else UNKNOWN  # an argument out of range does not name a zone

    def run(at: Environment) -> Truth:
        low, high, _, elements = at.arguments[cell]
        if low == high:
            return inside(low, at)
        truth = 0
        for zone in elements or range(low, high + 1):
            truth |= inside(zone, at)
        return truth

    return run


def _point_inside(cell: int, zone: PreparedZone) -> Condition:
    def run(at: Environment) -> Truth:
        west, east, _, _ = at.arguments[cell]
        south, north, _, _ = at.arguments[cell + 1]
        truth = zone.along((west, south), (0, 0, east - west, north - south))
        return truth if times is None else AND[truth][times.truth(at.utc, at.error, at.through)]

    times = zone.times
    return run


def _in_phase(wanted: frozenset[int]) -> Condition:
    def run(at: Environment) -> Truth:
        return TRUE if at.phase in wanted else FALSE

    return run


def _monitored(monitor: int) -> Condition:
    def run(at: Environment) -> Truth:
        return at.monitors[monitor] if at.monitors else TRUE | FALSE | UNKNOWN

    return run


def _in_window(window: Window) -> Condition:
    def run(at: Environment) -> Truth:
        return window.truth(at.utc, at.error)

    return run
