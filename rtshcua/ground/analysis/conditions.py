"""Conditions over boxes: atoms, joined by Kleene's connectives.

Each condition returns its possible truth values in a box. An atom that a box leaves undecided splits the box.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from math import gcd
from typing import TypeAlias

from rtshcua.decision import tree
from rtshcua.decision.evaluate import known
from rtshcua.decision.times import Times, daily, timed, weekly, windows_of
from rtshcua.decision.values import ABSENT, AND, FALSE, MAYBE, NOT, OR, PRESENT, TRUE, UNKNOWN, Truth, Value
from rtshcua.ground.analysis.box import (
    VEHICLE,
    Cell,
    Form,
    ValueBox,
    Who,
    absent,
    chosen,
    clipped,
    moments_split,
    present,
)
from rtshcua.ground.analysis.space import SituationSpace
from rtshcua.model.flat.limits import MAX_MAGNITUDE

MOST = 2 * MAX_MAGNITUDE


class Atom(ABC):
    """An atomic condition."""

    @abstractmethod
    def enter(self, box: ValueBox, space: SituationSpace) -> None:
        """Add everything that the atom reads to the first box of a search."""

    @abstractmethod
    def truth(self, box: ValueBox) -> Truth:
        """Return all truth values that the atom may have in the box."""

    @abstractmethod
    def split(self, box: ValueBox) -> list[ValueBox]:
        """Split a box that leaves the atom undecided into at least two boxes, or return a single smaller box."""


def initial(cell: Cell, space: SituationSpace) -> Value:
    """Return the value of a cell in a space."""
    argument, index = cell
    return space.arguments[index] if argument else space.slots[index]


def whether_there(box: ValueBox, cells: tuple[Cell, ...]) -> list[ValueBox]:
    """Split a box by whether the first cell that may be missing is present; empty if there is no such cell."""
    for cell in cells:
        value = box.cells[cell]
        if value[2] == MAYBE:
            return [box.with_cell(cell, present(value)), box.with_cell(cell, absent(value))]
    return []


class LinearAtom(Atom):
    """A sum is in `low`..`high`. A sum of one cell reads that cell, any other a form."""

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

    def enter(self, box: ValueBox, space: SituationSpace) -> None:
        """Add its cells and its sum."""
        for cell in self._cells:
            box.cells.setdefault(cell, initial(cell, space))
        if self._form:
            box.forms.setdefault(self._form, (-MOST, MOST, 0, None))

    def truth(self, box: ValueBox) -> Truth:
        """Whether the sum is in the bounds; unknown if a part is missing."""
        gap = max(box.cells[cell][2] for cell in self._cells) if self._cells else 0
        return known(self._inside(box), gap)

    def _inside(self, box: ValueBox) -> Truth:
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

    def split(self, box: ValueBox) -> list[ValueBox]:
        """Split by missing cells, then below, within and above the bounds."""
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


class MemberAtom(Atom):
    """A cell's value belongs to a set."""

    def __init__(self, cell: Cell, wanted: frozenset[int]) -> None:
        self._cell, self._wanted = cell, wanted

    def enter(self, box: ValueBox, space: SituationSpace) -> None:
        """Add its cell."""
        box.cells.setdefault(self._cell, initial(self._cell, space))

    def truth(self, box: ValueBox) -> Truth:
        """Whether the value belongs to the set."""
        value = box.cells[self._cell]
        if value[2] == ABSENT:
            return UNKNOWN
        some, others = chosen(value, self._wanted, belongs=True), chosen(value, self._wanted, belongs=False)
        return known((TRUE if some else 0) | (FALSE if others else 0), value[2])

    def split(self, box: ValueBox) -> list[ValueBox]:
        """Split by whether the cell is present, then by whether it belongs to the set."""
        pieces = whether_there(box, (self._cell,))
        if pieces:
            return pieces
        value = box.cells[self._cell]
        parts = (chosen(value, self._wanted, belongs=side) for side in (True, False))
        return [box.with_cell(self._cell, part) for part in parts if part is not None]


