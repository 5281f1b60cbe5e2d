"""Survey paths: the path of a `cover` motion in an area, in integers, so that it is the same on every machine.

The path stays `inset` mm away from the area's edge. Lines of a grid are parallel to the longest edge. Without a camera
they are at most one flying height apart, which is the view of a camera of 53 degrees, but at least `LEAST_SPACING`;
with one, the caller gives the spacing that its overlap needs (`docs/survey.md`). There are at most `MOST_LINES`. If the
straight line would leave the area or cross a hole, the path follows the edge. A perimeter runs around the area but not
around its holes. An area in several parts has no path.

Patterns along a line (`LINE_PATTERNS`) need the centre line of a corridor, and the pattern around a structure needs an
area with one hole.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

from rtshcua.ground.geometry.inspection import CentreLine, face_scan, line_count, orbit, parallel_lines, reach_of
from rtshcua.ground.geometry.offset import NoSuchOffset, inner
from rtshcua.ground.geometry.polygons import (
    Point,
    Ring,
    Segment,
    contained,
    doubled_area,
    interpolate,
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


LEAST_SPACING = 5_000  # mm, without a camera
ROUNDING = 2  # mm, of the distance of two lines whose ends are rounded
LEAST_INSET = 1_000  # mm
MOST_LINES = 256
DEFAULT_PATTERN = "grid"
ORBIT_LEGS = 16

#: corners of a regular 16-gon on a circle of radius 2**20, counter-clockwise from east
CIRCLE_SCALE = 1 << 20
_QUARTER = ((1048576, 0), (968758, 401273), (741455, 741455), (401273, 968758))
CORNERS = (
    *((x, y) for x, y in _QUARTER),
    *((-y, x) for x, y in _QUARTER),
    *((-x, -y) for x, y in _QUARTER),
    *((y, -x) for x, y in _QUARTER),
)


class PathAim(NamedTuple):
    """The centre line of the area, if it is a corridor; the distance in mm at which a structure is passed; and the
    greatest distance of neighbouring lines in mm by which a camera keeps its overlap, or 0 if none is stated.
    """

    line: CentreLine | None = None
    distance: int = 0
    spacing: int = 0


NO_AIM = PathAim()


def survey(
    area: Shape, pattern: str, spacing: int, inset: int, start: Point | None, aim: PathAim = NO_AIM
) -> tuple[Point, ...] | None:
    """Return the points of a path in `area`, beginning at the end nearer to `start`; None if the area is too small.

    Lines are at most `spacing` mm apart but at least `LEAST_SPACING`, or at most `aim.spacing` where that is stated, as
    far as `MOST_LINES` allows (`line_spacing`). There is no path where `aim` or the area lacks what a pattern needs.
    """
    rings = _room(area, inset)
    if rings is None:
        return None
    if pattern in PATTERNS:
        points = PATTERNS[pattern](rings, _gap(spacing, aim))
    else:
        points = _aimed(area, rings, pattern, _gap(spacing, aim), max(inset, LEAST_INSET), aim)
    if points is not None and start is not None and length(points[-1], start) < length(points[0], start):
        points.reverse()
    return None if points is None else tuple(points)


def line_spacing(area: Shape, pattern: str, spacing: int, inset: int, aim: PathAim = NO_AIM) -> int | None:
    """Return the real distance of neighbouring lines of a path in mm, rounded up; None if it has no parallel lines."""
    gap, rings = _gap(spacing, aim), _room(area, inset)
    if pattern == "grid" and rings is not None:
        frame = _frame(rings, gap)
        width, count = -(-frame.width // frame.unit), frame.lines
    elif pattern == "corridor" and aim.line is not None:
        room = aim.line.half - max(inset, LEAST_INSET)
        width, count = 2 * room, line_count(room, gap, MOST_LINES)
    else:
        return None
    return -(-width // count) + ROUNDING if count > 1 else None


def likely_spacings(area: Shape, inset: int, begin: Point) -> tuple[int, ...]:
    """Return the spacings (`PathAim.spacing`) by which a grid over an area may begin at a point, the likeliest first.

    The first line of a grid, or the last one of a reversed path, is half a spacing inside.
    """
    rings = _room(area, inset)
    if rings is None:
        return ()
    frame = _frame(rings, LEAST_SPACING)
    over = frame.across[0] * begin[0] + frame.across[1] * begin[1] - frame.low
    inside = max(min(over, frame.width - over), 1)
    lines = (frame.width + inside) // (2 * inside)
    counts = [count for count in (lines, lines - 1, lines + 1) if 0 < count <= MOST_LINES]
    return tuple(-(-frame.width // (count * frame.unit)) + ROUNDING for count in counts)


def _gap(spacing: int, aim: PathAim) -> int:
    """Return the greatest distance of lines before their ends are rounded."""
    return max(aim.spacing - ROUNDING, 1) if aim.spacing else max(spacing, LEAST_SPACING)


def _room(area: Shape, inset: int) -> Rings | None:
    """Return the rings of an area less its edge; None if nothing or several parts remain."""
    try:
        shape = _inset(area, max(inset, LEAST_INSET))
    except NoSuchOffset:
        return None
    if isinstance(shape, RoundArea):
        return (_regular(shape.center, shape.radius),)
    found = parts(shape)
    return (found[0][0], *found[0][1]) if len(found) == 1 else None


def _aimed(area: Shape, rings: Rings, pattern: str, spacing: int, inset: int, aim: PathAim) -> list[Point] | None:
    """Return the path of a pattern that looks at a line or a structure, if it stays in the area."""
    line = aim.line
    if pattern == AROUND:
        hole = structure_of(area)
        path = [] if hole is None else _around(hole, aim.distance)
    elif line is None:
        return None
    elif pattern == "corridor":
        lines = parallel_lines(line, inset, spacing, MOST_LINES)
        path = [point for each in lines or () for point in each]
    else:
        path = [(x, y) for x, y, _, _ in face_scan((line.points[0], line.points[-1]), aim.distance, (0,))]
        path = path if len(line.points) == 2 and inset + aim.distance <= line.half else []
    path = _distinct(path)
    if pattern == AROUND and not _stays(rings, path):
        return None
    return path or None


def _around(hole: Ring, distance: int) -> list[Point]:
    """Return a round at a distance from the circle that encloses a structure."""
    centre = _centroid(hole)
    return [(x, y) for x, y, _, _ in orbit(centre, reach_of(hole, centre) + distance, (0,), ORBIT_LEGS)]


def around_reach(hole: Ring, distance: int) -> int:
    """Return the greatest distance in mm at which a round sees a structure in the middle of its view."""
    centre = _centroid(hole)
    farthest = max(length(centre, point) + 1 for point in _around(hole, distance))
    return farthest - _clearance(centre, hole)


def structure_of(area: Shape) -> Ring | None:
    """Return the one hole of an area, counter-clockwise; None if it has none or several."""
    found = [] if isinstance(area, RoundArea) else parts(area)
    return tuple(reversed(found[0][1][0])) if len(found) == 1 and len(found[0][1]) == 1 else None


def _stays(rings: Rings, path: Sequence[Point]) -> bool:
    """Whether a path stays in an area."""
    return all(contained(rings, point) for point in path) and not any(
        meet(*leg, *edge) for ring in rings for edge in sides(ring) for leg in pairwise(path)
    )


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
    radius = _clearance(center, outer)
    circle = _regular(center, radius)
    if radius < LEAST_INSET or any(contained((hole,), circle[0]) for hole in holes):
        return None
    if any(meet(*leg, *edge) for hole in holes for edge in sides(hole) for leg in sides(circle)):
        return None
    return [*circle, circle[0]]


def _clearance(center: Point, ring: Ring) -> int:
    """Return the distance from a point to the nearest edge of a ring, rounded down."""
    low, high = 0, max(length(center, corner) for corner in ring)
    while high - low > 1:
        middle = (low + high) // 2
        if all(is_beyond(center, edge, middle) for edge in sides(ring)):
            low = middle
        else:
            high = middle
    return low


def _centroid(ring: Ring) -> Point:
    sums = [0, 0]
    for (ax, ay), (bx, by) in sides(ring):
        cross = ax * by - bx * ay
        sums[0] += (ax + bx) * cross
        sums[1] += (ay + by) * cross
    area = 3 * doubled_area(ring)
    return sums[0] // area, sums[1] // area


class GridFrame(NamedTuple):
    """The parallel lines of a grid: their direction, the direction across, where the area begins, and its width.

    `low` and `width` are inner products with `across`, whose length is `unit`, rounded down.
    """

    along: Point
    across: Point
    low: int
    width: int
    unit: int
    lines: int


def _frame(rings: Rings, spacing: int) -> GridFrame:
    """Return the lines of a grid, evenly spaced over the width of the area."""
    a, b = max(sides(rings[0]), key=lambda edge: length(*edge))
    along = (b[0] - a[0], b[1] - a[1])
    across = (-along[1], along[0])
    unit = length(a, b)
    heights = [across[0] * x + across[1] * y for x, y in rings[0]]
    low, width = min(heights), max(heights) - min(heights)
    return GridFrame(along, across, low, width, unit, min(max(1, -(-width // (spacing * unit))), MOST_LINES))


def _grid(rings: Rings, spacing: int) -> list[Point]:
    """Return a path back and forth on parallel lines."""
    along, across, low, width, _, lines = _frame(rings, spacing)
    path: list[Point] = []
    last: EdgePoint | None = None
    for line in range(lines):
        met = _line(rings, across, low + (2 * line + 1) * width // (2 * lines))
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
#: patterns along the centre line of a corridor
LINE_PATTERNS = ("corridor", "face")
#: the pattern around the structure in the hole of an area
AROUND = "around"
#: all patterns
ALL_PATTERNS = (*PATTERNS, *LINE_PATTERNS, AROUND)
#: patterns that look sideways at a structure; the others look down
SIDEWAYS = ("face", AROUND)
