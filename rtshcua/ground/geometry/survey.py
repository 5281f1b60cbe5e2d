"""Survey paths: the path of a `cover` motion in an area, in integers, so that it is the same on every machine.

The path stays `inset` mm away from the area's edge. Lines are parallel to the longest edge and at most one flying
height apart, which is the view of a camera of 53 degrees, but at least `LEAST_SPACING` apart. There are at most
`MOST_LINES`. If the straight line would leave the area or cross a hole, the path follows the edge. A perimeter runs
around the area but not around its holes. An area in several parts has no path.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache

from rtshcua.ground.geometry.offset import NoSuchOffset, inner
from rtshcua.ground.geometry.polygons import (
    Point,
    Ring,
    Segment,
    contained,
    doubled_area,
    is_beyond,
    length,
    meet,
    path_length,
    sides,
)
from rtshcua.ground.geometry.shapes import RoundArea, Shape, parts

#: the outer ring of an area, and its holes
Rings = tuple[Ring, ...]
#: a point on the edge, the number of its ring, and the number of the edge in the ring
EdgePoint = tuple[Point, int, int]


def path_within(rings: Rings, start: EdgePoint, end: EdgePoint) -> list[Point]:
    """Return the corners of a path between two points on the edge of an area.

    The path is straight where possible. If the straight line meets a ring, the path follows the ring to the point where
    the line leaves it for the last time. Both ends are in the area, so the path follows each ring at most once.
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


def _crossings(rings: Rings, start: EdgePoint, end: EdgePoint) -> list[tuple[Fraction, EdgePoint]]:
    """Return the points where the straight line meets edges, each with its position on the line; both ends included."""
    (px, py), (qx, qy) = start[0], end[0]
    found = [(Fraction(0), start), (Fraction(1), end)]
    ux, uy = qx - px, qy - py
    for ring, number, (a, b) in numbered_edges(rings):
        if (ring, number) in (start[1:], end[1:]) or not meet(start[0], end[0], a, b):
            continue
        vx, vy = b[0] - a[0], b[1] - a[1]
        cross = ux * vy - uy * vx
        if cross:
            along = Fraction((a[0] - px) * vy - (a[1] - py) * vx, cross)
            if 0 < along < 1:
                over = (a[0] - px) * uy - (a[1] - py) * ux
                found.append(
                    (
                        along,
                        ((interpolate(a[0], b[0], over, cross), interpolate(a[1], b[1], over, cross)), ring, number),
                    )
                )
    return found


def _along(rings: Rings, start: EdgePoint, end: EdgePoint) -> list[Point]:
    """Return the corners between two points of one ring, in the shorter direction."""
    (p, ring, first), (q, _, last) = start, end
    corners, count = rings[ring], len(rings[ring])
    onward = [corners[(first + 1 + k) % count] for k in range((last - first) % count)]
    back = [corners[(first - k) % count] for k in range((first - last) % count)]
    return min(onward, back, key=lambda points: path_length([p, *points, q]))


