"""Grown and shrunk zones in whole millimetres, rounded to the safe side. The result is the same on every machine.

`inner(shape, margin)` contains only points of the exact offset, and `outer` contains all of them. A positive margin
grows, a negative one shrinks. The edges of a convex zone are moved, and the result is proved. Any other zone is grown
or shrunk by a convolution with a polygon within or around the disc of the margin, smaller or larger by a few mm to
allow for rounding. The result may have several parts and holes.
"""

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from functools import cache, lru_cache
from itertools import pairwise
from math import isqrt

from rtshcua.ground.geometry.overlay import (
    PULLED,
    ROUNDED,
    ROUNDS,
    RoundedBoundary,
    TooManyPieces,
    Windings,
    rounded_boundary,
    without_straight,
)
from rtshcua.ground.geometry.polygons import (
    Point,
    Ring,
    Segment,
    are_apart,
    crossing,
    dot,
    doubled_area,
    is_beyond,
    is_near,
    scaled,
)
from rtshcua.ground.geometry.shapes import Polygonal, RoundArea, Shape, SimplePolygon, contains, edges, parts, polygonal
from rtshcua.model.flat.zone import MAX_RINGS, MAX_VERTICES

#: rounding moves a corner, and so an edge, by at most 0.71 mm
SNAP_MM = 2
MANY_CORNERS = 128
#: largest displacements of an outline by rounding, plus 1 mm, in mm
_SLACKS = (ROUNDED + 1, PULLED + 1, ROUNDS * PULLED + 1)


class NoSuchOffset(Exception):
    """The offset does not exist or cannot be proved. `reason` is `nothing`, `unproved`, `corners` or `far`."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


@lru_cache(maxsize=256)  # programs share zones, and an editor repeats the call at every change
def inner(shape: Shape, margin: int) -> Shape:
    """Return a subset of the points nearer than `margin` to `shape` (negative: farther than it from its outside)."""
    if margin == 0:
        return shape
    if isinstance(shape, RoundArea):
        return _disc(shape, margin)
    if isinstance(shape, SimplePolygon) and is_convex(shape):
        return _convex_inner(shape, margin)
    fine = _fineness(shape)
    if margin > 0:
        if margin <= _SLACKS[-1]:
            return shape
        return _made(lambda slack: _convolved_grown(shape, within_disc((0, 0), margin - slack, fine)))
    return _made(
        lambda slack: _convolved_shrunk(shape, around_disc(slack - margin, fine)),
        lambda made: _clear(made, shape, -margin),
    )


@lru_cache(maxsize=256)
def outer(shape: Shape, margin: int) -> Shape:
    """Return a superset of the points nearer than `margin` to `shape` (negative: farther than it from its outside)."""
    if margin == 0:
        return shape
    if isinstance(shape, RoundArea):
        return _disc(shape, margin)
    if isinstance(shape, SimplePolygon) and is_convex(shape):
        return _convex_outer(shape, margin)
    fine = _fineness(shape)
    if margin > 0:
        return _made(
            lambda slack: _convolved_grown(shape, around_disc(margin + slack, fine)),
            lambda made: _clear(shape, made, margin),
        )
    if -margin <= _SLACKS[-1]:
        return shape
    return _made(lambda slack: _convolved_shrunk(shape, within_disc((0, 0), -margin - slack, fine)))


def _disc(shape: RoundArea, margin: int) -> RoundArea:
    radius = shape.radius + margin
    if radius <= 0:
        raise NoSuchOffset("nothing")
    return RoundArea(shape.center, radius)


def _fineness(shape: Polygonal) -> int:
    """Return how finely the margin's disc is approximated: each corner of a zone may get an arc of it."""
    return COARSE if sum(map(len, shape.rings)) <= MANY_CORNERS else ROUGH


def _made(
    make: Callable[[int], RoundedBoundary | None], proved: Callable[[Polygonal], bool] = lambda _: True
) -> Polygonal:
    """Return the first proved result whose displacement is below the slack with which it was made."""
    for slack in _SLACKS:
        try:
            made = make(slack)
        except TooManyPieces as error:
            raise NoSuchOffset("unproved") from error
        if made is None or made.moved >= slack:
            continue
        if not made.rings:
            raise NoSuchOffset("nothing")
        if len(made.rings) > MAX_RINGS or sum(map(len, made.rings)) > MAX_VERTICES:
            raise NoSuchOffset("corners")
        shape = polygonal(made.rings)
        if proved(shape):
            return shape
    raise NoSuchOffset("unproved")


# --------------------------------------------------------------------------------------------------------- convex


def _convex_inner(shape: SimplePolygon, margin: int) -> SimplePolygon:
    if margin > 0:
        return _search(margin, lambda far: _convex_rounded(shape, far), lambda made: _near(made, shape, margin), -1)
    return _search(-margin, lambda far: _convex_shrunk(shape, far), lambda made: _clear(made, shape, -margin), 1)


