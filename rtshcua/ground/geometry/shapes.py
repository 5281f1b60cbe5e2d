"""Zones of the local plane while they are compiled, in mm: circles by their radius, all others by their corners; and
whether one lies within another or is disjoint from it.

Exact: integers and fractions. The rings of two areas part the plane into faces; each face is wholly inside an area or
wholly outside.
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
        """Its one ring."""
        return (self.corners,)


@dataclass(frozen=True, slots=True)
class MultiPolygon:
    """What lies inside of outer rings (counter-clockwise) and outside of holes (clockwise); the rings are simple and
    have no point in common.
    """

    rings: tuple[Ring, ...]


Polygonal = SimplePolygon | MultiPolygon
Shape = RoundArea | SimplePolygon | MultiPolygon


@dataclass(frozen=True, slots=True)
class Region:
    """A shape with its floor and ceiling, in mm above home, and its times as `Zone` has them.

    A floor or ceiling above sea is where the declared elevation of home puts it; `floor_within` and `ceiling_within`
    say how far it may really be from there. All of one vehicle's bands are moved by the same error.
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
        """The region as it is carried on board."""
        kind, data = _flat(self.shape)
        return Zone(name, kind, self.floor, self.ceiling, data, self.daily, self.dates, self.weekly)

    def sure(self) -> bool:
        """Whether its floor and ceiling are known exactly."""
        return not self.floor_within and not self.ceiling_within

    def banded(self, *, smaller: bool) -> "Region | None":
        """The band that is surely part of the region, or the one that it surely is part of; None where none is."""
        sign = 1 if smaller else -1
        floor = self.floor + sign * self.floor_within
        ceiling = self.ceiling - sign * self.ceiling_within
        floor, ceiling = max(floor, LOWEST), min(ceiling, HIGHEST)
        if floor >= ceiling:
            return None
        return Region(self.shape, floor, ceiling, daily=self.daily, dates=self.dates, weekly=self.weekly)


def _flat(shape: Shape) -> tuple[int, tuple[int, ...]]:
    """The kind of a shape and its numbers, as `Zone` has them."""
    if isinstance(shape, RoundArea):
        return CIRCLE, (*shape.center, shape.radius * shape.radius)
    coordinates = tuple(c for corner in corners(shape) for c in corner)
    if isinstance(shape, SimplePolygon):
        return POLYGON, coordinates
    return AREA, (len(shape.rings), *map(len, shape.rings), *coordinates)


def shape_of(zone: Zone) -> Shape | None:
    """The shape of a zone as it is carried on board; None for a circle whose radius is no whole number of mm."""
    if zone.shape != CIRCLE:
        return polygonal(tuple(outline(zone)))
    x, y, square = zone.data
    radius = isqrt(square)
    return RoundArea((x, y), radius) if radius * radius == square else None


def polygonal(rings: tuple[Ring, ...]) -> Polygonal:
    """The shape that some rings are the boundary of."""
    return SimplePolygon(rings[0]) if len(rings) == 1 else MultiPolygon(rings)


def contains(shape: Polygonal, point: Point) -> bool:
    """Whether a point is strictly inside."""
    return contained(shape.rings, point)


def edges(shape: Polygonal) -> list[tuple[Point, Point]]:
    """The edges of all rings, from each corner to the next; the inside is on their left."""
    return [edge for ring in shape.rings for edge in sides(ring)]


def corners(shape: Polygonal) -> Iterator[Point]:
    """The corners of all rings."""
    return (corner for ring in shape.rings for corner in ring)


def parts(shape: Polygonal) -> list[tuple[Ring, tuple[Ring, ...]]]:
    """Each outer ring with the holes that lie directly in it."""
    outer = [ring for ring in shape.rings if doubled_area(ring) > 0]
    around = sorted(outer, key=doubled_area)  # the smallest outer ring around a hole is the one that it is a hole of
    holes: dict[Ring, list[Ring]] = {ring: [] for ring in outer}
    for ring in shape.rings:
        if doubled_area(ring) < 0:
            holes[next(each for each in around if contained((each,), ring[0]))].append(ring)
    return [(ring, tuple(holes[ring])) for ring in outer]


def bounds(shape: Shape) -> tuple[int, int, int, int]:
    """West, south, east, north."""
    if isinstance(shape, RoundArea):
        (x, y), r = shape.center, shape.radius
        return x - r, y - r, x + r, y + r
    xs, ys = zip(*corners(shape), strict=True)
    return min(xs), min(ys), max(xs), max(ys)


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
    """For each face: whether it belongs to either area."""
    return ((first > 0, second > 0) for first, second in faces((one.rings, other.rings)))
