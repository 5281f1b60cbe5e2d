"""Survey paths: where a `cover` motion flies within an area. Integers only, so the same path comes out everywhere.

The path keeps `inset` mm away from the area's edge. Lines are parallel to the longest edge and at most one flying
height apart, which is what a camera of 53 degrees sees at once; never closer than `LEAST_SPACING` and never more than
`MOST_LINES`. Where the straight way would leave the area, or go over a hole in it, the path follows the edge. A
perimeter is that around the area, not those around its holes. An area in several parts has no path.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache

from rtshcua.ground.geometry.distance import far
from rtshcua.ground.geometry.offset import Unshapely, inner
from rtshcua.ground.geometry.polygons import contained, doubled_area, meet
from rtshcua.ground.geometry.shapes import Disc, Point, Ring, Shape, parts
from rtshcua.ground.geometry.ways import Met, Rings, length, numbered, part, sides, way

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
    """The points of a path in `area`, beginning at the end nearer to `start`; None where the area is too small."""
    try:
        shape = _inset(area, max(inset, LEAST_INSET))
    except Unshapely:
        return None
    if isinstance(shape, Disc):
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
    """An area without what is within `by` mm of its edge; the choices of a mission's parameters ask for the same."""
    return inner(area, -by)


def _regular(center: Point, radius: int) -> tuple[Point, ...]:
    """A regular 16-gon in a circle, rounded towards its centre."""
    x, y = center

    def scaled(part: int) -> int:
        return radius * part // CIRCLE_SCALE if part >= 0 else -(radius * -part // CIRCLE_SCALE)

    return tuple((x + scaled(dx), y + scaled(dy)) for dx, dy in CORNERS)


def _perimeter(rings: Rings, _: int) -> list[Point]:
    """Once around along the edge."""
    return [*rings[0], rings[0][0]]


def _orbit(rings: Rings, _: int) -> list[Point] | None:
    """Once around the centre of the area, on the largest circle within its outer edge; holes must be clear of it."""
    outer, holes = rings[0], rings[1:]
    center = _centroid(outer)
    if not contained((outer,), center):
        return None
    low, high = 0, max(length(center, corner) for corner in outer)
    while high - low > 1:
        middle = (low + high) // 2
        if all(far(center, edge, middle) for edge in sides(outer)):
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
    """Back and forth on parallel lines, evenly spaced over the width of the area."""
    a, b = max(sides(rings[0]), key=lambda edge: length(*edge))
    along = (b[0] - a[0], b[1] - a[1])
    across = (-along[1], along[0])
    unit = length(a, b)
    heights = [across[0] * x + across[1] * y for x, y in rings[0]]
    low, width = min(heights), max(heights) - min(heights)
    count = min(max(1, -(-width // (spacing * unit))), MOST_LINES)
    path: list[Point] = []
    last: Met | None = None
    for line in range(count):
        met = _line(rings, across, low + (2 * line + 1) * width // (2 * count))
        met.sort(key=lambda each: (along[0] * each[0][0] + along[1] * each[0][1], each[1:]), reverse=bool(line % 2))
        for each in met:
            path += [*(() if last is None else way(rings, last, each)), each[0]]
            last = each
    return _distinct(path)


def _line(rings: Rings, across: Point, height: int) -> list[Met]:
    """Where the line `across . p = height` enters and leaves the area."""
    met: list[Met] = []
    for ring, number, (a, b) in numbered(rings):
        over_a = across[0] * a[0] + across[1] * a[1] - height
        over_b = across[0] * b[0] + across[1] * b[1] - height
        if (over_a < 0) != (over_b < 0):
            whole = over_a - over_b
            met.append(((part(a[0], b[0], over_a, whole), part(a[1], b[1], over_a, whole)), ring, number))
    return met


def _distinct(points: Sequence[Point]) -> list[Point]:
    return [point for number, point in enumerate(points) if number == 0 or points[number - 1] != point]


PATTERNS: Mapping[str, Callable[[Rings, int], list[Point] | None]] = {
    "grid": _grid,
    "perimeter": _perimeter,
    "orbit": _orbit,
}
