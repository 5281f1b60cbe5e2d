"""Ways within an area: straight where that stays inside, else along its edges."""

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import pairwise
from math import isqrt

from rtshcua.ground.geometry.distance import Edge
from rtshcua.ground.geometry.polygons import contained, meet
from rtshcua.ground.geometry.shapes import Point, Ring

#: the outer ring of an area, and its holes
Rings = tuple[Ring, ...]
#: a point on the edge, the number of its ring, and that of the edge in the ring
Met = tuple[Point, int, int]


def way(rings: Rings, start: Met, end: Met) -> list[Point]:
    """The corners of a way between two points on the edge of an area.

    It is straight where it can be. Where the straight way meets a ring, it follows that to where the straight way
    leaves it for the last time: from there on, the straight way is on the right side of that ring. Both ends being in
    the area, it meets each ring once.
    """
    if _straight(rings, start, end):
        return []
    if start[1] == end[1]:
        return _along(rings, start, end)
    met = _crossings(rings, start, end)
    here, passed = start, Fraction(0)
    points: list[Point] = []
    while True:
        passed, there = max((t, each) for t, each in met if each[1] == here[1])
        points += [*_along(rings, here, there), there[0]]
        if there == end:
            return points[:-1]
        passed, here = min((t, each) for t, each in met if t > passed)
        points.append(here[0])


def _crossings(rings: Rings, start: Met, end: Met) -> list[tuple[Fraction, Met]]:
    """Where the straight way meets edges, with how far along it that is; both ends are among them."""
    (px, py), (qx, qy) = start[0], end[0]
    found = [(Fraction(0), start), (Fraction(1), end)]
    ux, uy = qx - px, qy - py
    for ring, number, (a, b) in numbered(rings):
        if (ring, number) in (start[1:], end[1:]) or not meet(start[0], end[0], a, b):
            continue
        vx, vy = b[0] - a[0], b[1] - a[1]
        cross = ux * vy - uy * vx
        if cross:
            along = Fraction((a[0] - px) * vy - (a[1] - py) * vx, cross)
            if 0 < along < 1:
                over = (a[0] - px) * uy - (a[1] - py) * ux
                found.append((along, ((part(a[0], b[0], over, cross), part(a[1], b[1], over, cross)), ring, number)))
    return found


def _along(rings: Rings, start: Met, end: Met) -> list[Point]:
    """The corners between two points of one ring, the shorter way round."""
    (p, ring, first), (q, _, last) = start, end
    corners, count = rings[ring], len(rings[ring])
    onward = [corners[(first + 1 + k) % count] for k in range((last - first) % count)]
    back = [corners[(first - k) % count] for k in range((first - last) % count)]
    return min(onward, back, key=lambda points: path_length([p, *points, q]))


def _straight(rings: Rings, start: Met, end: Met) -> bool:
    """Whether the way between two points on the edge is inside: it meets no other edge, and its middle is inside. Where
    it begins or ends at a corner, both edges of that are its own.
    """
    p, q = start[0], end[0]
    if start[1:] == end[1:]:
        return True
    middle = ((p[0] + q[0]) // 2, (p[1] + q[1]) // 2)
    if not contained(rings, middle):
        return False
    return not any(
        meet(p, q, *edge)
        for ring, number, edge in numbered(rings)
        if (ring, number) not in (start[1:], end[1:]) and p not in edge and q not in edge
    )


def numbered(rings: Rings) -> Iterator[tuple[int, int, Edge]]:
    """Every edge, with the number of its ring and its own."""
    for number, ring in enumerate(rings):
        for at, edge in enumerate(sides(ring)):
            yield number, at, edge


def sides(ring: Ring) -> list[Edge]:
    """The edges of a ring, from each corner to the next."""
    return list(zip(ring, (*ring[1:], ring[0]), strict=True))


def part(a: int, b: int, over: int, whole: int) -> int:
    """`a + (b - a) * over / whole`, to the nearest integer."""
    if whole < 0:
        over, whole = -over, -whole
    return a + (2 * (b - a) * over + whole) // (2 * whole)


def path_length(points: Sequence[Point]) -> int:
    """The length of a path in mm, rounded down leg by leg."""
    return sum(length(a, b) for a, b in pairwise(points))


def length(a: Point, b: Point) -> int:
    """The distance of two points in mm, rounded down."""
    return isqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2)
