"""Is a place, or everything along a path, inside a zone? Exact, in integers, without division.

A zone is an open set: its boundary, floor and ceiling are outside. A *sweep* is a path of straight legs, each widened
by a box; a point is a path of one place and an empty box, a set of places one place and the box they may be in, and
what a vehicle with a position error may cover is its path and the box of that error. A sweep that touches a boundary
counts as being on both sides of it, so that it is refused whichever side was asked.

Bounds for 64-bit arithmetic: coordinates and box sides within 2**29 mm (`MAX_COORDINATE`), hence differences within
2**30, cross products within 2**61 and their sums with the box's within 2**62.
"""

from math import isqrt
from typing import TypeAlias

from rtshcua.decision.truth import FALSE, TRUE, Truth
from rtshcua.model.flat.zone import CIRCLE, Zone

#: how far a sweep reaches west, south (not above 0), east and north (not below 0) of its path, mm
Box: TypeAlias = tuple[int, int, int, int]
#: x0, y0, x1, y1 and the bounding box west, east, south, north
Edge: TypeAlias = tuple[int, int, int, int, int, int, int, int]
#: x0, y0, x1, y1
Leg: TypeAlias = tuple[int, int, int, int]

NO_BOX: Box = (0, 0, 0, 0)
FEW_EDGES = 16


class Circle:
    """All places nearer to a centre than a radius."""

    __slots__ = ("_radius", "_square", "_x", "_y")

    def __init__(self, data: tuple[int, ...]) -> None:
        self._x, self._y, self._square = data
        self._radius = isqrt(self._square - 1) + 1

    def contains(self, x: int, y: int) -> bool:
        """Whether a place is inside."""
        dx, dy = x - self._x, y - self._y
        return dx * dx + dy * dy < self._square

    def clear(self, x0: int, y0: int, x1: int, y1: int, box: Box) -> bool:
        """Whether the widened leg is wholly inside, or wholly outside by a margin of at most 3 mm."""
        west, south, east, north = box
        reach_x, reach_y = max(-west, east), max(-south, north)
        reach = self._radius + isqrt(reach_x * reach_x + reach_y * reach_y) + 1
        if self._outside(x0, y0, x1, y1, reach):
            return True
        return self._holds(x0, y0, box) and self._holds(x1, y1, box)  # a disc is convex

    def _holds(self, x: int, y: int, box: Box) -> bool:
        """Whether a widened place is inside: its corner farthest from the centre is."""
        west, south, east, north = box
        dx = max(abs(x + west - self._x), abs(x + east - self._x))
        dy = max(abs(y + south - self._y), abs(y + north - self._y))
        return dx * dx + dy * dy < self._square

    def _outside(self, x0: int, y0: int, x1: int, y1: int, radius: int) -> bool:
        """Whether the leg keeps further than `radius` from the centre; its length is rounded up, for safety."""
        ux, uy, vx, vy = x1 - x0, y1 - y0, self._x - x0, self._y - y0
        along, square = ux * vx + uy * vy, ux * ux + uy * uy
        if along <= 0:
            return vx * vx + vy * vy > radius * radius
        if along >= square:
            wx, wy = self._x - x1, self._y - y1
            return wx * wx + wy * wy > radius * radius
        return abs(ux * vy - uy * vx) > radius * (isqrt(square) + 1)


class Polygon:
    """A simple polygon. Its edges are kept in horizontal bands, so that a question looks at few of them."""

    __slots__ = ("_bands", "_east", "_height", "_north", "_south", "_west")

    def __init__(self, data: tuple[int, ...]) -> None:
        xs, ys = data[::2], data[1::2]
        self._west, self._east, self._south, self._north = min(xs), max(xs), min(ys), max(ys)
        edges = [_edge(x0, y0, x1, y1) for x0, y0, x1, y1 in zip(xs, ys, xs[1:] + xs[:1], ys[1:] + ys[:1], strict=True)]
        count = 1 if len(edges) <= FEW_EDGES else isqrt(len(edges))
        self._height = (self._north - self._south) // count + 1
        bands: list[list[Edge]] = [[] for _ in range(count)]
        for edge in edges:
            for band in range(self._band(edge[6]), self._band(edge[7]) + 1):
                bands[band].append(edge)
        self._bands = tuple(tuple(band) for band in bands)

    def _band(self, y: int) -> int:
        return (y - self._south) // self._height

    def contains(self, x: int, y: int) -> bool:
        """Whether a place is inside: an odd number of edges lie east of it, and none goes through it."""
        if not (self._west < x < self._east and self._south < y < self._north):
            return False
        inside = False
        for x0, y0, x1, y1, west, east, south, north in self._bands[self._band(y)]:
            if south <= y <= north:
                side = (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)
                if side == 0 and west <= x <= east:
                    return False
                if (y0 > y) != (y1 > y) and (side > 0) == (y1 > y0):
                    inside = not inside
        return inside

    def clear(self, x0: int, y0: int, x1: int, y1: int, box: Box) -> bool:
        """Whether no edge meets the widened leg: each is parted from it by a line (separating axes)."""
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


def _edge(x0: int, y0: int, x1: int, y1: int) -> Edge:
    return (x0, y0, x1, y1, min(x0, x1), max(x0, x1), min(y0, y1), max(y0, y1))


def _parted(x: int, y: int, edge: Leg, leg: Leg, box: Box) -> bool:
    """Whether a line in the direction (x, y) parts an edge from a widened leg: their cross products do not overlap."""
    west, south, east, north = box
    a, b, c, d = x * edge[1] - y * edge[0], x * edge[3] - y * edge[2], x * leg[1] - y * leg[0], x * leg[3] - y * leg[2]
    least = (x * south if x > 0 else x * north) - (y * east if y > 0 else y * west)
    most = (x * north if x > 0 else x * south) - (y * west if y > 0 else y * east)
    return max(a, b) < min(c, d) + least or min(a, b) > max(c, d) + most


class PreparedZone:
    """A zone ready to be asked; `number` is its index in the policy."""

    __slots__ = ("ceiling", "floor", "number", "shape")

    def __init__(self, number: int, zone: Zone) -> None:
        self.number = number
        self.floor, self.ceiling = zone.floor, zone.ceiling
        self.shape: Circle | Polygon = Circle(zone.data) if zone.shape == CIRCLE else Polygon(zone.data)

    def along(self, path: tuple[int, ...], box: Box) -> Truth:
        """Whether the places of a sweep are inside, whatever their height."""
        shape = self.shape
        if len(path) > 2:
            for at in range(0, len(path) - 2, 2):
                if not shape.clear(path[at], path[at + 1], path[at + 2], path[at + 3], box):
                    return TRUE | FALSE
        elif box != NO_BOX and not shape.clear(path[0], path[1], path[0], path[1], box):
            return TRUE | FALSE
        return TRUE if shape.contains(path[0], path[1]) else FALSE

    def between(self, low: int, high: int) -> Truth:
        """Whether the heights `low`..`high` (mm above home) lie between floor and ceiling."""
        if low > self.floor and high < self.ceiling:
            return TRUE
        return FALSE if high <= self.floor or low >= self.ceiling else TRUE | FALSE
