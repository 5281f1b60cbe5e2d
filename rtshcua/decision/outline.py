"""The rings that bound a zone other than a circle, with two queries: is a place inside, and is a way clear of the
rings?

`Slabs` answers the first. The plane is cut into horizontal slabs at the heights of all corners. The edges through
a slab do not meet there, so they have an order from west to east, and bisection finds how many are west of a
place: the place is inside when that number is odd. A query thus costs two bisections, one over the slabs and one
over the edges of a slab.

An edge may run through many slabs, as in a long zig-zag. Where that would make more than `MOST` entries for each
edge, slabs are the leaves of a tree instead. Each edge is kept at the few nodes that it spans completely, and a
slab has the nodes from its leaf to the root. The tree is as wide as possible. With `n` corners there are thus
never more than `MOST * n` entries, because a binary tree's `2 * log2(n)` is no more than that for as many corners
as fit on board. A query costs at most `log2(n) + 2` bisections, about half as many for 1,000 corners or fewer.

Queries stay within 64 bits as long as coordinates do (see `zones`). Sorting happens once, at load, and uses exact
rationals scaled to integers; an evaluator in C would compare by the ends' cross products instead.

`Bands` answers the second query: does any edge meet a widened leg? Edges are kept in horizontal bands, so that a
query compares few edges. An edge is kept once for each band that it runs through. Where that would make more than
`REPEATS` entries for each edge, there are fewer bands.
"""

from bisect import bisect_right
from collections.abc import Iterable, Iterator
from itertools import accumulate, pairwise
from math import isqrt
from typing import TypeAlias

from rtshcua.model.flat.zone import AREA, Zone

#: x, y
Corner: TypeAlias = tuple[int, int]
#: x0, y0, x1, y1
Leg: TypeAlias = tuple[int, int, int, int]


