"""Bounds outside which a condition cannot hold, conditions as alternatives of conjunctions, and a k-d tree of bounds.

The comparison of many rules tries bounds first: comparing numbers takes a thousandth of the time of a search over
boxes.
"""

from collections.abc import Iterator, Mapping, Sequence
from heapq import heappop, heappush
from math import isqrt
from operator import lt
from typing import Final, NamedTuple, TypeAlias

from rtshcua.decision import tree
from rtshcua.decision.evaluate import Tables
from rtshcua.ground.analysis.box import Cell
from rtshcua.model.flat.limits import MAX_MAGNITUDE
from rtshcua.model.flat.zone import AREA, CIRCLE, Zone

#: a number beyond every value
FAR: Final = 4 * MAX_MAGNITUDE
#: the least and the greatest value of cells; other cells are unbounded
Bounds: TypeAlias = Mapping[Cell, tuple[int, int]]
#: the phase, treated as a state slot
PHASE: Final[Cell] = (False, -1)
#: most parts of an `or` that are kept apart; more are replaced by their common bounds
_PARTS = 8


class OtherCondition(NamedTuple):
    """A condition that is not a bound. `text` tells its kind: nodes of two kinds with the same fields are equal."""

    text: str
    node: tree.Node


class Conjunction(NamedTuple):
    """Bounds and other conditions that must hold together."""

    bounds: Bounds
    others: frozenset[OtherCondition]


def alternatives(node: tree.Node) -> tuple[Conjunction, ...]:
    """Return conjunctions whose `or` equals a condition, also if a value is unknown.

    Empty bounds are kept, because their value may be missing.
    """
    found = _alternatives(node, holds=True)
    return (Conjunction({}, frozenset((OtherCondition(repr(node), node),))),) if found is None else tuple(found)


def _alternatives(node: tree.Node, *, holds: bool) -> list[Conjunction] | None:
    """Return the alternatives of a condition, or of its negation if not `holds`; None if there are too many."""
    match node:
        case tree.Negation(operand):
            return _alternatives(operand, holds=not holds)
        case tree.Both(left, right) | tree.Either(left, right):
            one, other = _alternatives(left, holds=holds), _alternatives(right, holds=holds)
            if one is None or other is None:
                return None
            if isinstance(node, tree.Both) is not holds:
                found = [*one, *other]
            else:
                found = [Conjunction(_overlap(a.bounds, b.bounds), a.others | b.others) for a in one for b in other]
            return found if len(found) <= _PARTS else None
    written = node if holds else tree.Negation(node)
    interval = _interval(written)
    if interval is None:
        return [Conjunction({}, frozenset((OtherCondition(repr(written), written),)))]
    cell, low, high = interval
    return [Conjunction({cell: (low, high)}, frozenset())]


class Extents:
    """Computes bounds of conditions over the zones and sets of a policy."""

    def __init__(self, tables: Tables, zones: tuple[Zone, ...]) -> None:
        self._tables = tables
        self._zones = zones
        self._around: dict[int, tuple[int, int, int, int]] = {}

    def parts(self, node: tree.Node) -> list[Bounds]:
        """Return bounds such that every situation in which the condition is true lies in one of them.

        Missing values are ignored: where one is missing, the condition may be unknown within the bounds of the others.
        Returns an empty list if the condition cannot be true.
        """
        return self._parts(node, holds=True)

    def _parts(self, node: tree.Node, *, holds: bool) -> list[Bounds]:
        match node:
            case tree.Negation(operand):
                return self._parts(operand, holds=not holds)
            case tree.Both(left, right) | tree.Either(left, right):
                one, other = self._parts(left, holds=holds), self._parts(right, holds=holds)
                if isinstance(node, tree.Both) is not holds:
                    return _few([*one, *other])
                return _few(_intersections(one, other))
            case tree.AtMost(terms, bound):
                return _sum_bounds(terms, -FAR, bound) if holds else _sum_bounds(terms, bound + 1, FAR)
            case tree.Equal(terms, value):
                if holds:
                    return _sum_bounds(terms, value, value)
                return [*_sum_bounds(terms, -FAR, value - 1), *_sum_bounds(terms, value + 1, FAR)]
            case tree.Member(argument, at, members) if holds:
                return [_hull((argument, at), self._tables.sets[members])]
            case tree.PhaseIn(members) if holds:
                return [_hull(PHASE, self._tables.sets[members])]
            case tree.PointInside(cell, zone) if holds:
                west, south, east, north = self._box(zone)
                return [{(True, cell): (west, east), (True, cell + 1): (south, north)}]
            case tree.InsideZone(zone) if holds:
                west, south, east, north = self._box(zone)
                known = self._tables.known
                return [{(False, known.x): (west, east), (False, known.y): (south, north)}]
            case _:
                return [{}]

    def _box(self, number: int) -> tuple[int, int, int, int]:
        found = self._around.get(number)
        if found is None:
            found = self._around[number] = _zone_bounds(self._zones[number])
        return found


def _zone_bounds(zone: Zone) -> tuple[int, int, int, int]:
    """Return west, south, east and north of a zone's ground plan."""
    if zone.shape == CIRCLE:
        x, y, square = zone.data
        reach = isqrt(square) + 1
        return x - reach, y - reach, x + reach, y + reach
    corners = zone.data[1 + zone.data[0] :] if zone.shape == AREA else zone.data
    return min(corners[::2]), min(corners[1::2]), max(corners[::2]), max(corners[1::2])


def _hull(cell: Cell, members: frozenset[int]) -> Bounds:
    return {cell: (min(members), max(members))} if members else {}


