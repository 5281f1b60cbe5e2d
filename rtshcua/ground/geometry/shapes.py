"""Zones of the local plane while they are compiled: circles by their radius, all others by their corners, in mm."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import isqrt

from rtshcua.decision.outline import rings as outline
from rtshcua.ground.geometry.polygons import contained, doubled_area
from rtshcua.model.flat.zone import AREA, CIRCLE, HIGHEST, LOWEST, POLYGON, Zone

Point = tuple[int, int]
Ring = tuple[Point, ...]


@dataclass(frozen=True, slots=True)
class Disc:
    """All points nearer to `center` than `radius`."""

    center: Point
    radius: int


@dataclass(frozen=True, slots=True)
class Outline:
    """The inside of a simple polygon, counter-clockwise."""

    corners: Ring

    @property
    def rings(self) -> tuple[Ring, ...]:
        """Its one ring."""
        return (self.corners,)


@dataclass(frozen=True, slots=True)
class Area:
    """What lies inside of outer rings (counter-clockwise) and outside of holes (clockwise); the rings are simple and
    have no point in common.
    """

    rings: tuple[Ring, ...]


Cornered = Outline | Area
Shape = Disc | Outline | Area


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
    if isinstance(shape, Disc):
        return CIRCLE, (*shape.center, shape.radius * shape.radius)
    coordinates = tuple(c for corner in corners(shape) for c in corner)
    if isinstance(shape, Outline):
        return POLYGON, coordinates
    return AREA, (len(shape.rings), *map(len, shape.rings), *coordinates)


def shape_of(zone: Zone) -> Shape | None:
    """The shape of a zone as it is carried on board; None for a circle whose radius is no whole number of mm."""
    if zone.shape != CIRCLE:
        return cornered(tuple(outline(zone)))
    x, y, square = zone.data
    radius = isqrt(square)
    return Disc((x, y), radius) if radius * radius == square else None


def cornered(rings: tuple[Ring, ...]) -> Cornered:
    """The shape that some rings are the boundary of."""
    return Outline(rings[0]) if len(rings) == 1 else Area(rings)


def contains(shape: Cornered, point: Point) -> bool:
    """Whether a point is strictly inside."""
    return contained(shape.rings, point)


def edges(shape: Cornered) -> list[tuple[Point, Point]]:
    """The edges of all rings, from each corner to the next; the inside is on their left."""
    return [edge for ring in shape.rings for edge in zip(ring, (*ring[1:], ring[0]), strict=True)]


def corners(shape: Cornered) -> Iterator[Point]:
    """The corners of all rings."""
    return (corner for ring in shape.rings for corner in ring)


def parts(shape: Cornered) -> list[tuple[Ring, tuple[Ring, ...]]]:
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
    if isinstance(shape, Disc):
        (x, y), r = shape.center, shape.radius
        return x - r, y - r, x + r, y + r
    xs, ys = zip(*corners(shape), strict=True)
    return min(xs), min(ys), max(xs), max(ys)
