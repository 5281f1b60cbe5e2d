"""Atoms about zones over boxes: where the vehicle is, or where a place is that was given as an argument."""

from rtshcua.decision.evaluate import known
from rtshcua.decision.values import ABSENT, AND, FALSE, MAYBE, PRESENT, TRUE, UNKNOWN, Truth, Value
from rtshcua.ground.analysis.atoms import Atom, initial
from rtshcua.ground.analysis.box import VEHICLE, Box, Cell, Who, absent, clipped, present
from rtshcua.ground.analysis.existing import Existing
from rtshcua.ground.analysis.space import Space

_FAR = 1 << 62


def enter_side(box: Box, space: Space, who: Who, zone: int, x: Value, y: Value) -> None:
    """Put into a box on which sides of a zone's boundary a place may be."""
    if (who, zone) not in box.sides:
        west, east, south, north = x[0], x[1], y[0], y[1]
        box.sides[who, zone] = space.tables.zones[zone].along((west, south), (0, 0, east - west, north - south))


class PointIn(Atom):
    """A place that was given is inside a zone, at any height."""

    def __init__(self, cell: int, zone: int, space: Space) -> None:
        self._cell, self._zone = cell, zone
        self._existing = Existing(zone, space)

    def enter(self, box: Box, space: Space) -> None:
        """The zone's sides."""
        x, y = space.arguments[self._cell], space.arguments[self._cell + 1]
        enter_side(box, space, self._cell, self._zone, x, y)

    def truth(self, box: Box) -> Truth:
        """Whether the place is inside while the zone exists."""
        return AND[self._existing.truth(box)][box.sides[self._cell, self._zone]]

    def split(self, box: Box) -> list[Box]:
        """By the zone's existence, then by its sides."""
        return self._existing.split(box) or sides_split(box, self._cell, self._zone)


def sides_split(box: Box, who: Who, zone: int) -> list[Box]:
    """The box with a place inside, and with it outside."""
    return [box.with_side((who, zone), side) for side in (TRUE, FALSE)]


class VehicleIn(Atom):
    """The vehicle is inside a zone."""

    def __init__(self, zone: int, space: Space) -> None:
        self._zone = zone
        self._prepared = space.tables.zones[zone]
        self._height: Cell = (False, space.tables.known.height)
        self._existing = Existing(zone, space)

    def enter(self, box: Box, space: Space) -> None:
        """Where the vehicle is, and how high."""
        box.cells.setdefault(self._height, initial(self._height, space))
        x, y = space.slots[space.tables.known.x], space.slots[space.tables.known.y]
        box.located = max(x[2], y[2])
        enter_side(box, space, VEHICLE, self._zone, x, y)

    def truth(self, box: Box) -> Truth:
        """Whether the vehicle is inside, as far as position and height tell."""
        low, high, gap, _ = box.cells[self._height]
        across = known(box.sides[VEHICLE, self._zone], box.located)
        return AND[self._existing.truth(box)][AND[self._prepared.between(low, high, gap)][across]]

    def split(self, box: Box) -> list[Box]:
        """By what is missing, by floor and ceiling, by the zone's existence, then by its sides."""
        if box.located == MAYBE:
            there, missing = box.copy(), box.copy()
            there.located, missing.located = PRESENT, ABSENT
            return [there, missing]
        height = box.cells[self._height]
        if height[2] == MAYBE:
            return [box.with_cell(self._height, present(height)), box.with_cell(self._height, absent(height))]
        if self._prepared.between(height[0], height[1], height[2]) == TRUE | FALSE:
            floor, ceiling = self._prepared.floor, self._prepared.ceiling
            bounds = ((floor + 1, ceiling - 1), (-_FAR, floor), (ceiling, _FAR))
            parts = (clipped(height, low, high) for low, high in bounds if low <= high)
            return [box.with_cell(self._height, part) for part in parts if part is not None]
        if box.located != ABSENT and box.sides[VEHICLE, self._zone] == TRUE | FALSE:
            return sides_split(box, VEHICLE, self._zone)
        return self._existing.split(box)


class There(Atom):
    """A slot has a value. Whether the vehicle's position does, its box keeps for all zones together."""

    def __init__(self, slot: int, space: Space) -> None:
        known = space.tables.known
        self._located = slot in (known.x, known.y)
        self._cells: tuple[Cell, ...] = ((False, known.x), (False, known.y)) if self._located else ((False, slot),)

    def enter(self, box: Box, space: Space) -> None:
        """The slot; of the position both."""
        for cell in self._cells:
            box.cells.setdefault(cell, initial(cell, space))
        if self._located:
            box.located = max(space.slots[index][2] for _, index in self._cells)

    def truth(self, box: Box) -> Truth:
        """True where it is there, else unknown."""
        gap = box.located if self._located else box.cells[self._cells[0]][2]
        return TRUE if gap == PRESENT else UNKNOWN if gap == ABSENT else TRUE | UNKNOWN

    def split(self, box: Box) -> list[Box]:
        """By whether it is there."""
        there, missing = box.copy(), box.copy()
        for cell in self._cells:
            there.cells[cell], missing.cells[cell] = present(box.cells[cell]), absent(box.cells[cell])
        if self._located:
            there.located, missing.located = PRESENT, ABSENT
        return [there, missing]


class VehicleInArgument(Atom):
    """The vehicle is inside the zone that a table gives for a zone that was given."""

    def __init__(self, cell: int, table: tuple[int, ...], space: Space) -> None:
        self._cell: Cell = (True, cell)
        low, high, _, elements = space.arguments[cell]
        every = elements if elements is not None else range(low, high + 1)
        self._each = {zone: VehicleIn(table[zone], space) for zone in every if 0 <= zone < len(table)}

    def enter(self, box: Box, space: Space) -> None:
        """The zone that was given, and where the vehicle is with each that it may be."""
        box.cells.setdefault(self._cell, initial(self._cell, space))
        for atom in self._each.values():
            atom.enter(box, space)

    def truth(self, box: Box) -> Truth:
        """All truths for all zones that may have been given."""
        truth = 0
        for zone in self._zones(box):
            atom = self._each.get(zone)
            truth |= UNKNOWN if atom is None else atom.truth(box)
        return truth

    def split(self, box: Box) -> list[Box]:
        """By the zone that was given, then by where the vehicle is."""
        zones = self._zones(box)
        if len(zones) == 1:
            return self._each[zones[0]].split(box)
        half = len(zones) // 2
        pieces = (frozenset(zones[:half]), frozenset(zones[half:]))
        return [box.with_cell(self._cell, (min(each), max(each), PRESENT, each)) for each in pieces]

    def _zones(self, box: Box) -> list[int]:
        low, high, _, elements = box.cells[self._cell]
        return sorted(elements) if elements is not None else list(range(low, high + 1))
