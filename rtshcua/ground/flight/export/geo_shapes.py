"""The shapes of an export in WGS 84: zones, the planned path, and lines and areas cut at longitude 180.

Places are in 1e-7 degree, longitude first as in KML and GeoJSON. A cut shape never passes longitude 180 (RFC 7946,
section 3.1.9): renderers would draw it the long way around the earth.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import cos, isqrt, pi, sin
from typing import Any, Final, NamedTuple

from shapely import Polygon, box, get_parts, make_valid
from shapely.geometry.polygon import orient

from rtshcua.ground.flight.flown import Flight
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import (
    AREA,
    CIRCLE,
    HALF_TURN,
    HIGHEST,
    LOWEST,
    TURN,
    Projection,
    Zone,
    meridian,
    unproject,
)

#: corners of a polygon in place of a circle: its edges are within 0.04 % of the radius
CORNERS: Final = 120

Place = tuple[int, int]
Ring = tuple[Place, ...]


class GeoArea(NamedTuple):
    """A polygon: its outer ring counter-clockwise, its holes clockwise; the first place is not repeated at the end."""

    outer: Ring
    holes: tuple[Ring, ...]


class ZoneShape(NamedTuple):
    """A zone. `use` says how the airspace uses it: `inside`, `outside` or empty. `floor` and `ceiling` are in mm above
    home, None without one; `radius` is that of a circle in mm, whose areas are polygons within it. `timed`: it exists
    at some times only.
    """

    name: str
    use: str
    floor: int | None
    ceiling: int | None
    radius: int | None
    timed: bool
    areas: tuple[GeoArea, ...]


def zone_shapes(policy: Policy) -> Iterator[ZoneShape]:
    """The declared zones of a policy."""
    inside, outside = (policy.airspace.inside, policy.airspace.outside) if policy.airspace is not None else ((), ())
    for index, zone in enumerate(policy.zones[: policy.declared]):
        yield ZoneShape(
            zone.name,
            "inside" if index in inside else "outside" if index in outside else "",
            None if zone.floor <= LOWEST else zone.floor,
            None if zone.ceiling >= HIGHEST else zone.ceiling,
            isqrt(zone.data[2]) if zone.shape == CIRCLE else None,
            bool(zone.daily or zone.weekly or zone.dates),
            tuple(_areas(zone, policy.projection)),
        )


def _areas(zone: Zone, projection: Projection) -> Iterator[GeoArea]:
    rings = [
        tuple(_unrolled(projection, x, y) for x, y in zip(ring[::2], ring[1::2], strict=True)) for ring in _rings(zone)
    ]
    for ring in filter(_is_outer, rings):
        outer = make_valid(Polygon(ring))  # rounding to 1e-7 degree, and the poles, can make a ring touch itself
        holes = [hole for hole in rings if not _is_outer(hole) and outer.contains(Polygon(hole).representative_point())]
        yield from cut_area(make_valid(Polygon(ring, holes)))


def _rings(zone: Zone) -> Iterator[Sequence[int]]:
    if zone.shape == CIRCLE:
        x, y, square = zone.data
        radius = square**0.5
        turns = [2 * pi * number / CORNERS for number in range(CORNERS)]
        yield [part for turn in turns for part in (x + int(radius * cos(turn)), y + int(radius * sin(turn)))]
    elif zone.shape == AREA:
        at = 1 + zone.data[0]
        for corners in zone.data[1:at]:
            yield zone.data[at : at + 2 * corners]
            at += 2 * corners
    else:
        yield zone.data


def _is_outer(ring: Ring) -> bool:
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in pairwise((*ring, ring[0]))) > 0


def _unrolled(projection: Projection, x: int, y: int) -> Place:
    """A local place; its longitude may be beyond 180 degrees, so that no ring breaks. No zone reaches over a pole."""
    latitude, longitude = unproject(projection, x, y)
    return meridian(longitude, projection.longitude), max(-HALF_TURN // 2, min(latitude, HALF_TURN // 2))


def cut_area(whole: Any) -> Iterator[GeoArea]:
    """Polygons of shapely, whose longitudes may be beyond 180 degrees, as areas that are not."""
    west, _, east, _ = whole.bounds
    for turn in range(-1, 2):
        left = turn * TURN - HALF_TURN
        if east <= left or west >= left + TURN:
            continue
        whole_turn = left <= west and east <= left + TURN
        part = whole if whole_turn else whole.intersection(box(left, -HALF_TURN, left + TURN, HALF_TURN))
        for each in get_parts(get_parts(part)):
            if each.geom_type == "Polygon" and each.area > 0:
                oriented = orient(each)
                yield GeoArea(
                    _places(oriented.exterior, turn * TURN),
                    tuple(_places(hole, turn * TURN) for hole in oriented.interiors),
                )


def _places(ring: Any, turned: int) -> Ring:
    """The places of a ring; integers of this size are exact in shapely's doubles."""
    return tuple((round(x) - turned, round(y)) for x, y in ring.coords[:-1])


def cut_line(points: Sequence[tuple[int, ...]]) -> list[list[tuple[int, ...]]]:
    """A line as parts that do not pass longitude 180. The first value of a point is its longitude; all values of a
    place at the cut are interpolated.
    """
    parts = [[*points[:1]]]
    for one, other in pairwise(points):
        way = other[0] - one[0]
        if abs(way) > HALF_TURN:
            edge = HALF_TURN if way < 0 else -HALF_TURN
            length = other[0] + (TURN if way < 0 else -TURN) - one[0]
            at = tuple(
                a + (b - a) * (edge - one[0]) // length for a, b in zip(one[1:], other[1:], strict=True)
            )  # fmt: skip
            if one[0] != edge:
                parts[-1].append((edge, *at))
            parts.append([] if other[0] == -edge else [(-edge, *at)])
        parts[-1].append(other)
    longer = [part for part in parts if len(part) > 1]
    return longer or parts[:1]


class PlannedPoint(NamedTuple):
    """A corner of the planned path: the index of its step, the place, and its height above home in mm."""

    step: int
    longitude: int
    latitude: int
    above_home: int


def planned_path(flight: Flight) -> tuple[PlannedPoint, ...]:
    """The path that the mission plans, from the declared home if it begins with a climb. A return climbs to its
    altitude, crosses and lands.
    """
    projection, limits = flight.policy.projection, flight.policy.vehicle
    path: list[PlannedPoint] = []
    at, height = (0, 0), 0

    def go(step: int, to: tuple[int, int], above_home: int) -> None:
        latitude, longitude = unproject(projection, *to)
        point = PlannedPoint(step, longitude, latitude, above_home)
        if not path or path[-1][1:] != point[1:]:
            path.append(point)

    for step, invocation in enumerate(flight.mission.invocations):
        plan = invocation.plan
        places = list(zip(plan.path[::2], plan.path[1::2], strict=True))
        if not path and plan.kind == MotionKind.CLIMB:
            go(step, at, height)
        if plan.kind in (MotionKind.CLIMB, MotionKind.FLY, MotionKind.COVER):
            height = plan.altitude
        if plan.kind == MotionKind.HOME:
            height = max(height, limits.return_altitude)
        if plan.kind in (MotionKind.CLIMB, MotionKind.HOME) and path:
            go(step, at, height)
        for place in places:
            go(step, place, height)
        at = places[-1] if places else at
        if plan.kind in (MotionKind.HOME, MotionKind.LAND) and path:
            height = 0
            go(step, at, height)
    return tuple(path)
