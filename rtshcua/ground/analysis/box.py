"""Boxes: a set of possible values for everything that conditions read.

A box is narrowed by comparing sums with their parts, and the sides of zones with each other.
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
#: the owner of a place: the vehicle, or the argument cell that holds the x of a place
Who: TypeAlias = int
VEHICLE: Final[Who] = -1


class ValueBox:
    """Sets of values. Anything that a box does not contain may have every value of the space.

    `sides` holds whether a place is inside the ground plan of a zone, and `located` whether the vehicle's position is
    known.
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
        """Return a copy that may be changed."""
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
        """Return a copy with another value of a cell."""
        made = self.copy()
        made.cells[cell] = value
        return made

    def with_form(self, form: Form, value: Value) -> "ValueBox":
        """Return a copy with another value of a sum."""
        made = self.copy()
        made.forms[form] = value
        return made

    def with_side(self, side: tuple[Who, int], truth: Truth) -> "ValueBox":
        """Return a copy with a place on one side of a zone's boundary."""
        made = self.copy()
        made.sides[side] = truth
        return made


def clipped(value: Value, low: int, high: int) -> Value | None:
    """Return the part of a value within `low`..`high`; None if it is empty. Whether it is missing does not change."""
    least, most, gap, elements = value
    if least >= low and most <= high:
        return value
    if elements is not None:
        kept = frozenset(each for each in elements if low <= each <= high)
        return (min(kept), max(kept), gap, kept) if kept else None
    least, most = max(least, low), min(most, high)
    return (least, most, gap, None) if least <= most else None


def chosen(value: Value, wanted: frozenset[int], *, belongs: bool) -> Value | None:
    """Return the part of an enumeration's or a zone's value inside (`belongs`) or outside a set; None if empty."""
    low, high, gap, elements = value
    every = frozenset(range(low, high + 1)) if elements is None else elements
    kept = every & wanted if belongs else every - wanted
    return (min(kept), max(kept), gap, kept) if kept else None


def present(value: Value) -> Value:
    """Return the value as certainly present."""
    return (value[0], value[1], PRESENT, value[3])


def absent(value: Value) -> Value:
    """Return the value as certainly missing."""
    return (value[0], value[1], ABSENT, None)


#: yields the times after the first argument, up to the second, at which the value of a condition changes
Cuts: TypeAlias = Callable[[int, int], Iterator[int]]


def moments_split(box: ValueBox, where: Cuts) -> list[ValueBox]:
    """Split a box into the two halves of its time intervals; a single interval is split at a cut.

    An interval without a cut is halved: a short enough interval decides a condition that the clock's error leaves open.
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


#: most rounds of tightening sums and parts; the search handles bounds that converge slowly
_ROUNDS = 6


def narrow(box: ValueBox, plane: Plane) -> bool:
    """Tighten a box in place. Returns False if it is empty."""
    return _sums(box) and _zones(box, plane)


def _sums(box: ValueBox) -> bool:
    if not box.forms:
        return True
    for _ in range(_ROUNDS):
        changed = False
        for form in box.forms:
            if any(box.cells[term.argument, term.at][2] for term in form):
                continue  # a sum that may be missing does not bound its parts
            outcome = _tighten(box, form)
            if outcome is None:
                return False
            changed = changed or outcome
        if not changed:
            break
    return True


def _tighten(box: ValueBox, form: Form) -> bool | None:
    """Tighten one sum and its parts. Returns whether a value became smaller, or None if one is empty."""
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
    """Derive further sides: a place inside a zone is inside all zones around it and outside all disjoint ones."""
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
    """Return the side of another zone on which a place inside (or outside) a zone must be; 0 if both are possible."""
    if not inside:
        return FALSE if plane.within(other, zone) else 0
    if plane.within(zone, other):
        return TRUE
    return FALSE if plane.apart(zone, other) else 0
