"""Atoms of conditions over boxes: their truth, and how a box is split where it does not decide them."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from math import gcd

from rtshcua.decision import tree
from rtshcua.decision.evaluate import known
from rtshcua.decision.times import daily, weekly
from rtshcua.decision.values import ABSENT, FALSE, MAYBE, TRUE, UNKNOWN, Truth, Value
from rtshcua.ground.analysis.box import Box, Cell, Form, absent, chosen, clipped, present
from rtshcua.ground.analysis.moments import moments_split
from rtshcua.ground.analysis.space import Space
from rtshcua.model.flat.limits import MAX_MAGNITUDE

MOST = 2 * MAX_MAGNITUDE


class Atom(ABC):
    """One atom. `split` gives boxes that together are the box; at least two, or one that is smaller."""

    @abstractmethod
    def enter(self, box: Box, space: Space) -> None:
        """Put what the atom reads into the box that a search begins with."""

    @abstractmethod
    def truth(self, box: Box) -> Truth:
        """All truths that the atom may have in the box."""

    @abstractmethod
    def split(self, box: Box) -> list[Box]:
        """The box in pieces, in which the atom is nearer to being decided."""


def initial(cell: Cell, space: Space) -> Value:
    """What a space says of a cell."""
    argument, index = cell
    return space.arguments[index] if argument else space.slots[index]


def whether_there(box: Box, cells: tuple[Cell, ...]) -> list[Box]:
    """The box split by whether the first of some cells is there that may be missing; nothing where all are decided."""
    for cell in cells:
        value = box.cells[cell]
        if value[2] == MAYBE:
            return [box.with_cell(cell, present(value)), box.with_cell(cell, absent(value))]
    return []


class Linear(Atom):
    """A sum is in `low`..`high`; one of a single cell is about that cell, any other about a form."""

    def __init__(self, terms: tuple[tree.LinearTerm, ...], low: int, high: int) -> None:
        self._cells: tuple[Cell, ...] = tuple((term.argument, term.at) for term in terms)
        moving = sorted(term for term in terms if term.factor)
        self._cell: Cell | None = None
        self._form: Form = ()
        if not moving:
            self._low, self._high = (low, high) if low <= 0 <= high else (1, 0)
            return
        scale = gcd(*(term.factor for term in moving)) * (1 if moving[0].factor > 0 else -1)
        if scale < 0:
            low, high = -high, -low
        size = abs(scale)
        self._low, self._high = -(-low // size), high // size
        if len(moving) == 1:
            self._cell = (moving[0].argument, moving[0].at)
        else:
            self._form = tuple(term._replace(factor=term.factor // scale) for term in moving)

    def enter(self, box: Box, space: Space) -> None:
        """Its cells, and the sum's bounds."""
        for cell in self._cells:
            box.cells.setdefault(cell, initial(cell, space))
        if self._form:
            box.forms.setdefault(self._form, (-MOST, MOST, 0, None))

    def truth(self, box: Box) -> Truth:
        """Whether the sum is in the bounds, where nothing of it is missing."""
        gap = max(box.cells[cell][2] for cell in self._cells) if self._cells else 0
        return known(self._inside(box), gap)

    def _inside(self, box: Box) -> Truth:
        if self._low > self._high:
            return FALSE
        if self._cell is not None:
            low, high, _, elements = box.cells[self._cell]
        elif self._form:
            low, high, _, elements = box.forms[self._form]
        else:
            return TRUE
        if self._low <= low and high <= self._high:
            return TRUE
        if low > self._high or high < self._low:
            return FALSE
        if elements is not None and not any(self._low <= each <= self._high for each in elements):
            return FALSE
        return TRUE | FALSE

    def split(self, box: Box) -> list[Box]:
        """First by what is missing, then below, within and above the bounds."""
        pieces = whether_there(box, self._cells)
        if pieces:
            return pieces
        value = box.forms[self._form] if self._cell is None else box.cells[self._cell]
        for low, high in ((self._low, self._high), (self._high + 1, MOST), (-MOST, self._low - 1)):
            part = clipped(value, low, high) if low <= high else None
            if part is not None:
                pieces.append(
                    box.with_form(self._form, part) if self._cell is None else box.with_cell(self._cell, part)
                )
        return pieces


class Chosen(Atom):
    """A cell's value belongs to a set."""

    def __init__(self, cell: Cell, wanted: frozenset[int]) -> None:
        self._cell, self._wanted = cell, wanted

    def enter(self, box: Box, space: Space) -> None:
        """Its cell."""
        box.cells.setdefault(self._cell, initial(self._cell, space))

    def truth(self, box: Box) -> Truth:
        """Whether the value belongs to the set."""
        value = box.cells[self._cell]
        if value[2] == ABSENT:
            return UNKNOWN
        some, others = chosen(value, self._wanted, belongs=True), chosen(value, self._wanted, belongs=False)
        return known((TRUE if some else 0) | (FALSE if others else 0), value[2])

    def split(self, box: Box) -> list[Box]:
        """By whether it is there, then by whether it belongs."""
        pieces = whether_there(box, (self._cell,))
        if pieces:
            return pieces
        value = box.cells[self._cell]
        parts = (chosen(value, self._wanted, belongs=side) for side in (True, False))
        return [box.with_cell(self._cell, part) for part in parts if part is not None]


class Local(Atom):
    """The local time of day, or of the week, is in a window."""

    def __init__(self, node: tree.InWindow | tree.InWeek, space: Space) -> None:
        local = space.tables.local
        if isinstance(node, tree.InWeek):
            self._window = weekly(node.windows, local)
        else:
            self._window = daily(node.start, node.end, local)
        self._error = space.error

    def enter(self, box: Box, space: Space) -> None:
        """Nothing: every box has its moments."""

    def truth(self, box: Box) -> Truth:
        """Whether the moments are in the window."""
        return self._window.truth(box.utc, self._error)

    def split(self, box: Box) -> list[Box]:
        """At the ends of the window."""
        return moments_split(box, self._window.changes)


class Phase(Atom):
    """The phase is one of some."""

    def __init__(self, wanted: frozenset[int]) -> None:
        self._wanted = wanted

    def enter(self, box: Box, space: Space) -> None:
        """Nothing: every box has its phases."""

    def truth(self, box: Box) -> Truth:
        """Whether the phase belongs to them."""
        return (TRUE if box.phases & self._wanted else 0) | (FALSE if box.phases - self._wanted else 0)

    def split(self, box: Box) -> list[Box]:
        """Those and the others."""
        pieces: list[Box] = []
        for part in (box.phases & self._wanted, box.phases - self._wanted):
            made = box.copy()
            made.phases = part
            pieces.append(made)
        return pieces


class Monitor(Atom):
    """What a temporal monitor says: anything, whatever it watches."""

    def __init__(self, number: int) -> None:
        self._number = number

    def enter(self, box: Box, space: Space) -> None:
        """Its truths."""
        box.monitors.setdefault(self._number, space.monitors[self._number])

    def truth(self, box: Box) -> Truth:
        """Its truths."""
        return box.monitors[self._number]

    def split(self, box: Box) -> list[Box]:
        """One piece a truth."""
        return list(self._pieces(box))

    def _pieces(self, box: Box) -> Iterator[Box]:
        for single in (TRUE, FALSE, UNKNOWN):
            if box.monitors[self._number] & single:
                made = box.copy()
                made.monitors[self._number] = single
                yield made