class LocalTimeAtom(Atom):
    """The local time of day, or of the week, is in a window."""

    def __init__(self, node: tree.InWindow | tree.InWeek, space: SituationSpace) -> None:
        local = space.tables.local
        if isinstance(node, tree.InWeek):
            self._window = weekly(node.windows, local)
        else:
            self._window = daily(node.start, node.end, local)
        self._error = space.error

    def enter(self, box: ValueBox, space: SituationSpace) -> None:
        """Add nothing: every box has its times."""

    def truth(self, box: ValueBox) -> Truth:
        """Whether the times are in the window."""
        return self._window.truth(box.utc, self._error)

    def split(self, box: ValueBox) -> list[ValueBox]:
        """Split at the ends of the window."""
        return moments_split(box, self._window.changes)


class PhaseAtom(Atom):
    """The phase belongs to a set."""

    def __init__(self, wanted: frozenset[int]) -> None:
        self._wanted = wanted

    def enter(self, box: ValueBox, space: SituationSpace) -> None:
        """Add nothing: every box has its phases."""

    def truth(self, box: ValueBox) -> Truth:
        """Whether the phase belongs to the set."""
        return (TRUE if box.phases & self._wanted else 0) | (FALSE if box.phases - self._wanted else 0)

    def split(self, box: ValueBox) -> list[ValueBox]:
        """Split into the phases of the set and the others."""
        pieces: list[ValueBox] = []
        for part in (box.phases & self._wanted, box.phases - self._wanted):
            made = box.copy()
            made.phases = part
            pieces.append(made)
        return pieces


class MonitorAtom(Atom):
    """The value of a temporal monitor. It is treated as independent of the monitored condition."""

    def __init__(self, number: int) -> None:
        self._number = number

    def enter(self, box: ValueBox, space: SituationSpace) -> None:
        """Add the monitor's possible truth values."""
        box.monitors.setdefault(self._number, space.monitors[self._number])

    def truth(self, box: ValueBox) -> Truth:
        """Return the monitor's possible truth values."""
        return box.monitors[self._number]

    def split(self, box: ValueBox) -> list[ValueBox]:
        """Split by truth value."""
        pieces: list[ValueBox] = []
        for single in (TRUE, FALSE, UNKNOWN):
            if box.monitors[self._number] & single:
                made = box.copy()
                made.monitors[self._number] = single
                pieces.append(made)
        return pieces


class ZoneExistence:
    """The times at which a zone exists."""

    def __init__(self, zone: int, space: SituationSpace) -> None:
        flat = space.plane.zone(zone)
        self._timed = timed(flat)
        self._times = Times(flat, space.tables.local)
        self._windows = windows_of(flat, space.tables.local)
        self._dates = (flat.dates[0], flat.dates[1] + 1) if flat.dates else ()
        self._error = space.error

    def truth(self, box: ValueBox) -> Truth:
        """Whether the zone exists."""
        return self._times.truth(box.utc, self._error, 0) if self._timed else TRUE

    def split(self, box: ValueBox) -> list[ValueBox]:
        """Split a box whose times leave the existence undecided; otherwise return an empty list."""
        truth = self.truth(box)
        return moments_split(box, self._cuts) if truth & (truth - 1) else []

    def _cuts(self, low: int, high: int) -> Iterator[int]:
        yield from (date for date in self._dates if low < date <= high)
        for window in self._windows:
            yield from window.changes(low, high)


_BEYOND = 1 << 62


def enter_side(box: ValueBox, space: SituationSpace, who: Who, zone: int, x: Value, y: Value) -> None:
    """Add the possible sides of a place and a zone to a box."""
    if (who, zone) not in box.sides:
        west, east, south, north = x[0], x[1], y[0], y[1]
        box.sides[who, zone] = space.tables.zones[zone].along((west, south), (0, 0, east - west, north - south))


class PointInZone(Atom):
    """A place argument is inside a zone, at any height."""

    def __init__(self, cell: int, zone: int, space: SituationSpace) -> None:
        self._cell, self._zone = cell, zone
        self._existing = ZoneExistence(zone, space)

    def enter(self, box: ValueBox, space: SituationSpace) -> None:
        """Add the sides of the place and the zone."""
        x, y = space.arguments[self._cell], space.arguments[self._cell + 1]
        enter_side(box, space, self._cell, self._zone, x, y)

    def truth(self, box: ValueBox) -> Truth:
        """Whether the place is inside while the zone exists."""
        return AND[self._existing.truth(box)][box.sides[self._cell, self._zone]]

    def split(self, box: ValueBox) -> list[ValueBox]:
        """Split by the zone's existence, then by the sides."""
        return self._existing.split(box) or sides_split(box, self._cell, self._zone)


