"""Grown and shrunk zones in whole millimetres, on the safe side.

`inner(shape, margin)` never has a point that the true set lacks, `outer` lacks none that it has; a positive margin
grows, a negative one shrinks. Convex polygons have their edges moved (`convex`), and the result is proved; all others
are grown and shrunk by a polygon that lies within the disc of the margin, or around it (`convolution`), by a few mm
less or more than what rounding may have moved. What may fall into parts or enclose holes does.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache

from rtshcua.ground.geometry import convex, convolution
from rtshcua.ground.geometry.arrangement import TooManyPieces
from rtshcua.ground.geometry.distance import Edge, apart, within
from rtshcua.ground.geometry.overlay import PULLED, ROUNDED, ROUNDS, Outlined, without_straight
from rtshcua.ground.geometry.polygons import crossing, doubled_area
from rtshcua.ground.geometry.rounds import COARSE, ROUGH, around_disc, within_disc
from rtshcua.ground.geometry.shapes import (
    Cornered,
    Disc,
    Outline,
    Point,
    Shape,
    contains,
    cornered,
    edges,
)
from rtshcua.model.flat.zone import MAX_RINGS, MAX_VERTICES

#: rounding moves a corner by at most 0.71 mm, hence an edge too
SNAP_MM = 2
MANY_CORNERS = 128
#: what an outline may have been moved by, and a millimetre more, mm
_SLACKS = (ROUNDED + 1, PULLED + 1, ROUNDS * PULLED + 1)


class Unshapely(Exception):
    """There is no such zone: `reason` is `nothing`, `unproved`, `corners`, or `far`."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


@lru_cache(maxsize=256)  # programs share zones, and an editor asks again at every change
def inner(shape: Shape, margin: int) -> Shape:
    """A region within the points nearer than `margin` to `shape` (or, negative, further than that from its outside)."""
    if margin == 0:
        return shape
    if isinstance(shape, Disc):
        return _disc(shape, margin)
    if _is_convex(shape):
        return _convex_inner(shape, margin)
    fine = _fineness(shape)
    if margin > 0:
        if margin <= _SLACKS[-1]:
            return shape
        return _made(lambda slack: convolution.grown(shape, within_disc((0, 0), margin - slack, fine)))
    return _made(
        lambda slack: convolution.shrunk(shape, around_disc(slack - margin, fine)),
        lambda made: _clear(made, shape, -margin),
    )


@lru_cache(maxsize=256)
def outer(shape: Shape, margin: int) -> Shape:
    """A region around the points nearer than `margin` to `shape` (or, negative, further than that from its outside)."""
    if margin == 0:
        return shape
    if isinstance(shape, Disc):
        return _disc(shape, margin)
    if _is_convex(shape):
        return _convex_outer(shape, margin)
    fine = _fineness(shape)
    if margin > 0:
        return _made(
            lambda slack: convolution.grown(shape, around_disc(margin + slack, fine)),
            lambda made: _clear(shape, made, margin),
        )
    if -margin <= _SLACKS[-1]:
        return shape
    return _made(lambda slack: convolution.shrunk(shape, within_disc((0, 0), -margin - slack, fine)))


def _disc(shape: Disc, margin: int) -> Disc:
    radius = shape.radius + margin
    if radius <= 0:
        raise Unshapely("nothing")
    return Disc(shape.center, radius)


def _fineness(shape: Cornered) -> int:
    """How fine the margin's disc is drawn: every corner of a zone may get an arc of it."""
    return COARSE if sum(map(len, shape.rings)) <= MANY_CORNERS else ROUGH


def _made(make: Callable[[int], Outlined | None], proved: Callable[[Cornered], bool] = lambda _: True) -> Cornered:
    """The first result that was moved by less than the slack that it was made with, and is proved."""
    for slack in _SLACKS:
        try:
            made = make(slack)
        except TooManyPieces as error:
            raise Unshapely("unproved") from error
        if made is None or made.moved >= slack:
            continue
        if not made.rings:
            raise Unshapely("nothing")
        if len(made.rings) > MAX_RINGS or sum(map(len, made.rings)) > MAX_VERTICES:
            raise Unshapely("corners")
        shape = cornered(made.rings)
        if proved(shape):
            return shape
    raise Unshapely("unproved")


# --------------------------------------------------------------------------------------------------------- convex


def _is_convex(shape: Cornered) -> bool:
    return isinstance(shape, Outline) and convex.is_convex(shape)


def _convex_inner(shape: Cornered, margin: int) -> Outline:
    assert isinstance(shape, Outline)
    if margin > 0:
        return _search(margin, lambda far: convex.rounded(shape, far), lambda made: _near(made, shape, margin), -1)
    return _search(-margin, lambda far: convex.shrunk(shape, far), lambda made: _clear(made, shape, -margin), 1)


def _convex_outer(shape: Cornered, margin: int) -> Outline:
    assert isinstance(shape, Outline)
    if margin > 0:
        return _search(margin, lambda far: convex.mitred(shape, far), lambda made: _clear(shape, made, margin), 1)
    return _search(-margin, lambda far: convex.shrunk(shape, far), lambda made: _near(made, shape, -margin), -1)


def _search(margin: int, make: Callable[[int], list[Point]], proved: Callable[[Outline], bool], sign: int) -> Outline:
    """The first offset, of growing slack, that integers prove."""
    for slack in (SNAP_MM, SNAP_MM + margin // 64, SNAP_MM + margin // 16):
        kept = without_straight(make(margin + sign * slack))
        if not kept or doubled_area(kept) == 0:
            raise Unshapely("nothing")
        first = kept.index(min(kept))
        made = Outline((*kept[first:], *kept[:first]))
        if crossing(made.corners) is None and proved(made):
            return made
    raise Unshapely("unproved")


# ------------------------------------------------------------------------------------------------------- proofs


def _clear(small: Cornered, large: Cornered, margin: int) -> bool:
    """Whether `small` lies in `large` and their boundaries are at least `margin` apart everywhere.

    A ring that meets no boundary of the other area is all inside of it or all outside, so one corner of each tells.
    """
    if not all(contains(large, ring[0]) for ring in small.rings):
        return False
    if any(contains(small, ring[0]) for ring in large.rings):
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
