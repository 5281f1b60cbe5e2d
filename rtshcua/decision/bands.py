"""Does any edge of a zone meet a widened leg? Edges are kept in horizontal bands, so that a question looks at few.

An edge is kept once for each band that it runs through; there are fewer bands where that would be more than
`REPEATS` times the number of edges.
"""

from collections.abc import Iterable
from math import isqrt
from typing import TypeAlias

from rtshcua.decision.outline import Leg

#: how far a sweep reaches west, south (not above 0), east and north (not below 0) of its path, mm
Box: TypeAlias = tuple[int, int, int, int]
#: x0, y0, x1, y1 and the bounding box west, east, south, north
Edge: TypeAlias = tuple[int, int, int, int, int, int, int, int]

FEW_EDGES = 16
REPEATS = 4


class Bands:
    """Edges, by where they are."""

    __slots__ = ("_bands", "_height", "_south")

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

    def _band(self, y: int) -> int:
        return (y - self._south) // self._height

    def clear(self, x0: int, y0: int, x1: int, y1: int, box: Box) -> bool:
        """Whether no edge meets the widened leg: each is parted from it by a line (separating axes).

        Both are convex, so an edge that lies wholly within the leg, as a swallowed hole's does, is not parted from it.
        """
        west, east = (x0, x1) if x0 < x1 else (x1, x0)
        south, north = (y0, y1) if y0 < y1 else (y1, y0)
        west, south, east, north = west + box[0], south + box[1], east + box[2], north + box[3]
        first, last = max(self._band(south), 0), min(self._band(north), len(self._bands) - 1)
        for band in self._bands[first : last + 1]:  # an edge that spans bands comes once for each
            for ax, ay, bx, by, edge_west, edge_east, edge_south, edge_north in band:
                if edge_east < west or edge_west > east or edge_north < south or edge_south > north:
                    continue
                edge, leg = (ax, ay, bx, by), (x0, y0, x1, y1)
                if not _parted(x1 - x0, y1 - y0, edge, leg, box) and not _parted(bx - ax, by - ay, edge, leg, box):
                    return False
        return True

    def entries(self) -> int:
        """How many edges are kept, each counted once for each band."""
        return sum(map(len, self._bands))


def _edge(x0: int, y0: int, x1: int, y1: int) -> Edge:
    return (x0, y0, x1, y1, min(x0, x1), max(x0, x1), min(y0, y1), max(y0, y1))


def _parted(x: int, y: int, edge: Leg, leg: Leg, box: Box) -> bool:
    """Whether a line in the direction (x, y) parts an edge from a widened leg: their cross products do not overlap."""
    west, south, east, north = box
    a, b, c, d = x * edge[1] - y * edge[0], x * edge[3] - y * edge[2], x * leg[1] - y * leg[0], x * leg[3] - y * leg[2]
    least = (x * south if x > 0 else x * north) - (y * east if y > 0 else y * west)
    most = (x * north if x > 0 else x * south) - (y * west if y > 0 else y * east)
    return max(a, b) < min(c, d) + least or min(a, b) > max(c, d) + most