def sides_split(box: ValueBox, who: Who, zone: int) -> list[ValueBox]:
    """Split a box into one with a place inside a zone and one with it outside."""
    return [box.with_side((who, zone), side) for side in (TRUE, FALSE)]


class VehicleInZone(Atom):
    """The vehicle is inside a zone."""

    def __init__(self, zone: int, space: SituationSpace) -> None:
        self._zone = zone
        self._prepared = space.tables.zones[zone]
        self._height: Cell = (False, space.tables.known.height)
        self._existing = ZoneExistence(zone, space)

    def enter(self, box: ValueBox, space: SituationSpace) -> None:
        """Add the position and the height of the vehicle."""
        box.cells.setdefault(self._height, initial(self._height, space))
        x, y = space.slots[space.tables.known.x], space.slots[space.tables.known.y]
        box.located = max(x[2], y[2])
        enter_side(box, space, VEHICLE, self._zone, x, y)

    def truth(self, box: ValueBox) -> Truth:
        """Whether the vehicle is inside, by its position and height, while the zone exists."""
        low, high, gap, _ = box.cells[self._height]
        across = known(box.sides[VEHICLE, self._zone], box.located)
        return AND[self._existing.truth(box)][AND[self._prepared.between(low, high, gap)][across]]

    def split(self, box: ValueBox) -> list[ValueBox]:
        """Split by missing values, by floor and ceiling, by the sides, then by the zone's existence."""
        if box.located == MAYBE:
            there, missing = box.copy(), box.copy()
            there.located, missing.located = PRESENT, ABSENT
            return [there, missing]
        height = box.cells[self._height]
        if height[2] == MAYBE:
            return [box.with_cell(self._height, present(height)), box.with_cell(self._height, absent(height))]
        if self._prepared.between(height[0], height[1], height[2]) == TRUE | FALSE:
            floor, ceiling = self._prepared.floor, self._prepared.ceiling
            bounds = ((floor + 1, ceiling - 1), (-_BEYOND, floor), (ceiling, _BEYOND))
            parts = (clipped(height, low, high) for low, high in bounds if low <= high)
            return [box.with_cell(self._height, part) for part in parts if part is not None]
        if box.located != ABSENT and box.sides[VEHICLE, self._zone] == TRUE | FALSE:
            return sides_split(box, VEHICLE, self._zone)
        return self._existing.split(box)


class KnownAtom(Atom):
    """A slot has a value. A box has one such value for the whole position, shared by all zones."""

    def __init__(self, slot: int, space: SituationSpace) -> None:
        known = space.tables.known
        self._located = slot in (known.x, known.y)
        self._cells: tuple[Cell, ...] = ((False, known.x), (False, known.y)) if self._located else ((False, slot),)

    def enter(self, box: ValueBox, space: SituationSpace) -> None:
        """Add the slot, or both slots of the position."""
        for cell in self._cells:
            box.cells.setdefault(cell, initial(cell, space))
        if self._located:
            box.located = max(space.slots[index][2] for _, index in self._cells)

    def truth(self, box: ValueBox) -> Truth:
        """True if the value is present, unknown if it is missing."""
        gap = box.located if self._located else box.cells[self._cells[0]][2]
        return TRUE if gap == PRESENT else UNKNOWN if gap == ABSENT else TRUE | UNKNOWN

    def split(self, box: ValueBox) -> list[ValueBox]:
        """Split by whether the value is present."""
        there, missing = box.copy(), box.copy()
        for cell in self._cells:
            there.cells[cell], missing.cells[cell] = present(box.cells[cell]), absent(box.cells[cell])
        if self._located:
            there.located, missing.located = PRESENT, ABSENT
        return [there, missing]


