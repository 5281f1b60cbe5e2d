"""Grown and shrunk zones, snapped to whole millimetres on the safe side.

`inner(shape, margin)` never has a point that the true set lacks, `outer` lacks none that it has; a positive margin
grows, a negative one shrinks. Convex polygons are offset in integers, all others by shapely (floats, whose corners are
rounded); either way the result is proved in integers, with more slack where the proof fails.
"""

from collections.abc import Callable, Iterator, Sequence

from rtshcua.ground.checker.polygons import contains, counter_clockwise, crossing, doubled_area
from rtshcua.ground.compiler import convex
from rtshcua.ground.compiler.distance import Edge, apart, within
from rtshcua.ground.compiler.shapes import Disc, Outline, Point, Shape, edges

#: corners that a round corner of a quarter turn gets
QUARTER = 4
MITRE_LIMIT = 2.0
#: rounding moves a corner by at most 0.71 mm, hence an edge too
SNAP_MM = 2


class Unshapely(Exception):
    """The result is no simple polygon: `reason` is `nothing`, `parts`, `holes`, `unproved`, or `far`."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


def inner(shape: Shape, margin: int) -> Shape:
    """A region within the points nearer than `margin` to `shape` (or, negative, further than that from its outside)."""
    if margin == 0:
        return shape
    if isinstance(shape, Disc):
        return _disc(shape, margin)
    if margin > 0:
        return _search(shape, lambda slack: (margin - slack, "round"), lambda made: _near(made, shape, margin))
    return _search(shape, lambda slack: (margin - slack, "mitre"), lambda made: _clear(made, shape, -margin, shape))


def outer(shape: Shape, margin: int) -> Shape:
    """A region around the points nearer than `margin` to `shape` (or, negative, further than that from its outside)."""
    if margin == 0:
        return shape
    if isinstance(shape, Disc):
        return _disc(shape, margin)
    if margin > 0:
        return _search(
            shape, lambda slack: (margin + slack, "mitre"), lambda made: _clear(shape, made, margin, made), fill=True
        )
    return _search(shape, lambda slack: (margin + slack, "round"), lambda made: _near(made, shape, -margin))


def _disc(shape: Disc, margin: int) -> Disc:
    radius = shape.radius + margin
    if radius <= 0:
        raise Unshapely("nothing")
    return Disc(shape.center, radius)


def _search(
    shape: Outline,
    settings: Callable[[int], tuple[int, str]],
    proved: Callable[[Outline], bool],
    *,
    fill: bool = False,
) -> Outline:
    """The first offset, of growing slack, that integers prove; GEOS simplifies its input by up to a hundredth."""
    margin = abs(settings(0)[0])
    for slack in (SNAP_MM, SNAP_MM + margin // 64, SNAP_MM + margin // 16):
        made = _offset(shape, *settings(slack), fill=fill)
        if crossing(made.corners) is None and proved(made):
            return made
    raise Unshapely("unproved")


def _offset(shape: Outline, distance: int, join: str, *, fill: bool) -> Outline:
    """The polygon grown or shrunk by `distance`, its corners rounded to whole millimetres."""
    if not convex.is_convex(shape):
        return _buffered(shape, distance, join, fill=fill)
    if distance < 0:
        return _outline(convex.shrunk(shape, -distance))
    return _outline(convex.rounded(shape, distance) if join == "round" else convex.mitred(shape, distance))


def _buffered(shape: Outline, distance: int, join: str, *, fill: bool) -> Outline:
    """Shapely's buffer."""
    import shapely  # noqa: PLC0415  a third of a second, for the few sources that need it

    made = shapely.Polygon(shape.corners).buffer(distance, quad_segs=QUARTER, join_style=join, mitre_limit=MITRE_LIMIT)
    if made.is_empty:
        raise Unshapely("nothing")
    if made.geom_type != "Polygon":
        raise Unshapely("parts")
    if made.interiors and not fill:
        raise Unshapely("holes")
    return _outline([(round(x), round(y)) for x, y in made.exterior.coords[:-1]])


def _outline(corners: Sequence[Point]) -> Outline:
    kept = _without_straight(corners)
    if len(kept) < 3 or doubled_area(kept) == 0:
        raise Unshapely("nothing")
    turned = counter_clockwise(kept)
    first = turned.index(min(turned))
    return Outline((*turned[first:], *turned[:first]))


def _without_straight(corners: Sequence[Point]) -> list[Point]:
    """The corners without repetitions, and without those on a straight line between their neighbours."""
    kept: list[Point] = []
    for corner in corners:
        if not kept or kept[-1] != corner:
            kept.append(corner)
    while len(kept) > 1 and kept[0] == kept[-1]:
        kept.pop()
    if len(kept) < 3:
        return kept
    return [
        b
        for a, b, c in zip([kept[-1], *kept[:-1]], kept, [*kept[1:], kept[0]], strict=True)
        if (b[0] - a[0]) * (c[1] - b[1]) != (b[1] - a[1]) * (c[0] - b[0])
    ]


def _clear(small: Outline, large: Outline, margin: int, around: Outline) -> bool:
    """Whether `small` lies in `large` and their boundaries are at least `margin` apart everywhere."""
    if not contains(around.corners, small.corners[0]):
        return False
    return all(apart(one, other, margin) for one, other in _close_pairs(edges(small), edges(large), margin))


def _near(made: Outline, shape: Outline, margin: int) -> bool:
    """Whether each edge of `made` has both its ends within `margin` of one edge of `shape`, hence all of it."""
    ours, theirs = edges(made), edges(shape)
    proved: set[Edge] = set()
    for one, other in _close_pairs(ours, theirs, margin):
        if one not in proved and within(one[0], other, margin) and within(one[1], other, margin):
            proved.add(one)
    return len(proved) == len(set(ours))


def _close_pairs(ours: Sequence[Edge], theirs: Sequence[Edge], margin: int) -> Iterator[tuple[Edge, Edge]]:
    """The pairs of edges whose extents are at most `margin` apart: a sweep from west to east."""
    waiting = sorted(theirs, key=_west)
    active: list[Edge] = []
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


def _west(edge: Edge) -> int:
    return min(edge[0][0], edge[1][0])