def _straight(rings: Rings, start: EdgePoint, end: EdgePoint) -> bool:
    """Whether the line between two points on the edge is inside: it meets no other edge, and its middle is inside.

    Both edges at a corner at which it begins or ends are ignored.
    """
    p, q = start[0], end[0]
    if start[1:] == end[1:]:
        return True
    middle = ((p[0] + q[0]) // 2, (p[1] + q[1]) // 2)
    if not contained(rings, middle):
        return False
    return not any(
        meet(p, q, *edge)
        for ring, number, edge in numbered_edges(rings)
        if (ring, number) not in (start[1:], end[1:]) and p not in edge and q not in edge
    )


def numbered_edges(rings: Rings) -> Iterator[tuple[int, int, Segment]]:
    """Yield every edge with the number of its ring and its own number."""
    for number, ring in enumerate(rings):
        for at, edge in enumerate(sides(ring)):
            yield number, at, edge


def interpolate(a: int, b: int, over: int, whole: int) -> int:
    """Return `a + (b - a) * over / whole`, rounded to the nearest integer."""
    if whole < 0:
        over, whole = -over, -whole
    return a + (2 * (b - a) * over + whole) // (2 * whole)


LEAST_SPACING = 5_000  # mm
LEAST_INSET = 1_000  # mm
MOST_LINES = 256
DEFAULT_PATTERN = "grid"

#: corners of a regular 16-gon on a circle of radius 2**20, counter-clockwise from east
CIRCLE_SCALE = 1 << 20
_QUARTER = ((1048576, 0), (968758, 401273), (741455, 741455), (401273, 968758))
CORNERS = (
    *((x, y) for x, y in _QUARTER),
    *((-y, x) for x, y in _QUARTER),
    *((-x, -y) for x, y in _QUARTER),
    *((y, -x) for x, y in _QUARTER),
)


def survey(area: Shape, pattern: str, spacing: int, inset: int, start: Point | None) -> tuple[Point, ...] | None:
    """Return the points of a path in `area`, beginning at the end nearer to `start`; None if the area is too small."""
    try:
        shape = _inset(area, max(inset, LEAST_INSET))
    except NoSuchOffset:
        return None
    if isinstance(shape, RoundArea):
        rings: Rings = (_regular(shape.center, shape.radius),)
    else:
        found = parts(shape)
        if len(found) > 1:
            return None
        rings = (found[0][0], *found[0][1])
    points = PATTERNS[pattern](rings, max(spacing, LEAST_SPACING))
    if points is not None and start is not None and length(points[-1], start) < length(points[0], start):
        points.reverse()
    return None if points is None else tuple(points)


@lru_cache(maxsize=64)
def _inset(area: Shape, by: int) -> Shape:
    """Return an area shrunk by `by` mm. The cache serves the instances of a mission, which share areas."""
    return inner(area, -by)


def _regular(center: Point, radius: int) -> tuple[Point, ...]:
    """Return a regular 16-gon in a circle, rounded towards the centre."""
    x, y = center

    def scale(share: int) -> int:
        return radius * share // CIRCLE_SCALE if share >= 0 else -(radius * -share // CIRCLE_SCALE)

    return tuple((x + scale(dx), y + scale(dy)) for dx, dy in CORNERS)


def _perimeter(rings: Rings, _: int) -> list[Point]:
    """Return the path once along the outer edge."""
    return [*rings[0], rings[0][0]]


def _orbit(rings: Rings, _: int) -> list[Point] | None:
    """Return the largest circle around the centroid within the outer edge; None if it is too small or meets a hole."""
    outer, holes = rings[0], rings[1:]
    center = _centroid(outer)
    if not contained((outer,), center):
        return None
    low, high = 0, max(length(center, corner) for corner in outer)
    while high - low > 1:
        middle = (low + high) // 2
        if all(is_beyond(center, edge, middle) for edge in sides(outer)):
            low = middle
        else:
            high = middle
    circle = _regular(center, low)
    if low < LEAST_INSET or any(contained((hole,), circle[0]) for hole in holes):
        return None
    if any(meet(*leg, *edge) for hole in holes for edge in sides(hole) for leg in sides(circle)):
        return None
    return [*circle, circle[0]]


def _centroid(ring: Ring) -> Point:
    sums = [0, 0]
    for (ax, ay), (bx, by) in sides(ring):
        cross = ax * by - bx * ay
        sums[0] += (ax + bx) * cross
        sums[1] += (ay + by) * cross
    area = 3 * doubled_area(ring)
    return sums[0] // area, sums[1] // area


def _grid(rings: Rings, spacing: int) -> list[Point]:
    """Return a path back and forth on parallel lines, evenly spaced over the width of the area."""
    a, b = max(sides(rings[0]), key=lambda edge: length(*edge))
    along = (b[0] - a[0], b[1] - a[1])
    across = (-along[1], along[0])
    unit = length(a, b)
    heights = [across[0] * x + across[1] * y for x, y in rings[0]]
    low, width = min(heights), max(heights) - min(heights)
    count = min(max(1, -(-width // (spacing * unit))), MOST_LINES)
    path: list[Point] = []
    last: EdgePoint | None = None
    for line in range(count):
        met = _line(rings, across, low + (2 * line + 1) * width // (2 * count))
        met.sort(key=lambda each: (along[0] * each[0][0] + along[1] * each[0][1], each[1:]), reverse=bool(line % 2))
        for each in met:
            path += [*(() if last is None else path_within(rings, last, each)), each[0]]
            last = each
    return _distinct(path)


def _line(rings: Rings, across: Point, height: int) -> list[EdgePoint]:
    """Return the points where the line `across . p = height` enters and leaves the area."""
    met: list[EdgePoint] = []
    for ring, number, (a, b) in numbered_edges(rings):
        over_a = across[0] * a[0] + across[1] * a[1] - height
        over_b = across[0] * b[0] + across[1] * b[1] - height
        if (over_a < 0) != (over_b < 0):
            whole = over_a - over_b
            met.append(((interpolate(a[0], b[0], over_a, whole), interpolate(a[1], b[1], over_a, whole)), ring, number))
    return met


def _distinct(points: Sequence[Point]) -> list[Point]:
    return [point for number, point in enumerate(points) if number == 0 or points[number - 1] != point]


PATTERNS: Mapping[str, Callable[[Rings, int], list[Point] | None]] = {
    "grid": _grid,
    "perimeter": _perimeter,
    "orbit": _orbit,
}
