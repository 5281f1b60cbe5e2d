"""Zones in the local plane while they are compiled, in mm, and exact tests whether one contains or misses another.

The tests use integers and fractions. The rings of two areas divide the plane into faces, and each face lies wholly
inside or outside each area.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from math import isqrt

from rtshcua.decision.outline import rings as outline
from rtshcua.ground.geometry.overlay import TooManyPieces, faces
from rtshcua.ground.geometry.polygons import Point, Ring, contained, doubled_area, is_beyond, sides, square
from rtshcua.model.flat.zone import AREA, CIRCLE, HIGHEST, LOWEST, POLYGON, Zone


@dataclass(frozen=True, slots=True)
class RoundArea:
    """All points nearer to `center` than `radius`."""

    center: Point
    radius: int


@dataclass(frozen=True, slots=True)
class SimplePolygon:
    """The inside of a simple polygon, counter-clockwise."""

    corners: Ring

    @property
    def rings(self) -> tuple[Ring, ...]:
        """The single ring."""
        return (self.corners,)


@dataclass(frozen=True, slots=True)
class MultiPolygon:
    """The area inside outer rings (counter-clockwise) and outside holes (clockwise).

    The rings are simple and have no common point.
    """

    rings: tuple[Ring, ...]


Polygonal = SimplePolygon | MultiPolygon
Shape = RoundArea | SimplePolygon | MultiPolygon


@dataclass(frozen=True, slots=True)
class Region:
    """A shape with its floor and ceiling, in mm above home, and its times as in `Zone`.

    A floor or ceiling above sea level is computed from the declared elevation of home. `floor_within` and
    `ceiling_within` are its largest error. The error is the same for all zones of a vehicle.
    """

    shape: Shape
    floor: int
    ceiling: int
    floor_within: int = 0
    ceiling_within: int = 0
    daily: tuple[int, ...] = ()
    dates: tuple[int, ...] = ()
    weekly: tuple[int, ...] = ()

    def flat(self, name: str) -> Zone:
        """Return the region in the flat form."""
        kind, data = _flat(self.shape)
        return Zone(name, kind, self.floor, self.ceiling, data, self.daily, self.dates, self.weekly)

    def sure(self) -> bool:
        """Whether the floor and the ceiling are known exactly."""
        return not self.floor_within and not self.ceiling_within

    def banded(self, *, smaller: bool) -> "Region | None":
        """Return the band that the region certainly contains (`smaller`) or that certainly contains it, or None."""
        sign = 1 if smaller else -1
        floor = self.floor + sign * self.floor_within
        ceiling = self.ceiling - sign * self.ceiling_within
        floor, ceiling = max(floor, LOWEST), min(ceiling, HIGHEST)
        if floor >= ceiling:
            return None
        return Region(self.shape, floor, ceiling, daily=self.daily, dates=self.dates, weekly=self.weekly)


def _flat(shape: Shape) -> tuple[int, tuple[int, ...]]:
    """Return the kind of a shape and its numbers, as in `Zone`."""
    if isinstance(shape, RoundArea):
        return CIRCLE, (*shape.center, shape.radius * shape.radius)
    coordinates = tuple(c for corner in corners(shape) for c in corner)
    if isinstance(shape, SimplePolygon):
        return POLYGON, coordinates
    return AREA, (len(shape.rings), *map(len, shape.rings), *coordinates)


def shape_of(zone: Zone) -> Shape | None:
    """Return the shape of a flat zone; None for a circle whose radius is not a whole number of mm."""
    if zone.shape != CIRCLE:
        return polygonal(tuple(outline(zone)))
    x, y, square = zone.data
    radius = isqrt(square)
    return RoundArea((x, y), radius) if radius * radius == square else None


def polygonal(rings: tuple[Ring, ...]) -> Polygonal:
    """Return the shape bounded by rings."""
    return SimplePolygon(rings[0]) if len(rings) == 1 else MultiPolygon(rings)


def contains(shape: Polygonal, point: Point) -> bool:
    """Whether a point is strictly inside."""
    return contained(shape.rings, point)


def edges(shape: Polygonal) -> list[tuple[Point, Point]]:
    """Return the edges of all rings, from each corner to the next. The inside is on their left."""
    return [edge for ring in shape.rings for edge in sides(ring)]


def corners(shape: Polygonal) -> Iterator[Point]:
    """Yield the corners of all rings."""
    return (corner for ring in shape.rings for corner in ring)


def parts(shape: Polygonal) -> list[tuple[Ring, tuple[Ring, ...]]]:
    """Return each outer ring with the holes directly in it."""
    outer = [ring for ring in shape.rings if doubled_area(ring) > 0]
    around = sorted(outer, key=doubled_area)  # a hole belongs to the smallest outer ring around it
    holes: dict[Ring, list[Ring]] = {ring: [] for ring in outer}
    for ring in shape.rings:
        if doubled_area(ring) < 0:
            holes[next(each for each in around if contained((each,), ring[0]))].append(ring)
    return [(ring, tuple(holes[ring])) for ring in outer]


def bounds(shape: Shape) -> tuple[int, int, int, int]:
    """Return west, south, east and north."""
    if isinstance(shape, RoundArea):
        (x, y), r = shape.center, shape.radius
        return x - r, y - r, x + r, y + r
    xs, ys = zip(*corners(shape), strict=True)
    return min(xs), min(ys), max(xs), max(ys)


def lies_within(inner: Region, outer: Region, *, surely: bool = True) -> bool:
    """Whether the open set `inner` is a subset of `outer`. A common boundary is allowed.

    With `surely` this holds for every possible elevation of home, else for some elevation. Times are ignored.
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
    """Whether one height is at least another. Two heights that depend on the elevation of home have the same error."""
    slack = 0 if high_within and low_within else high_within + low_within
    return high - slack >= low if surely else high + slack >= low


@lru_cache(maxsize=1024)  # programs share zones, and an editor repeats the call at every change
def _flat_within(inner: Shape, outer: Shape, surely: bool) -> bool:
    if isinstance(outer, RoundArea):
        if isinstance(inner, RoundArea):
            room = outer.radius - inner.radius
            return room >= 0 and square(inner.center, outer.center) <= room * room
        return all(square(corner, outer.center) <= outer.radius * outer.radius for corner in corners(inner))
    if isinstance(inner, RoundArea):
        return contains(outer, inner.center) and all(
            is_beyond(inner.center, edge, inner.radius) for edge in edges(outer)
        )
    try:
        return not any(first and not second for first, second in _sides(inner, outer))
    except TooManyPieces:
        return not surely


def are_disjoint(one: Region, other: Region, *, surely: bool = True) -> bool:
    """Whether two open sets are disjoint. Touching boundaries are allowed. `surely` is as for `lies_within`."""
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
    if isinstance(one, RoundArea):
        if isinstance(other, RoundArea):
            reach = one.radius + other.radius
            return square(one.center, other.center) >= reach * reach
        return not contains(other, one.center) and all(is_beyond(one.center, edge, one.radius) for edge in edges(other))
    if isinstance(other, RoundArea):
        return _flat_disjoint(other, one, surely)
    try:
        return not any(first and second for first, second in _sides(one, other))
    except TooManyPieces:
        return not surely


def _sides(one: Polygonal, other: Polygonal) -> Iterator[tuple[bool, bool]]:
    """Yield for each face whether it belongs to the first area, and whether it belongs to the second."""
    return ((first > 0, second > 0) for first, second in faces((one.rings, other.rings)))
