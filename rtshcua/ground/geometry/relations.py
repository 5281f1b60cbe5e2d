"""Whether one region lies within another, or has no point in common with it. Exact: integers and fractions.

The rings of two areas part the plane into faces; each face is wholly inside an area or wholly outside.
"""

from collections.abc import Iterator
from functools import lru_cache

from rtshcua.ground.geometry.arrangement import TooManyPieces, faces
from rtshcua.ground.geometry.distance import far
from rtshcua.ground.geometry.shapes import Cornered, Disc, Region, Shape, bounds, contains, corners, edges
from rtshcua.ground.geometry.vectors import square


def lies_within(inner: Region, outer: Region, *, surely: bool = True) -> bool:
    """Whether every point of the open set `inner` is one of `outer`; a common boundary does no harm.

    Surely: whatever the elevation of home; else with some. Times do not count.
    """
    if not _above(inner.floor, outer.floor, inner.floor_within, outer.floor_within, surely):
        return False
    if not _above(outer.ceiling, inner.ceiling, outer.ceiling_within, inner.ceiling_within, surely):
        return False
    (w, s, e, n), (west, south, east, north) = bounds(inner.shape), bounds(outer.shape)
    if w < west or s < south or e > east or n > north:
        return False
    return _flat_within(inner.shape, outer.shape, surely)


def _above(high: int, low: int, high_within: int, low_within: int, surely: bool) -> bool:
    """Whether one height is at least another; two that hang on the elevation of home are moved by the same error."""
    slack = 0 if high_within and low_within else high_within + low_within
    return high - slack >= low if surely else high + slack >= low


@lru_cache(maxsize=1024)  # programs share zones, and an editor asks again at every change
def _flat_within(inner: Shape, outer: Shape, surely: bool) -> bool:
    if isinstance(outer, Disc):
        if isinstance(inner, Disc):
            room = outer.radius - inner.radius
            return room >= 0 and square(inner.center, outer.center) <= room * room
        return all(square(corner, outer.center) <= outer.radius * outer.radius for corner in corners(inner))
    if isinstance(inner, Disc):
        return contains(outer, inner.center) and all(far(inner.center, edge, inner.radius) for edge in edges(outer))
    try:
        return not any(first and not second for first, second in _sides(inner, outer))
    except TooManyPieces:
        return not surely


def have_nothing_in_common(one: Region, other: Region, *, surely: bool = True) -> bool:
    """Whether two open sets are disjoint; touching boundaries do no harm. `surely` as above."""
    if _above(one.floor, other.ceiling, one.floor_within, other.ceiling_within, surely):
        return True
    if _above(other.floor, one.ceiling, other.floor_within, one.ceiling_within, surely):
        return True
    (w, s, e, n), (west, south, east, north) = bounds(one.shape), bounds(other.shape)
    if w >= east or e <= west or s >= north or n <= south:
        return True
    return _flat_disjoint(one.shape, other.shape, surely)


@lru_cache(maxsize=1024)
def _flat_disjoint(one: Shape, other: Shape, surely: bool) -> bool:
    if isinstance(one, Disc):
        if isinstance(other, Disc):
            reach = one.radius + other.radius
            return square(one.center, other.center) >= reach * reach
        return not contains(other, one.center) and all(far(one.center, edge, one.radius) for edge in edges(other))
    if isinstance(other, Disc):
        return _flat_disjoint(other, one, surely)
    try:
        return not any(first and second for first, second in _sides(one, other))
    except TooManyPieces:
        return not surely


def _sides(one: Cornered, other: Cornered) -> Iterator[tuple[bool, bool]]:
    """For each face: whether it belongs to either area."""
    return ((first > 0, second > 0) for first, second in faces((one.rings, other.rings)))