def _convex_outer(shape: SimplePolygon, margin: int) -> SimplePolygon:
    if margin > 0:
        return _search(margin, lambda far: _convex_mitred(shape, far), lambda made: _clear(shape, made, margin), 1)
    return _search(-margin, lambda far: _convex_shrunk(shape, far), lambda made: _near(made, shape, -margin), -1)


def _search(
    margin: int, make: Callable[[int], list[Point]], proved: Callable[[SimplePolygon], bool], sign: int
) -> SimplePolygon:
    """Return the first offset, with growing slack, that is proved in integers."""
    for slack in (SNAP_MM, SNAP_MM + margin // 64, SNAP_MM + margin // 16):
        kept = without_straight(make(margin + sign * slack))
        if not kept or doubled_area(kept) == 0:
            raise NoSuchOffset("nothing")
        first = kept.index(min(kept))
        made = SimplePolygon((*kept[first:], *kept[:first]))
        if crossing(made.corners) is None and proved(made):
            return made
    raise NoSuchOffset("unproved")


# ------------------------------------------------------------------------------------------------------- proofs


def _clear(small: Polygonal, large: Polygonal, margin: int) -> bool:
    """Whether `small` lies in `large` and their boundaries are at least `margin` apart everywhere.

    A ring that meets no boundary of the other area lies wholly inside or outside it, so one corner of each is tested.
    """
    if not all(contains(large, ring[0]) for ring in small.rings):
        return False
    if any(contains(small, ring[0]) for ring in large.rings):
        return False
    return all(are_apart(one, other, margin) for one, other in _close_pairs(edges(small), edges(large), margin))


def _near(made: SimplePolygon, shape: SimplePolygon, margin: int) -> bool:
    """Whether each edge of `made` lies within `margin` of an edge of `shape`, because both its ends do."""
    ours, theirs = edges(made), edges(shape)
    proved: set[Segment] = set()
    for one, other in _close_pairs(ours, theirs, margin):
        if one not in proved and is_near(one[0], other, margin) and is_near(one[1], other, margin):
            proved.add(one)
    return len(proved) == len(set(ours))


def _close_pairs(ours: Sequence[Segment], theirs: Sequence[Segment], margin: int) -> Iterator[tuple[Segment, Segment]]:
    """Yield the pairs of edges whose bounding boxes are at most `margin` apart, by a sweep from west to east."""
    waiting = sorted(theirs, key=_west)
    active: list[Segment] = []
    at = 0
    for one in sorted(ours, key=_west):
        (ax, ay), (bx, by) = one
        reach_west, reach_east = min(ax, bx) - margin, max(ax, bx) + margin
        reach_south, reach_north = min(ay, by) - margin, max(ay, by) + margin
        while at < len(waiting) and _west(waiting[at]) <= reach_east:
            active.append(waiting[at])
            at += 1
        active = [edge for edge in active if max(edge[0][0], edge[1][0]) >= reach_west]
        for other in active:
            (_, cy), (_, dy) = other
            if max(cy, dy) >= reach_south and min(cy, dy) <= reach_north and _west(other) <= reach_east:
                yield one, other


def _west(edge: Segment) -> int:
    return min(edge[0][0], edge[1][0])


# ------------------------------------------------------------------------------------------ edges that are moved

#: polygons with more corners are convolved, because cutting takes quadratic time
MOST_CONVEX_CORNERS = 64

#: cosine, in thousandths, of the largest step of an arc: 22.5 degrees
_ARC_STEP = 924

_Exact = tuple[Fraction, Fraction]


def is_convex(outline: SimplePolygon) -> bool:
    """Whether a counter-clockwise outline turns left at each corner, and is small enough for its edges to be moved."""
    if len(outline.corners) > MOST_CONVEX_CORNERS:
        return False
    directions = [(b[0] - a[0], b[1] - a[1]) for a, b in edges(outline)]
    turns = zip(directions, [*directions[1:], directions[0]], strict=True)
    return all(u[0] * v[1] > u[1] * v[0] for u, v in turns)


def _convex_rounded(outline: SimplePolygon, distance: int) -> list[Point]:
    """Return the outline grown by `distance`, with an inscribed arc around each corner."""
    corners: list[Point] = []
    for corner, before, after in _corner_normals(outline, distance):
        corners += [(corner[0] + x, corner[1] + y) for x, y in (before, *_arc(before, after, distance), after)]
    return corners


def _convex_mitred(outline: SimplePolygon, distance: int) -> list[Point]:
    """Return the outline grown by `distance`, with mitred corners; a corner below 90 degrees is cut off."""
    corners: list[Point] = []
    for corner, before, after in _corner_normals(outline, distance):
        normals = [before, after]
        if dot(before, after) < 0:
            normals.insert(1, scaled((before[0] + after[0], before[1] + after[1]), distance))
        for a, b in pairwise(normals):
            share = Fraction(distance * distance, distance * distance + dot(a, b))
            corners.append((corner[0] + round((a[0] + b[0]) * share), corner[1] + round((a[1] + b[1]) * share)))
    return corners


def _convex_shrunk(outline: SimplePolygon, distance: int) -> list[Point]:
    """Return the corners of the region at least `distance` from every edge; none if it is empty."""
    left: list[_Exact] = [(Fraction(x), Fraction(y)) for x, y in outline.corners]
    for (ax, ay), (bx, by) in edges(outline):
        dx, dy = bx - ax, by - ay
        room = isqrt(distance * distance * (dx * dx + dy * dy) - 1) + 1
        left = _cut(left, dx, dy, dx * ay - dy * ax + room)
        if not left:
            return []
    return [(round(x), round(y)) for x, y in left]


def _cut(corners: Sequence[_Exact], dx: int, dy: int, least: int) -> list[_Exact]:
    """Return the part of a convex polygon where `dx * y - dy * x >= least`."""
    kept: list[_Exact] = []
    for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
        over_a, over_b = dx * a[1] - dy * a[0] - least, dx * b[1] - dy * b[0] - least
        if over_a >= 0:
            kept.append(a)
        if (over_a > 0 > over_b) or (over_a < 0 < over_b):
            share = over_a / (over_a - over_b)
            kept.append((a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share))
    return kept


def _corner_normals(outline: SimplePolygon, distance: int) -> Iterator[tuple[Point, Point, Point]]:
    """Yield each corner with the outward normals, of length `distance`, of the edges before and after it."""
    normals = [scaled((b[1] - a[1], a[0] - b[0]), distance) for a, b in edges(outline)]
    return zip(outline.corners, [normals[-1], *normals[:-1]], normals, strict=True)


def _arc(before: Point, after: Point, distance: int, halvings: int = 3) -> list[Point]:
    """Return vectors between two vectors of length `distance`, at most one arc step apart."""
    if not halvings or 1000 * dot(before, after) >= _ARC_STEP * distance * distance:
        return []
    middle = scaled((before[0] + after[0], before[1] + after[1]), distance)
    left, right = _arc(before, middle, distance, halvings - 1), _arc(middle, after, distance, halvings - 1)
    return [*left, middle, *right]


# ----------------------------------------------------------------------------------------------- convolutions


def _convolved_grown(shape: Polygonal, kernel: Ring) -> RoundedBoundary | None:
    """Return the boundary of all points that the kernel reaches from inside the shape; None if none is in whole mm."""
    groups: list[list[list[Point]]] = []
    areas: list[tuple[int, list[int]]] = []
    for outer, holes in parts(shape):
        areas.append((len(groups), []))
        groups.append([_convolution(outer, kernel)])
        for hole in holes:
            if _has_room(hole, kernel):
                areas[-1][1].append(len(groups))
                groups.append([_convolution(hole, kernel)])

    def inside(windings: Windings) -> bool:
        return any(windings[outer] > 0 and all(windings[hole] >= 0 for hole in holes) for outer, holes in areas)

    return rounded_boundary(groups, inside)


def _convolved_shrunk(shape: Polygonal, kernel: Ring) -> RoundedBoundary | None:
    """Return the boundary of all points around which the kernel lies in the shape; None as for `_convolved_grown`."""
    groups: list[list[list[Point]]] = []
    areas: list[tuple[int, list[int]]] = []
    for outer, holes in parts(shape):
        if _has_room(outer, kernel):
            areas.append((len(groups), list(range(len(groups) + 1, len(groups) + 1 + len(holes)))))
            groups += [[_convolution(ring[::-1], kernel)] for ring in (outer, *holes)]

    def inside(windings: Windings) -> bool:
        return any(windings[outer] < 0 and all(windings[hole] <= 0 for hole in holes) for outer, holes in areas)

    return rounded_boundary(groups, inside)


def _has_room(ring: Ring, kernel: Ring) -> bool:
    """Whether a ring is larger than the kernel, so that the kernel might lie in it."""
    return abs(doubled_area(ring)) > doubled_area(kernel)


def _convolution(ring: Ring, kernel: Ring) -> list[Point]:
    """Return the convolution of a ring with a kernel K.

    The curve runs along the ring, with each edge moved by the outermost corner of K. At each corner it runs along K's
    edges, forwards if the ring turns left and backwards if it turns right.

    Its winding around a point x is the number of parts of the ring's inside in x - K (Guibas, Ramshaw, Stolfi: A
    kinetic framework for computational geometry, 1983), where the inside is on the ring's left. K is symmetric, so x -
    K = x + K:

    - For a counter-clockwise ring, x + K meets its inside if the winding is positive. - For a clockwise ring, the
    winding is the number of parts of its *outside* in x + K, minus one. So x + K lies in the
      hole if the winding is negative. If x + K contained the whole hole, the count would be the same, but such a hole
      has no room for K and is skipped.

    A connected set without a point in an area lies in one of its holes, or outside all outer rings. So x + K meets an
    area if it meets the inside of an outer ring and lies in none of that ring's holes. To shrink an area, its
    complement is grown: all rings are reversed.
    """
    count = len(kernel)
    following = (*ring[1:], ring[0])
    directions = [(b[0] - a[0], b[1] - a[1]) for a, b in zip(ring, following, strict=True)]
    outermost = [_outermost(direction, kernel) for direction in directions]
    points: list[Point] = []
    for i, (x, y) in enumerate(ring):
        (ux, uy), (vx, vy) = directions[i - 1], directions[i]
        at, to = outermost[i - 1], outermost[i]
        step = 1 if ux * vy > uy * vx else -1
        points.append((x + kernel[at][0], y + kernel[at][1]))
        while at != to:
            at = (at + step) % count
            points.append((x + kernel[at][0], y + kernel[at][1]))
    return points


def _outermost(direction: Point, kernel: Sequence[Point]) -> int:
    """Return the index of the kernel's corner farthest to the right of a direction; of two, the first."""
    dx, dy = direction
    reach = [dy * x - dx * y for x, y in kernel]
    first = reach.index(max(reach))
    return len(kernel) - 1 if first == 0 and reach[-1] == reach[0] else first


# -------------------------------------------------------------------------------------------- discs as polygons
# The corners come from halving a quarter turn with integer roots, so they are the same on every machine.

#: halvings of a quarter turn: 128 corners; the arc is at most 0.031 % of the radius from its chord
FINE = 5
#: 64 corners: 0.121 %; 16 corners: 1.93 %
COARSE, ROUGH = 4, 2
_SCALE = 1 << 40


def within_disc(center: Point, radius: int, halvings: int = FINE) -> Ring:
    """Return a polygon in a disc, counter-clockwise. An edge is at most 0.031 % of the radius and 2 mm inside."""
    return _moved(_hull([_shrunk(each, radius) for each in _unit_circle(halvings)]), center)


@cache
def around_disc(radius: int, halvings: int = COARSE) -> Ring:
    """Return a polygon around a disc at the origin.

    Its corners are 0.13 % of the radius (2 % if rough) and a few mm outside the disc.
    """
    reach = radius + radius // (800 if halvings > ROUGH else 50) + 2
    while True:
        ring = tuple(_hull([_shrunk(each, reach) for each in _unit_circle(halvings)]))
        if all(is_beyond((0, 0), edge, radius) for edge in pairwise((*ring, ring[0]))):
            return ring
        reach += 1 + radius // 10_000


def _shrunk(unit: Point, radius: int) -> Point:
    """Return a corner on a circle, rounded towards the centre."""
    x, y = abs(unit[0]) * radius // _SCALE, abs(unit[1]) * radius // _SCALE
    return (x if unit[0] >= 0 else -x), (y if unit[1] >= 0 else -y)


@cache
def _unit_circle(halvings: int) -> tuple[Point, ...]:
    """Return the corners of a regular polygon in a circle of radius `_SCALE`, counter-clockwise from east."""
    quarter: list[Point] = [(_SCALE, 0), (0, _SCALE)]
    for _ in range(halvings):
        halved = [quarter[0]]
        for a, b in pairwise(quarter):
            halved += [scaled((a[0] + b[0], a[1] + b[1]), _SCALE), b]
        quarter = halved
    quarter.pop()
    return (
        *quarter,
        *((-y, x) for x, y in quarter),
        *((-x, -y) for x, y in quarter),
        *((y, -x) for x, y in quarter),
    )


def _hull(points: Sequence[Point]) -> list[Point]:
    """Return the strictly convex hull, counter-clockwise (Andrew's monotone chain)."""
    ordered = sorted(set(points))
    if len(ordered) < 3:
        return ordered
    chains: list[list[Point]] = []
    for each in (ordered, ordered[::-1]):
        chain: list[Point] = []
        for point in each:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0:
                chain.pop()
            chain.append(point)
        chains.append(chain[:-1])
    return chains[0] + chains[1]


def _turn(a: Point, b: Point, c: Point) -> int:
    return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])


def _moved(ring: Sequence[Point], by: Point) -> Ring:
    return tuple((x + by[0], y + by[1]) for x, y in ring)
