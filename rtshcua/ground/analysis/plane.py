"""The relations of a policy's zones in the plane, and places with given relations to them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from math import hypot, inf, isqrt
from typing import Any, Protocol

from rtshcua.decision.outline import rings as outline
from rtshcua.ground.geometry.polygons import Point, Ring
from rtshcua.ground.geometry.shapes import Region, are_disjoint, bounds, lies_within, shape_of
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, MAX_COORDINATE, Zone

#: segments of a quarter circle in shapely
_QUARTER = 64
#: grid divisions per axis for the point search before shapely
_GRID = 8
_FAR: tuple[Point, ...] = (
    (0, 0),
    *((x, y) for x in (-MAX_COORDINATE, MAX_COORDINATE) for y in (-MAX_COORDINATE, MAX_COORDINATE)),
)
_BESIDE = tuple((x, y) for x in (0, -1, 1, -2, 2) for y in (0, -1, 1, -2, 2))


class _Prepared(Protocol):
    """A zone whose shape can decide whether it contains a point."""

    @property
    def shape(self) -> "_Shape": ...


class _Shape(Protocol):
    def contains(self, x: int, y: int) -> bool: ...


class Plane:
    """The ground plans of a policy's zones, by index. Heights and times are ignored."""

    def __init__(self, zones: Sequence[Zone], prepared: Sequence[_Prepared]) -> None:
        self._zones = zones
        self._shapes = prepared
        self._regions: dict[int, Region | None] = {}
        self._within: dict[tuple[int, int], bool] = {}
        self._apart: dict[tuple[int, int], bool] = {}
        self._found: dict[tuple[tuple[int, bool], ...], Point | None] = {}

    def zone(self, number: int) -> Zone:
        """Return a zone of the policy."""
        return self._zones[number]

    def within(self, inner: int, outer: int) -> bool:
        """Whether it is proved that one zone lies within another."""
        return inner == outer or self._related(self._within, inner, outer, lies_within)

    def apart(self, one: int, other: int) -> bool:
        """Whether it is proved that two zones are disjoint."""
        return one != other and self._related(self._apart, min(one, other), max(one, other), are_disjoint)

    def _related(
        self, known: dict[tuple[int, int], bool], one: int, other: int, holds: Callable[[Region, Region], bool]
    ) -> bool:
        found = known.get((one, other))
        if found is None:
            first, second = self._region(one), self._region(other)
            found = first is not None and second is not None and holds(first, second)
            known[one, other] = found
        return found

    def _region(self, number: int) -> Region | None:
        if number not in self._regions:
            self._regions[number] = _exact_region(self._zones[number])
        return self._regions[number]

    def contains(self, zone: int, place: Point) -> bool:
        """Whether a place is inside a zone's ground plan."""
        return self._shapes[zone].shape.contains(*place)

    def place(self, sides: Mapping[int, bool], allowed: Callable[[Point], bool]) -> Point | None:
        """Return a place inside the zones with True in `sides` and outside those with False; None if none is found."""
        key = tuple(sorted(sides.items()))
        if key not in self._found:
            self._found[key] = None
        known = self._found[key]
        if known is not None and allowed(known):
            return known
        for candidate in self._candidates([z for z, side in key if side], [z for z, side in key if not side]):
            fits = max(map(abs, candidate)) <= MAX_COORDINATE and allowed(candidate)
            if fits and all(self.contains(zone, candidate) == side for zone, side in key):
                self._found[key] = candidate
                return candidate
        return None

    def _candidates(self, inside: list[int], outside: list[int]) -> Iterator[Point]:
        yield from _FAR
        boxes = [_bounds(self._zones[zone]) for zone in inside or outside] or [(0, 0, 0, 0)]
        wests, souths, easts, norths = zip(*boxes, strict=True)
        if inside:  # their common box
            west, south, east, north = max(wests), max(souths), min(easts), min(norths)
        else:  # a box around them
            west, south, east, north = min(wests) - 2, min(souths) - 2, max(easts) + 2, max(norths) + 2
        if west > east or south > north:
            return
        yield (west + east) // 2, (south + north) // 2
        for zone in (*inside, *outside):
            w, s, e, n = _bounds(self._zones[zone])
            yield (w + e) // 2, (s + n) // 2
        for i in range(_GRID + 1):
            for j in range(_GRID + 1):
                yield west + (east - west) * i // _GRID, south + (north - south) * j // _GRID
        if inside:
            for x, y in _inner(self._zones, inside, outside):
                yield from ((x + dx, y + dy) for dx, dy in _BESIDE)