class VehicleInArgumentZone(Atom):
    """The vehicle is inside the zone that a table assigns to a zone argument."""

    def __init__(self, cell: int, table: tuple[int, ...], space: SituationSpace) -> None:
        self._cell: Cell = (True, cell)
        low, high, _, elements = space.arguments[cell]
        every = elements if elements is not None else range(low, high + 1)
        self._each = {zone: VehicleInZone(table[zone], space) for zone in every if 0 <= zone < len(table)}

    def enter(self, box: ValueBox, space: SituationSpace) -> None:
        """Add the argument, and the values for each zone that it may be."""
        box.cells.setdefault(self._cell, initial(self._cell, space))
        for atom in self._each.values():
            atom.enter(box, space)

    def truth(self, box: ValueBox) -> Truth:
        """Return the truth values for all zones that the argument may be."""
        truth = 0
        for zone in self._zones(box):
            atom = self._each.get(zone)
            truth |= UNKNOWN if atom is None else atom.truth(box)
        return truth

    def split(self, box: ValueBox) -> list[ValueBox]:
        """Split by the argument, then by the place of the vehicle."""
        zones = self._zones(box)
        if len(zones) == 1:
            return self._each[zones[0]].split(box)
        half = len(zones) // 2
        pieces = (frozenset(zones[:half]), frozenset(zones[half:]))
        return [box.with_cell(self._cell, (min(each), max(each), PRESENT, each)) for each in pieces]

    def _zones(self, box: ValueBox) -> list[int]:
        low, high, _, elements = box.cells[self._cell]
        return sorted(elements) if elements is not None else list(range(low, high + 1))


class NotCondition:
    """Kleene's `not`."""

    __slots__ = ("operand",)

    def __init__(self, operand: "Condition") -> None:
        self.operand = operand

    def truth(self, box: ValueBox) -> Truth:
        """Return all truth values that it may have in the box."""
        return NOT[self.operand.truth(box)]

    def undecided(self, box: ValueBox) -> Atom:
        """Return an atom that leaves the condition undecided."""
        return undecided(self.operand, box)


class Pair:
    """Kleene's `and` or `or`."""

    __slots__ = ("_decisive", "_table", "left", "right")

    def __init__(self, left: "Condition", right: "Condition", *, both: bool) -> None:
        self.left, self.right = left, right
        self._table, self._decisive = (AND, FALSE) if both else (OR, TRUE)

    def truth(self, box: ValueBox) -> Truth:
        """Return all truth values that it may have in the box."""
        left = self.left.truth(box)
        return left if left == self._decisive else self._table[left][self.right.truth(box)]

    def undecided(self, box: ValueBox) -> Atom:
        """Return an atom that leaves the condition undecided."""
        left = self.left.truth(box)
        return undecided(self.left if left & (left - 1) else self.right, box)


Condition: TypeAlias = NotCondition | Pair | Atom


def undecided(condition: Condition, box: ValueBox) -> Atom:
    """Return an atom by which to split a box that leaves the condition undecided."""
    return condition if isinstance(condition, Atom) else condition.undecided(box)


def over_boxes(node: tree.Node, space: SituationSpace, box: ValueBox) -> Condition:
    """Return a condition over boxes, and add everything that it reads to the first box."""
    match node:
        case tree.Both(left, right):
            return Pair(over_boxes(left, space, box), over_boxes(right, space, box), both=True)
        case tree.Either(left, right):
            return Pair(over_boxes(left, space, box), over_boxes(right, space, box), both=False)
        case tree.Negation(operand):
            return NotCondition(over_boxes(operand, space, box))
        case _:
            atom = _atom(node, space)
            atom.enter(box, space)
            return atom


def _atom(node: tree.Node, space: SituationSpace) -> Atom:
    match node:
        case tree.AtMost(terms, bound):
            return LinearAtom(terms, -MOST, bound)
        case tree.Equal(terms, value):
            return LinearAtom(terms, value, value)
        case tree.Member(argument, index, members):
            return MemberAtom((argument, index), space.tables.sets[members])
        case tree.SlotKnown(slot):
            return KnownAtom(slot, space)
        case tree.InsideZone(zone):
            return VehicleInZone(zone, space)
        case tree.InsideArgument(cell, table):
            return VehicleInArgumentZone(cell, space.tables.tables[table], space)
        case tree.PointInside(cell, zone):
            return PointInZone(cell, zone, space)
        case tree.PhaseIn(members):
            return PhaseAtom(space.tables.sets[members])
        case tree.MonitorSays(monitor):
            return MonitorAtom(monitor)
        case tree.InWindow() | tree.InWeek():
            return LocalTimeAtom(node, space)
        case _:  # a connective, not an atom
            raise AssertionError(node)
