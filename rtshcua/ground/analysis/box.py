"""A box: for everything that some conditions read, the set of values that it may have; and what a box rules out by
itself, sums against their parts and zones against each other.
"""

from collections.abc import Callable, Iterator
from typing import Final, TypeAlias

from rtshcua.decision.tree import LinearTerm
from rtshcua.decision.values import ABSENT, FALSE, PRESENT, TRUE, Span, Truth, Value
from rtshcua.ground.analysis.plane import Plane

#: an argument cell (True) or a state slot (False), by its index
Cell: TypeAlias = tuple[bool, int]
#: a sum of several cells and slots: ascending, without a common factor, the first factor above zero
Form: TypeAlias = tuple[LinearTerm, ...]
#: what is a place: the vehicle, or the argument cell of a place's x
Who: TypeAlias = int
VEHICLE: Final[Who] = -1


class ValueBox:
    """Sets of values. `sides` says of a place and a zone's ground plan whether the place is inside; `located` whether
    the vehicle's position is known. What a box does not name may have any value that the space allows.
    """

    __slots__ = ("cells", "forms", "located", "monitors", "phases", "sides", "utc")

    def __init__(
        self,
        cells: dict[Cell, Value],
        forms: dict[Form, Value],
        sides: dict[tuple[Who, int], Truth],
        monitors: dict[int, Truth],
        utc: tuple[Span, ...],
        phases: frozenset[int],
        located: int,
    ) -> None:
        self.cells, self.forms, self.sides, self.monitors = cells, forms, sides, monitors
        self.utc, self.phases, self.located = utc, phases, located

    def copy(self) -> "ValueBox":
        """The same box, to be changed."""
        return ValueBox(
            dict(self.cells),
            dict(self.forms),
            dict(self.sides),
            dict(self.monitors),
            self.utc,
            self.phases,
            self.located,
        )

    def with_cell(self, cell: Cell, value: Value) -> "ValueBox":
        """The same with another value in a cell."""
        made = self.copy()
        made.cells[cell] = value
        return made

    def with_form(self, form: Form, value: Value) -> "ValueBox":
        """The same with another value of a sum."""
        made = self.copy()
        made.forms[form] = value
        return made

    def with_side(self, side: tuple[Who, int], truth: Truth) -> "ValueBox":
        """The same with a place on one side of a zone's boundary."""
        made = self.copy()
        made.sides[side] = truth
        return made


def clipped(value: Value, low: int, high: int) -> Value | None:
    """What of a value is in `low`..`high`; None where nothing is. Being missing is left as it is."""
    least, most, gap, elements = value
    if least >= low and most <= high:
        return value
    if elements is not None:
        kept = frozenset(each for each in elements if low <= each <= high)
        return (min(kept), max(kept), gap, kept) if kept else None
    least, most = max(least, low), min(most, high)
    return (least, most, gap, None) if least <= most else None


def chosen(value: Value, wanted: frozenset[int], *, belongs: bool) -> Value | None:
    """What of an enumeration's or a zone's value belongs to a set, or does not; None where nothing does."""
    low, high, gap, elements = value
    every = frozenset(range(low, high + 1)) if elements is None else elements
    kept = every & wanted if belongs else every - wanted
    return (min(kept), max(kept), gap, kept) if kept else None


def present(value: Value) -> Value:
    """The same, surely there."""
    return (value[0], value[1], PRESENT, value[3])


def absent(value: Value) -> Value:
    """Surely missing."""
    return (value[0], value[1], ABSENT, None)


#: the moments after one and up to another at which something about the time changes
Cuts: TypeAlias = Callable[[int, int], Iterator[int]]


def moments_split(box: ValueBox, where: Cuts) -> list[ValueBox]:
    """The box with the first half of its intervals and with the other; a single interval is cut.

    One that nothing cuts is halved: what a clock's error leaves open is decided by a moment.
    """
    if len(box.utc) > 1:
        half = len(box.utc) // 2
        return [_with_moments(box, box.utc[:half]), _with_moments(box, box.utc[half:])]
    low, high = box.utc[0]
    at = next(where(low, high), (low + high + 1) // 2)
    return [_with_moments(box, ((low, at - 1),)), _with_moments(box, ((at, high),))] if low < at else [box]


def _with_moments(box: ValueBox, utc: tuple[Span, ...]) -> ValueBox:
    made = box.copy()
    made.utc = utc
    return made


#: how often sums and parts tighten each other; bounds that creep are left to the search
_ROUNDS = 6


def narrow(box: ValueBox, plane: Plane) -> bool:
    """Tighten a box in place; False where nothing is in it."""
    return _sums(box) and _zones(box, plane)


def _sums(box: ValueBox) -> bool:
    if not box.forms:
        return True
    for _ in range(_ROUNDS):
        changed = False
        for form in box.forms:
            if any(box.cells[term.argument, term.at][2] for term in form):
                continue  # a sum that may be missing says nothing of its parts
            outcome = _tighten(box, form)
            if outcome is None:
                return False
            changed = changed or outcome
        if not changed:
            break
    return True


def _tighten(box: ValueBox, form: Form) -> bool | None:
    """Whether anything became smaller; None where nothing is left."""
    ends = [_ends(box.cells[term.argument, term.at], term.factor) for term in form]
    low, high = sum(end[0] for end in ends), sum(end[1] for end in ends)
    value = clipped(box.forms[form], low, high)
    if value is None:
        return None
    changed = value is not box.forms[form]
    box.forms[form] = value
    for term, (least, most) in zip(form, ends, strict=True):
        # factor * part = sum - others
        lowest, highest = value[0] - (high - most), value[1] - (low - least)
        if term.factor < 0:
            lowest, highest = -highest, -lowest
        size = abs(term.factor)
        cell = (term.argument, term.at)
        part = clipped(box.cells[cell], -(-lowest // size), highest // size)
        if part is None:
            return None
        changed = changed or part is not box.cells[cell]
        box.cells[cell] = part
    return changed


def _ends(value: Value, factor: int) -> tuple[int, int]:
    return (factor * value[0], factor * value[1]) if factor > 0 else (factor * value[1], factor * value[0])


def _zones(box: ValueBox, plane: Plane) -> bool:
    """Follow the sides that are decided: within one, within all around it and outside all apart from it."""
    waiting = [key for key, side in box.sides.items() if side in (TRUE, FALSE)]
    if len(box.sides) < 2:
        return True
    while waiting:
        who, zone = waiting.pop()
        if who == VEHICLE and box.located:
            continue
        inside = box.sides[who, zone] == TRUE
        for (other_who, other), side in list(box.sides.items()):
            if other_who != who or other == zone:
                continue
            implied = _implied(plane, zone, other, inside=inside)
            if implied and not side & implied:
                return False
            if implied and implied != side:
                box.sides[who, other] = implied
                waiting.append((who, other))
    return True


def _implied(plane: Plane, zone: int, other: int, *, inside: bool) -> Truth:
    """On which side of another zone a place inside, or outside, of a zone must be; 0: on any."""
    if not inside:
        return FALSE if plane.within(other, zone) else 0
    if plane.within(zone, other):
        return TRUE
    return FALSE if plane.apart(zone, other) else 0