def _interval(node: tree.Node) -> tuple[Cell, int, int] | None:
    """Return the cell of a comparison of one cell, and its bounds; None for any other condition."""
    match node:
        case tree.AtMost(terms, bound) if len(terms) == 1 and terms[0].factor:
            return _solved(terms[0], -FAR, bound)
        case tree.Negation(tree.AtMost(terms, bound)) if len(terms) == 1 and terms[0].factor:
            return _solved(terms[0], bound + 1, FAR)
        case tree.Equal(terms, value) if len(terms) == 1 and terms[0].factor:
            return _solved(terms[0], value, value)
        case _:
            return None


def _sum_bounds(terms: tuple[tree.LinearTerm, ...], low: int, high: int) -> list[Bounds]:
    """Return the bounds of a sum in `low`..`high`. A sum of several cells is unbounded."""
    moving = [term for term in terms if term.factor]
    if len(moving) != 1:
        return [{}]
    cell, least, most = _solved(moving[0], low, high)
    return [{cell: (least, most)}] if least <= most else []


def _solved(term: tree.LinearTerm, low: int, high: int) -> tuple[Cell, int, int]:
    """Return the cell of a term, and the bounds of its value if the term is in `low`..`high`."""
    size = abs(term.factor)
    if term.factor < 0:
        low, high = -high, -low
    least, most = (low if low <= -FAR else -(-low // size)), (high if high >= FAR else high // size)
    return (term.argument, term.at), least, most


def _overlap(one: Bounds, other: Bounds) -> dict[Cell, tuple[int, int]]:
    """Return the intersection of two bounds, which may be empty."""
    made = dict(one)
    for cell, (low, high) in other.items():
        least, most = made.get(cell, (-FAR, FAR))
        made[cell] = max(least, low), min(most, high)
    return made


def _intersections(one: list[Bounds], other: list[Bounds]) -> list[Bounds]:
    """Return the intersection of each pair of bounds that is not empty."""
    pairs = (_overlap(a, b) for a in one for b in other)
    return [each for each in pairs if all(low <= high for low, high in each.values())]


def _few(parts: list[Bounds]) -> list[Bounds]:
    """Return the parts, or their common bounds if there are more than `_PARTS`."""
    if len(parts) <= _PARTS:
        return parts
    cells = set(parts[0]).intersection(*parts[1:])
    return [{cell: (min(part[cell][0] for part in parts), max(part[cell][1] for part in parts)) for cell in cells}]


Row: TypeAlias = tuple[int, ...]

_LEAF = 8


class _Node:
    """A leaf with entries, or an inner node with two children.

    `most` is the greatest number on each side; `first` and `last` are the least and the greatest entry below the node.
    """

    __slots__ = ("children", "entries", "first", "last", "most", "parent")

    def __init__(self, entries: list[tuple[int, Row]], parent: "_Node | None", depth: int) -> None:
        self.parent = parent
        self.most: Row = tuple(map(max, zip(*(row for _, row in entries), strict=True)))
        self.entries: dict[int, list[Row]] = {}
        self.children: tuple[_Node, ...] = ()
        self.first = min(number for number, _ in entries)
        self.last = max(number for number, _ in entries)
        side = self._side(entries, depth) if len(entries) > _LEAF else None
        if side is None:
            for number, row in entries:
                self.entries.setdefault(number, []).append(row)
            return
        entries.sort(key=lambda each: each[1][side])
        middle = len(entries) // 2
        self.children = tuple(_Node(part, self, side + 1) for part in (entries[:middle], entries[middle:]))

    def _side(self, entries: list[tuple[int, Row]], depth: int) -> int | None:
        """Return the side by which to divide the entries, in rotation; None if all entries are equal."""
        sides = len(self.most)
        for turn in range(sides):
            side = (depth + turn) % sides
            if any(row[side] != self.most[side] for _, row in entries):
                return side
        return None

    def without(self, number: int) -> None:
        """Remove an entry, and update the nodes above."""
        del self.entries[number]
        node: _Node | None = self
        while node is not None:
            within = [(each.first, each.last) for each in node.children if each.last >= 0] or [
                (each, each) for each in node.entries
            ]
            node.first, node.last = (
                (min(each[0] for each in within), max(each[1] for each in within)) if within else (0, -1)
            )
            node = node.parent


class EnclosingBoxes:
    """A k-d tree of numbered boxes. A number may have several boxes."""

    def __init__(self, entries: Sequence[tuple[int, Row]]) -> None:
        self._root = _Node(list(entries), None, 0) if entries else None
        self._leaves: dict[int, dict[_Node, None]] = {}
        waiting = [] if self._root is None else [self._root]
        while waiting:
            node = waiting.pop()
            waiting += node.children
            for number in node.entries:
                self._leaves.setdefault(number, {})[node] = None

    def remove(self, number: int) -> None:
        """Remove the boxes of a number, if there are any."""
        for leaf in self._leaves.pop(number, ()):
            leaf.without(number)

    def around(self, row: Row, after: int = -1) -> Iterator[int]:
        """Yield the numbers above `after` of the boxes that enclose a row, in ascending order, each once."""
        heap: list[tuple[int, int, _Node | None]] = []
        count = 0
        last = after

        def enter(node: _Node) -> None:
            nonlocal count
            if node.last > after and not any(map(lt, node.most, row)):
                count += 1
                heappush(heap, (node.first, count, node))

        if self._root is not None:
            enter(self._root)
        while heap:
            number, _, node = heappop(heap)
            if node is None:
                if number > last:
                    last = number
                    yield number
                continue
            for child in node.children:
                enter(child)
            for entry, rows in node.entries.items():
                if entry > last and any(not any(map(lt, each, row)) for each in rows):
                    count += 1
                    heappush(heap, (entry, count, None))