def _inner(zones: Sequence[Zone], inside: list[int], outside: list[int]) -> Iterator[Point]:
    """Yield a place in each part of the intersection of zones without others, the largest part first.

    Shapely computes them with floats, so the caller must verify each place.
    """
    import shapely  # noqa: PLC0415  it is slow to import

    left = _plan(zones[inside[0]])
    for zone in inside[1:]:
        left = left.intersection(_plan(zones[zone]))
    for zone in outside:
        left = left.difference(_plan(zones[zone]))
    parts = [part for part in shapely.get_parts(left) if part.area > 0]
    for part in sorted(parts, key=lambda each: -float(each.area)):
        point = part.representative_point()
        yield round(point.x), round(point.y)


def _plan(zone: Zone) -> Any:
    """The ground plan of a zone in shapely."""
    import shapely  # noqa: PLC0415  it is slow to import

    if zone.shape == CIRCLE:
        x, y, square = zone.data
        return shapely.Point(x, y).buffer(square**0.5, quad_segs=_QUARTER)
    found = shapely.Polygon()
    for ring in rings_of(zone):  # a hole removes area, a part in a hole adds it again
        found = found.symmetric_difference(shapely.Polygon(ring))
    return found


def nearest_inside(zone: Zone, place: Point, margin_mm: int) -> Point | None:
    """Return the place in the ground plan of a zone, this far from its edge, that is nearest to another one outside of
    it; None if there is no room. It is computed with floats, so the caller must verify it.
    """
    x, y = place
    if zone.shape == CIRCLE:
        middle_x, middle_y, square = zone.data
        part = (square**0.5 - margin_mm) / (hypot(x - middle_x, y - middle_y) or 1.0)
        return (round(middle_x + part * (x - middle_x)), round(middle_y + part * (y - middle_y))) if part > 0 else None
    nearest, least = None, inf
    for from_x, from_y, east, north, square_mm in _edges(zone, margin_mm):
        part = min(max(((x - from_x) * east + (y - from_y) * north) / square_mm, 0.0), 1.0)
        there_x, there_y = from_x + part * east, from_y + part * north
        far = (there_x - x) ** 2 + (there_y - y) ** 2
        if far < least:
            nearest, least = (there_x, there_y), far
    return None if nearest is None else (round(nearest[0]), round(nearest[1]))


@lru_cache(maxsize=64)  # a client may ask for many places beyond the same zone
def _edges(zone: Zone, margin_mm: int) -> list[tuple[float, float, float, float, float]]:
    """The edges of a zone's ground plan without a margin: where each begins, how far it leads east and north, and the
    square of its length.
    """
    import shapely  # noqa: PLC0415  it is slow to import

    edges = []
    for part in shapely.get_parts(_plan(zone).buffer(-margin_mm)):
        for ring in (part.exterior, *part.interiors):
            for (x, y), (to_x, to_y) in pairwise(ring.coords):
                edges.append((x, y, to_x - x, to_y - y, (to_x - x) ** 2 + (to_y - y) ** 2))
    return [each for each in edges if each[-1] > 0]


def _exact_region(zone: Zone) -> Region | None:
    """Return the ground plan of a zone for the exact relations; None for a circle without an integer radius."""
    shape = shape_of(zone)
    return None if shape is None else Region(shape, LOWEST, HIGHEST)


def rings_of(zone: Zone) -> tuple[Ring, ...]:
    """Return the rings of a zone that is not a circle."""
    return tuple(outline(zone))


def _bounds(zone: Zone) -> tuple[int, int, int, int]:
    """Return west, south, east and north of a zone."""
    region = _exact_region(zone)
    if region is not None:
        return bounds(region.shape)
    x, y, square = zone.data
    reach = isqrt(square) + 1
    return x - reach, y - reach, x + reach, y + reach
