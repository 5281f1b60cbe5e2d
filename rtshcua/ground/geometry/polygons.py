"""Points, segments and polygons with integer coordinates: exact predicates and distances, without floats."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from math import isqrt

#: a place or a vector: x (east) and y (north), in mm unless noted
Point = tuple[int, int]
#: the corners of a closed line; its last edge goes from the last corner to the first
Ring = tuple[Point, ...]
#: a straight line from one end to the other
Segment = tuple[Point, Point]


def sides(ring: Sequence[Point]) -> Iterator[Segment]:
    """Yield the edges of a ring, from each corner to the next."""
    return zip(ring, (*ring[1:], ring[0]), strict=True)


def doubled_area(corners: Sequence[Point]) -> int:
    """Return twice the signed area, positive if the corners are counter-clockwise."""
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in sides(corners))


def counter_clockwise(corners: Sequence[Point]) -> list[Point]:
    """Return the polygon with counter-clockwise corners, beginning at the same corner."""
    return list(corners) if doubled_area(corners) > 0 else [corners[0], *reversed(corners[1:])]


def crossing(corners: Sequence[Point]) -> tuple[int, int] | None:
    """Return the numbers of two edges that meet improperly, or None for a simple polygon.

    Edge i goes from corner i to the next.
    """
    met = touching_edges([corners])
    return None if met is None else (met[0][1], met[1][1])


def touching_edges(rings: Sequence[Sequence[Point]]) -> tuple[tuple[int, int], tuple[int, int]] | None:
    """Return two edges that meet improperly, or None if all rings are simple and have no common point.

    An edge is given by the numbers of its ring and of its first corner. Neighbours may share only their corner, other
    edges no point. A sweep over the west ends compares only edges whose bounding boxes overlap.
    """
    names = [(number, i) for number, ring in enumerate(rings) for i in range(len(ring))]
    edges = [edge for ring in rings for edge in sides(ring)]
    order = sorted(range(len(edges)), key=lambda i: min(edges[i][0][0], edges[i][1][0]))
    active: list[int] = []
    for i in order:
        a, b = edges[i]
        if a == b:
            number, at = names[i]
            return (number, at), (number, (at + 1) % len(rings[number]))
        west = min(a[0], b[0])
        active = [j for j in active if max(edges[j][0][0], edges[j][1][0]) >= west]
        south, north = min(a[1], b[1]), max(a[1], b[1])
        for j in active:
            c, d = edges[j]
            if max(c[1], d[1]) < south or min(c[1], d[1]) > north:
                continue
            one, other = min(i, j), max(i, j)
            if _meet_badly(edges[one], edges[other], names[one], names[other], len(rings[names[one][0]])):
                return names[one], names[other]
        active.append(i)
    return None


def _meet_badly(
    one: tuple[Point, Point],
    other: tuple[Point, Point],
    first: tuple[int, int],
    second: tuple[int, int],
    count: int,
) -> bool:
    """Whether two edges meet improperly. `count` is the number of corners of the first edge's ring."""
    if first[0] == second[0]:
        i, j = first[1], second[1]
        if (i + 1) % count == j:
            return _folds(one, other)
        if (j + 1) % count == i:
            return _folds(other, one)
    return meet(*one, *other)


def _folds(first: tuple[Point, Point], second: tuple[Point, Point]) -> bool:
    """Whether an edge runs back over the one before it."""
    a, b = first
    _, c = second
    turned = _side(a, b, c) == 0
    return turned and (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]) < 0


