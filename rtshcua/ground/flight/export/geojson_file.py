"""A flight as GeoJSON (RFC 7946): track, planned path, zones, decisions and home.

Positions have no third value: RFC 7946 defines it as a height above the WGS 84 ellipsoid, which autopilots do not
report here. Heights are properties, whose names have their datum and unit. A property of a line is an array with one
value for each of its positions.
"""

import json
from collections.abc import Iterator, Sequence
from typing import Any, Final

from rtshcua.diagnostics.excerpt import escaped
from rtshcua.ground.flight.export.exported import (
    DEGREES,
    METRES,
    SECONDS,
    FlightExport,
    number,
    segments,
    shown,
    utc_text,
)
from rtshcua.ground.flight.export.geo_shapes import GeoArea, Ring, ZoneShape, cut_line, planned_path, zone_shapes
from rtshcua.ground.flight.track import home_of, place_at

DATUM: Final = "WGS 84 positions without a height; heights are properties that name their datum"

Feature = dict[str, Any]


def geojson(export: FlightExport) -> bytes:
    """The document: one feature collection, with a foreign member `description`."""
    features = [*_track(export), *_planned(export), *map(_zone, zone_shapes(export.flight.policy)), _home(export)]
    features += _decisions(export)
    document = {
        "type": "FeatureCollection",
        "description": "\n".join(export.description(f"heights: {DATUM}")),
        "features": features,
    }
    return escaped(json.dumps(document, ensure_ascii=False, separators=(",", ":"))).encode() + b"\n"


def _feature(kind: str, geometry: dict[str, Any], **properties: object) -> Feature:
    return {"type": "Feature", "geometry": geometry, "properties": {"kind": kind} | properties}


def _position(longitude: int, latitude: int) -> list[float]:
    return [number(longitude, DEGREES), number(latitude, DEGREES)]


def _point(longitude: int, latitude: int) -> dict[str, Any]:
    return {"type": "Point", "coordinates": _position(longitude, latitude)}


def _line(points: Sequence[tuple[int, ...]]) -> dict[str, Any]:
    if len(points) == 1:
        return _point(points[0][0], points[0][1])
    return {"type": "LineString", "coordinates": [_position(each[0], each[1]) for each in points]}


def _track(export: FlightExport) -> Iterator[Feature]:
    for segment in segments(export.track):
        values = [(each.longitude, each.latitude, each.above_sea, each.above_home, each.t_us) for each in segment]
        for part in cut_line(values):
            _, _, sea, home, times = zip(*part, strict=True)
            yield _feature(
                "track",
                _line(part),
                time_utc=[utc_text(export.flight.utc_of(each)) for each in times],
                t_s=[number(each, SECONDS) for each in times],
                above_sea_m=[number(each, METRES) for each in sea],
                above_home_m=[number(each, METRES) for each in home],
            )


def _planned(export: FlightExport) -> Iterator[Feature]:
    path = planned_path(export.flight)
    for part in cut_line([(each.longitude, each.latitude, each.above_home) for each in path]) if path else ():
        heights = [number(each[2], METRES) for each in part]
        yield _feature("planned_path", _line(part), above_home_m=heights)


def _home(export: FlightExport) -> Feature:
    home = home_of(export.flight)
    return _feature(
        "home",
        _point(home.longitude, home.latitude),
        above_sea_m=None if home.above_sea is None else number(home.above_sea, METRES),
        source="vehicle" if home.reported else "policy",
    )


def _decisions(export: FlightExport) -> Iterator[Feature]:
    for decision in export.decisions:
        known = place_at(export.track, decision.t_us)
        if known is None:
            continue
        at = known.point
        yield _feature(
            "decision",
            _point(at.longitude, at.latitude),
            time_utc=utc_text(export.flight.utc_of(decision.t_us)),
            t_s=number(decision.t_us, SECONDS),
            step_number=decision.step_number,
            outcome=shown(decision.name),
            reason=shown(decision.reason),
            words=shown(decision.words),
            above_sea_m=number(at.above_sea, METRES),
            above_home_m=number(at.above_home, METRES),
            place_age_s=number(known.off_us, SECONDS),
        )


def _zone(zone: ZoneShape) -> Feature:
    areas = [_rings(area) for area in zone.areas]
    geometry: dict[str, Any] = {"type": "MultiPolygon", "coordinates": areas}
    if len(areas) == 1:
        geometry = {"type": "Polygon", "coordinates": areas[0]}
    return _feature(
        "zone",
        geometry,
        name=shown(zone.name),
        airspace=zone.use or None,
        floor_above_home_m=None if zone.floor is None else number(zone.floor, METRES),
        ceiling_above_home_m=None if zone.ceiling is None else number(zone.ceiling, METRES),
        radius_m=None if zone.radius is None else number(zone.radius, METRES),
        at_some_times_only=zone.timed,
    )


def _rings(area: GeoArea) -> list[list[list[float]]]:
    return [_ring(area.outer), *map(_ring, area.holes)]


def _ring(ring: Ring) -> list[list[float]]:
    return [_position(*each) for each in (*ring, ring[0])]
