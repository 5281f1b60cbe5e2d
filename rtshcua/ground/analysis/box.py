"""A box: for everything that some conditions read, the set of values that it may have."""

from typing import Final, TypeAlias

from rtshcua.decision.tree import LinearTerm
from rtshcua.decision.values import ABSENT, PRESENT, Span, Truth, Value

#: an argument cell (True) or a state slot (False), by its index
Cell: TypeAlias = tuple[bool, int]
#: a sum of several cells and slots: ascending, without a common factor, the first factor above zero
Form: TypeAlias = tuple[LinearTerm, ...]
#: what is a place: the vehicle, or the argument cell of a place's x
Who: TypeAlias = int
VEHICLE: Final[Who] = -1


class Box:
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

    def copy(self) -> "Box":
        """The same box, to be changed."""
        return Box(
            dict(self.cells),
            dict(self.forms),
            dict(self.sides),
            dict(self.monitors),
            self.utc,
            self.phases,
            self.located,
        )

    def with_cell(self, cell: Cell, value: Value) -> "Box":
        """The same with another value in a cell."""
        made = self.copy()
        made.cells[cell] = value
        return made

    def with_form(self, form: Form, value: Value) -> "Box":
        """The same with another value of a sum."""
        made = self.copy()
        made.forms[form] = value
        return made

    def with_side(self, side: tuple[Who, int], truth: Truth) -> "Box":
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