def rings(zone: Zone) -> Iterator[tuple[Corner, ...]]:
    """The corners of each ring: outer rings counter-clockwise, holes clockwise."""
    data = zone.data
    counts, at = (data[1 : 1 + data[0]], 1 + data[0]) if zone.shape == AREA else ((len(data) // 2,), 0)
    for count in counts:
        end = at + 2 * count
        yield tuple(zip(data[at:end:2], data[at + 1 : end : 2], strict=True))
        at = end


def edges(zone: Zone) -> Iterator[Leg]:
    """The edges of all rings."""
    for ring in rings(zone):
        for (x0, y0), (x1, y1) in pairwise((*ring, ring[0])):
            yield (x0, y0, x1, y1)


#: how far a sweep reaches west, south (not above 0), east and north (not below 0) of its path, mm
Box: TypeAlias = tuple[int, int, int, int]
#: x0, y0, x1, y1 and the bounding box west, east, south, north
Edge: TypeAlias = tuple[int, int, int, int, int, int, int, int]

FEW_EDGES = 16
REPEATS = 4


class Bands:
    """Edges, indexed by horizontal band."""

    __slots__ = ("_bands", "_before", "_height", "_south")

    def __init__(self, edges: Iterable[Leg]) -> None:
        kept = [_edge(*edge) for edge in edges]
        self._south = min(edge[6] for edge in kept)
        height = max(edge[7] for edge in kept) - self._south
        count = 1 if len(kept) <= FEW_EDGES else isqrt(len(kept))
        self._height = height // count + 1
        while sum(self._band(edge[7]) - self._band(edge[6]) + 1 for edge in kept) > REPEATS * len(kept):
            count //= 2
            self._height = height // count + 1
        bands: list[list[Edge]] = [[] for _ in range(count)]
        for edge in kept:
            for band in range(self._band(edge[6]), self._band(edge[7]) + 1):
                bands[band].append(edge)
        self._bands = tuple(tuple(band) for band in bands)
        self._before = tuple(accumulate(map(len, bands), initial=0))

    def _band(self, y: int) -> int:
        return (y - self._south) // self._height

    def clear(self, x0: int, y0: int, x1: int, y1: int, box: Box) -> bool:
        """Whether no edge meets the widened leg: a separating axis exists for each.

        Both are convex. An edge that lies completely within the leg, such as one of an enclosed hole, has no
        separating axis.
        """
        west, east = (x0, x1) if x0 < x1 else (x1, x0)
        south, north = (y0, y1) if y0 < y1 else (y1, y0)
        west, south, east, north = west + box[0], south + box[1], east + box[2], north + box[3]
        first, last = max(self._band(south), 0), min(self._band(north), len(self._bands) - 1)
        for band in self._bands[first : last + 1]:  # an edge that spans several bands appears once in each
            for ax, ay, bx, by, edge_west, edge_east, edge_south, edge_north in band:
                if edge_east < west or edge_west > east or edge_north < south or edge_south > north:
                    continue
                edge, leg = (ax, ay, bx, by), (x0, y0, x1, y1)
                if not _parted(x1 - x0, y1 - y0, edge, leg, box) and not _parted(bx - ax, by - ay, edge, leg, box):
                    return False
        return True

    def compared(self, y0: int, y1: int, box: Box) -> int:
        """The greatest number of edges that `clear` compares with a leg between these heights."""
        first = max(self._band(min(y0, y1) + box[1]), 0)
        last = min(self._band(max(y0, y1) + box[3]), len(self._bands) - 1)
        return self._before[last + 1] - self._before[first] if first <= last else 0

    def entries(self) -> int:
        """The number of stored edges, each counted once for each band."""
        return self._before[-1]


def _edge(x0: int, y0: int, x1: int, y1: int) -> Edge:
    return (x0, y0, x1, y1, min(x0, x1), max(x0, x1), min(y0, y1), max(y0, y1))


def _parted(x: int, y: int, edge: Leg, leg: Leg, box: Box) -> bool:
    """Whether a line in the direction (x, y) separates an edge from a widened leg: their cross products do not
    overlap.
    """
    west, south, east, north = box
    a, b, c, d = x * edge[1] - y * edge[0], x * edge[3] - y * edge[2], x * leg[1] - y * leg[0], x * leg[3] - y * leg[2]
    least = (x * south if x > 0 else x * north) - (y * east if y > 0 else y * west)
    most = (x * north if x > 0 else x * south) - (y * west if y > 0 else y * east)
    return max(a, b) < min(c, d) + least or min(a, b) > max(c, d) + most


#: the lower end x, y, and how far the upper end lies east (or west, if negative) and north of it
Rise: TypeAlias = tuple[int, int, int, int]
#: edges through the same slabs, from west to east
Row: TypeAlias = tuple[Rise, ...]

MOST = 32

#: two different x at one y, on edges no higher than 2**30, differ by at least 2**-60
SCALE = 61


class Slabs:
    """The interior of some rings, by the even-odd rule; the edges themselves are outside."""

    __slots__ = ("_east", "_levels", "_tables", "_west", "_ys")

    def __init__(self, edges: Iterable[Leg]) -> None:
        """The rings must be simple and must not touch each other."""
        edges = tuple(edges)
        self._west, self._east = min(edge[0] for edge in edges), max(edge[0] for edge in edges)
        self._ys = sorted({edge[1] for edge in edges})
        index = {y: at for at, y in enumerate(self._ys)}
        self._levels = _levels(edges, index)
        rises = tuple(_rise(*edge) for edge in edges if edge[1] != edge[3])
        spans = tuple((index[y], index[y + dy]) for _, y, _, dy in rises)
        if sum(high - low for low, high in spans) <= MOST * len(edges):
            slabs: list[list[Rise]] = [[] for _ in index]
            for rise, (low, high) in zip(rises, spans, strict=True):
                for slab in slabs[low:high]:
                    slab.append(rise)
            self._tables: tuple[tuple[Row, ...], ...] = tuple((_row(slab),) for slab in slabs)
        else:
            self._tables = _tree(rises, spans, len(index))

    def contains(self, x: int, y: int) -> bool:
        """Whether a place is inside."""
        if not self._west < x < self._east:
            return False
        slab = bisect_right(self._ys, y) - 1
        if slab < 0 or (self._ys[slab] == y and _on(self._levels[slab], x)):
            return False
        inside = False
        for row in self._tables[slab]:
            low, high = 0, len(row)
            while low < high:
                middle = (low + high) >> 1
                x0, y0, dx, dy = row[middle]
                side = dx * (y - y0) - dy * (x - x0)
                if side < 0:
                    low = middle + 1
                elif side:
                    high = middle
                else:
                    return False
            if low & 1:
                inside = not inside
        return inside

    def entries(self) -> int:
        """The number of stored edges, each counted once for each node."""
        # slabs share the rows of a node, and two nodes may have equal rows
        return sum(len(row) for row in {id(row): row for table in self._tables for row in table}.values())


def _rise(x0: int, y0: int, x1: int, y1: int) -> Rise:
    return (x0, y0, x1 - x0, y1 - y0) if y0 < y1 else (x1, y1, x0 - x1, y0 - y1)


def _levels(edges: Iterable[Leg], index: dict[int, int]) -> tuple[tuple[int, ...], ...]:
    """For each height with corners, the parts of the outline at it: west end, east end, the next west end, ..."""
    found: list[list[tuple[int, int]]] = [[] for _ in index]
    for x0, y0, x1, y1 in edges:
        found[index[y0]].append((min(x0, x1), max(x0, x1)) if y0 == y1 else (x0, x0))
        found[index[y1]].append((x1, x1))
    return tuple(_joined(sorted(parts)) for parts in found)


def _joined(parts: list[tuple[int, int]]) -> tuple[int, ...]:
    """The sorted intervals, with overlapping ones joined."""
    joined: list[int] = []
    for west, east in parts:
        if joined and west <= joined[-1]:
            joined[-1] = max(joined[-1], east)
        else:
            joined += (west, east)
    return tuple(joined)


def _on(parts: tuple[int, ...], x: int) -> bool:
    """Whether an interval holds x."""
    at = bisect_right(parts, x)
    return at % 2 == 1 or (at > 0 and parts[at - 1] == x)


def _tree(rises: tuple[Rise, ...], spans: tuple[tuple[int, int], ...], count: int) -> tuple[tuple[Row, ...], ...]:
    """For each slab, the rows from its leaf to the root."""
    bits, depth = _shape(count)
    leaves = 1 << bits * depth
    nodes: list[list[Rise]] = [[] for _ in range(2 * leaves)]
    for rise, (low, high) in zip(rises, spans, strict=True):
        _spread(rise, low + leaves, high + leaves, nodes, bits)
    rows = [_row(node) for node in nodes]
    return tuple(_to_root(leaf, rows, bits) for leaf in range(leaves, leaves + count))


def _shape(count: int) -> tuple[int, int]:
    """The widest tree with this many leaves that keeps no edge at more than `MOST` nodes. A node has `2**bits`
    children, and an edge is stored at fewer nodes than that at either end of each level below the root.
    """
    bits = 3
    while bits > 1 and 2 * ((1 << bits) - 1) * _depth(count, bits) > MOST:
        bits -= 1
    return bits, _depth(count, bits)


def _depth(count: int, bits: int) -> int:
    return -(-(count - 1).bit_length() // bits)


def _spread(rise: Rise, low: int, high: int, nodes: list[list[Rise]], bits: int) -> None:
    """Store an edge at the fewest nodes that cover the leaves from `low` to before `high`; the parent of node `n` is
    `n >> bits`.
    """
    others = (1 << bits) - 1
    while low < high:
        while low & others and low < high:
            nodes[low].append(rise)
            low += 1
        while high & others and low < high:
            high -= 1
            nodes[high].append(rise)
        low >>= bits
        high >>= bits


def _row(rises: list[Rise]) -> Row:
    """The edges of a node from west to east, ordered at the middle of their common heights."""
    if len(rises) < 2:
        return tuple(rises)
    twice = max(y for _, y, _, _ in rises) + min(y + dy for _, y, _, dy in rises)
    return tuple(
        sorted(rises, key=lambda rise: (rise[0] << SCALE + 1) + (rise[2] * (twice - 2 * rise[1]) << SCALE) // rise[3])
    )


def _to_root(node: int, rows: list[Row], bits: int) -> tuple[Row, ...]:
    """The rows from a node to the root that have an edge."""
    table: list[Row] = []
    while node:
        if rows[node]:
            table.append(rows[node])
        node >>= bits
    return tuple(table)
