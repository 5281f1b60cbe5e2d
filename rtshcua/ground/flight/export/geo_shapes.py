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

from rtshcua.decision.outline import rings
from rtshcua.ground.drawing.drawn_site import planned_legs
from rtshcua.ground.drawing.flat_site import is_timed, limits_of, site_of, way_of
from rtshcua.ground.flight.flown import Flight
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import (
    CIRCLE,
    HALF_TURN,
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
            *limits_of(zone),
            isqrt(zone.data[2]) if zone.shape == CIRCLE else None,
            is_timed(zone),
            tuple(_areas(zone, policy.projection)),
        )


def _areas(zone: Zone, projection: Projection) -> Iterator[GeoArea]:
    unrolled = [tuple(_unrolled(projection, x, y) for x, y in ring) for ring in _rings(zone)]
    for ring in filter(_is_outer, unrolled):
        outer = make_valid(Polygon(ring))  # rounding to 1e-7 degree, and the poles, can make a ring touch itself
        holes = [
            hole for hole in unrolled if not _is_outer(hole) and outer.contains(Polygon(hole).representative_point())
        ]
        yield from cut_area(make_valid(Polygon(ring, holes)))


def _rings(zone: Zone) -> Iterator[Sequence[Place]]:
    if zone.shape != CIRCLE:
        yield from rings(zone)
        return
    x, y, square = zone.data
    radius = square**0.5
    turns = [2 * pi * number / CORNERS for number in range(CORNERS)]
    yield [(x + int(radius * cos(turn)), y + int(radius * sin(turn))) for turn in turns]


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
    """A corner of the planned path: its place, and its height above home in mm."""

    longitude: int
    latitude: int
    above_home: int


def planned_path(flight: Flight) -> tuple[PlannedPoint, ...]:
    """The path that the mission plans, from the ground at the declared home; empty if nothing moves."""
    path: list[PlannedPoint] = []
    legs = tuple(planned_legs(way_of(flight.mission), site_of(flight.policy)))
    for x, y, above_home in (*(each.begin for each in legs[:1]), *(each.end for each in legs)):
        latitude, longitude = unproject(flight.policy.projection, x, y)
        point = PlannedPoint(longitude, latitude, above_home)
        if path[-1:] != [point]:
            path.append(point)
    return tuple(path)