def meet(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Whether the closed segments a-b and c-d have a point in common."""
    s0, s1, s2, s3 = _side(a, b, c), _side(a, b, d), _side(c, d, a), _side(c, d, b)
    if ((s0 > 0) != (s1 > 0)) and ((s2 > 0) != (s3 > 0)) and 0 not in (s0, s1, s2, s3):
        return True
    return (
        (s0 == 0 and _between(a, b, c))
        or (s1 == 0 and _between(a, b, d))
        or (s2 == 0 and _between(c, d, a))
        or (s3 == 0 and _between(c, d, b))
    )


def _side(a: Point, b: Point, p: Point) -> int:
    """Return a positive number if p lies left of a-b, 0 if on its line."""
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])


def _between(a: Point, b: Point, p: Point) -> bool:
    """Whether p, a point on the line through a and b, lies between them."""
    return min(a[0], b[0]) <= p[0] <= max(a[0], b[0]) and min(a[1], b[1]) <= p[1] <= max(a[1], b[1])


def contains(corners: Sequence[Point], p: Point) -> bool:
    """Whether p is strictly inside a simple polygon."""
    return contained((corners,), p)


def contained(rings: Iterable[Sequence[Point]], p: Point) -> bool:
    """Whether p is strictly inside an area: an odd number of edges lies east of it, and it is on no edge."""
    inside = False
    for corners in rings:
        for a, b in sides(corners):
            side = _side(a, b, p)
            if side == 0 and _between(a, b, p):
                return False
            if (a[1] > p[1]) != (b[1] > p[1]) and (side > 0) == (b[1] > a[1]):
                inside = not inside
    return inside


def path_length(points: Sequence[Point]) -> int:
    """Return the length of a path in mm, each leg rounded down."""
    return sum(length(a, b) for a, b in pairwise(points))


def length(a: Point, b: Point) -> int:
    """Return the distance of two points in mm, rounded down."""
    return isqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2)


def scaled(vector: Point, length: int) -> Point:
    """Return a vector of the given length in the same direction, its components rounded towards zero."""
    x, y = vector
    root = isqrt((x * x + y * y) << 40) + 1

    def part(value: int) -> int:
        magnitude = (abs(value) * length << 20) // root
        return magnitude if value >= 0 else -magnitude

    return part(x), part(y)


def dot(a: Point, b: Point) -> int:
    """Return the inner product."""
    return a[0] * b[0] + a[1] * b[1]


def square(a: Point, b: Point) -> int:
    """Return the squared distance of two points."""
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2


def is_near(p: Point, edge: Segment, limit: int) -> bool:
    """Whether p is at most `limit` (at least 0) from a segment."""
    return _compare(p, edge, limit) <= 0


def are_apart(one: Segment, other: Segment, limit: int) -> bool:
    """Whether two segments are at least `limit` (above 0) apart."""
    if meet(*one, *other):
        return False
    return (
        _compare(one[0], other, limit) >= 0
        and _compare(one[1], other, limit) >= 0
        and _compare(other[0], one, limit) >= 0
        and _compare(other[1], one, limit) >= 0
    )


def is_beyond(p: Point, edge: Segment, limit: int) -> bool:
    """Whether p is at least `limit` from a segment."""
    return _compare(p, edge, limit) >= 0


def _compare(p: Point, edge: Segment, limit: int) -> int:
    """Return the sign of the distance of p from a segment minus `limit`."""
    (ax, ay), (bx, by) = edge
    ux, uy, vx, vy = bx - ax, by - ay, p[0] - ax, p[1] - ay
    along, square = ux * vx + uy * vy, ux * ux + uy * uy
    if along <= 0:
        distance, bound = vx * vx + vy * vy, limit * limit
    elif along >= square:
        wx, wy = p[0] - bx, p[1] - by
        distance, bound = wx * wx + wy * wy, limit * limit
    else:
        cross = ux * vy - uy * vx
        distance, bound = cross * cross, limit * limit * square
    return (distance > bound) - (distance < bound)


def interpolate(a: int, b: int, over: int, whole: int) -> int:
    """Return `a + (b - a) * over / whole`, rounded to the nearest integer."""
    if whole < 0:
        over, whole = -over, -whole
    return a + (2 * (b - a) * over + whole) // (2 * whole)
