"""Survey paths: where a `cover` motion flies within an area. Integers only, so the same path comes out everywhere.

The path keeps `inset` mm away from the area's edge. Lines are parallel to the longest edge and at most one flying
height apart, which is what a camera of 53 degrees sees at once; never closer than `LEAST_SPACING` and never more than
`MOST_LINES`. Where the straight way from one line to the next would leave the area, the path follows its edge.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from math import isqrt

from rtshcua.ground.checker.polygons import contains, doubled_area, meet
from rtshcua.ground.compiler.distance import far
from rtshcua.ground.compiler.offset import Unshapely, inner
from rtshcua.ground.compiler.shapes import Disc, Outline, Point, Shape, edges

LEAST_SPACING = 5_000  # mm
LEAST_INSET = 1_000  # mm
MOST_LINES = 256

#: corners of a regular 16-gon on a circle of radius 2**20, counter-clockwise from east
CIRCLE_SCALE = 1 << 20
_QUARTER = ((1048576, 0), (968758, 401273), (741455, 741455), (401273, 968758))
CORNERS = (
    *((x, y) for x, y in _QUARTER),
    *((-y, x) for x, y in _QUARTER),
    *((-x, -y) for x, y in _QUARTER),
    *((y, -x) for x, y in _QUARTER),
)

#: a point of a scan line, and the number of the edge it lies on
_Met = tuple[Point, int]


def survey(area: Shape, pattern: str, spacing: int, inset: int, start: Point | None) -> tuple[Point, ...] | None:
    """The points of a path in `area`, beginning at the end nearer to `start`; None where the area is too small."""
    try:
        outline = _outline(area, max(inset, LEAST_INSET))
    except Unshapely:
        return None
    points = _PATTERNS[pattern](outline, max(spacing, LEAST_SPACING))
    if points is not None and start is not None and _length(points[-1], start) < _length(points[0], start):
        points.reverse()
    return None if points is None else tuple(points)


def path_length(points: Sequence[Point]) -> int:
    """The length of a path in mm, rounded down leg by leg."""
    return sum(_length(a, b) for a, b in pairwise(points))


def _outline(area: Shape, inset: int) -> Outline:
    shape = inner(area, -inset)
    return Outline(_regular(shape.center, shape.radius)) if isinstance(shape, Disc) else shape


def _regular(center: Point, radius: int) -> tuple[Point, ...]:
    """A regular 16-gon in a circle, rounded towards its centre."""
    x, y = center

    def scaled(part: int) -> int:
        return radius * part // CIRCLE_SCALE if part >= 0 else -(radius * -part // CIRCLE_SCALE)

    return tuple((x + scaled(dx), y + scaled(dy)) for dx, dy in CORNERS)


def _perimeter(outline: Outline, _: int) -> list[Point]:
    """Once around along the edge."""
    return [*outline.corners, outline.corners[0]]


def _orbit(outline: Outline, _: int) -> list[Point] | None:
    """Once around the centre of the area, on the largest circle within it."""
    center = _centroid(outline)
    if not contains(outline.corners, center):
        return None
    low, high = 0, max(_length(center, corner) for corner in outline.corners)
    while high - low > 1:
        middle = (low + high) // 2
        if all(far(center, edge, middle) for edge in edges(outline)):
            low = middle
        else:
            high = middle
    circle = _regular(center, low)
    return [*circle, circle[0]] if low >= LEAST_INSET else None


def _centroid(outline: Outline) -> Point:
    sums = [0, 0]
    for (ax, ay), (bx, by) in edges(outline):
        cross = ax * by - bx * ay
        sums[0] += (ax + bx) * cross
        sums[1] += (ay + by) * cross
    area = 3 * doubled_area(outline.corners)
    return sums[0] // area, sums[1] // area


def _grid(outline: Outline, spacing: int) -> list[Point]:
    """Back and forth on parallel lines, evenly spaced over the width of the area."""
    a, b = max(edges(outline), key=lambda edge: _length(*edge))
    along = (b[0] - a[0], b[1] - a[1])
    across = (-along[1], along[0])
    unit = _length(a, b)
    heights = [across[0] * x + across[1] * y for x, y in outline.corners]
    low, width = min(heights), max(heights) - min(heights)
    count = min(max(1, -(-width // (spacing * unit))), MOST_LINES)
    path: list[_Met] = []
    for line in range(count):
        met = _line(outline, across, low + (2 * line + 1) * width // (2 * count))
        met.sort(key=lambda each: (along[0] * each[0][0] + along[1] * each[0][1], each[1]), reverse=bool(line % 2))
        for point in met:
            _go(outline, path, point)
    return _distinct([point for point, _ in path])


def _line(outline: Outline, across: Point, height: int) -> list[_Met]:
    """Where the line `across . p = height` enters and leaves the area."""
    met: list[_Met] = []
    for number, (a, b) in enumerate(edges(outline)):
        over_a = across[0] * a[0] + across[1] * a[1] - height
        over_b = across[0] * b[0] + across[1] * b[1] - height
        if (over_a < 0) != (over_b < 0):
            whole = over_a - over_b
            met.append(((_part(a[0], b[0], over_a, whole), _part(a[1], b[1], over_a, whole)), number))
    return met


def _part(a: int, b: int, over: int, whole: int) -> int:
    """`a + (b - a) * over / whole`, to the nearest integer."""
    if whole < 0:
        over, whole = -over, -whole
    return a + (2 * (b - a) * over + whole) // (2 * whole)


def _go(outline: Outline, path: list[_Met], to: _Met) -> None:
    """Go on to a point, straight if that stays in the area, else along the edge, the shorter way round."""
    if path and not _straight(outline, path[-1], to):
        corners, count = outline.corners, len(outline.corners)
        (start, first), (end, last) = path[-1], to
        onward = [corners[(first + 1 + k) % count] for k in range((last - first) % count)]
        back = [corners[(first - k) % count] for k in range((first - last) % count)]
        way = min(onward, back, key=lambda points: path_length([start, *points, end]))
        path += [(point, -1) for point in way]
    path.append(to)


def _straight(outline: Outline, start: _Met, end: _Met) -> bool:
    """Whether the way between two points on the edge is inside: it meets no other edge, and its middle is inside."""
    (p, first), (q, last) = start, end
    if first == last:
        return True
    middle = ((p[0] + q[0]) // 2, (p[1] + q[1]) // 2)
    if not contains(outline.corners, middle):
        return False
    return not any(meet(p, q, *edge) for number, edge in enumerate(edges(outline)) if number not in (first, last))


def _distinct(points: Sequence[Point]) -> list[Point]:
    return [point for number, point in enumerate(points) if number == 0 or points[number - 1] != point]


def _length(a: Point, b: Point) -> int:
    return isqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2)


_PATTERNS: Mapping[str, Callable[[Outline, int], list[Point] | None]] = {
    "grid": _grid,
    "perimeter": _perimeter,
    "orbit": _orbit,
}
