"""A flight as KML 2.2 with Google's `gx:Track` (https://developers.google.com/kml/documentation/kmlreference).

Heights of track, planned path, decisions and home are `absolute`: above mean sea level, as the autopilot reported them.
Those of zones and of the planned path are converted with the height of home above the sea; where that is not known,
they are `relativeToGround`, which is right over level ground only. Google Earth shows a description as HTML, so texts
are escaped for that, too.
"""

from collections.abc import Iterable
from html import escape
from typing import Final
from xml.etree.ElementTree import Element

from rtshcua.ground.flight.export.exported import (
    DEGREES,
    METRES,
    FlightExport,
    decimal,
    segments,
    shown,
    utc_text,
)
from rtshcua.ground.flight.export.geo_shapes import GeoArea, Ring, ZoneShape, cut_line, planned_path, zone_shapes
from rtshcua.ground.flight.export.xml_text import add, document
from rtshcua.ground.flight.track import HomeHeight, home_of, place_at

#: colours as aabbggrr: of the track, the planned path, zones to stay inside, zones to stay outside, and other zones
_LINES: Final = {"track": "ff00aaff", "planned": "ffff8800"}
_AREAS: Final = {"inside": "3300aa00", "outside": "660000ff", "zone": "33888888"}


def kml(export: FlightExport) -> bytes:
    """The document."""
    home = home_of(export.flight)
    root = Element("kml", {"xmlns": "http://www.opengis.net/kml/2.2", "xmlns:gx": "http://www.google.com/kml/ext/2.2"})
    top = add(root, "Document")
    add(top, "name", export.title)
    _describe(top, *export.description(f"heights: {datum(home)}"))
    for name, colour in _LINES.items():
        line = add(add(top, "Style", id=name), "LineStyle")
        add(line, "color", colour)
        add(line, "width", "3")
    for name, colour in _AREAS.items():
        add(add(add(top, "Style", id=name), "PolyStyle"), "color", colour)
    _home(top, home)
    _track(top, export)
    _planned(top, export, home)
    _decisions(top, export)
    zones = _folder(top, "zones")
    for zone in zone_shapes(export.flight.policy):
        _zone(zones, zone, home)
    return document(root)


def datum(home: HomeHeight) -> str:
    """The datum of heights, in words."""
    if home.above_sea is None:
        return (
            "above mean sea level; of planned path and zones relative to the ground, since home's height is not known"
        )
    return (
        "above mean sea level as the autopilot reported it; planned path and zones from heights above home,"
        f" which is {decimal(home.above_sea, METRES)} m above mean sea level"
    )


def _describe(parent: Element, *lines: str) -> None:
    add(parent, "description", "<br/>".join(escape(line, quote=False) for line in lines if line))


def _folder(parent: Element, name: str) -> Element:
    folder = add(parent, "Folder")
    add(folder, "name", name)
    return folder


def _placemark(parent: Element, name: str, *lines: str, style: str = "", when: str = "") -> Element:
    mark = add(parent, "Placemark")
    add(mark, "name", name)
    _describe(mark, *lines)
    if when:
        add(add(mark, "TimeStamp"), "when", when)
    if style:
        add(mark, "styleUrl", f"#{style}")
    return mark


def _place(longitude: int, latitude: int, height: int | None) -> str:
    place = f"{decimal(longitude, DEGREES)},{decimal(latitude, DEGREES)}"
    return place if height is None else f"{place},{decimal(height, METRES)}"


def _point(mark: Element, longitude: int, latitude: int, above_sea: int | None) -> None:
    point = add(mark, "Point")
    add(point, "altitudeMode", "clampToGround" if above_sea is None else "absolute")
    add(point, "coordinates", _place(longitude, latitude, above_sea))


def _home(parent: Element, home: HomeHeight) -> None:
    height = "" if home.above_sea is None else f"{decimal(home.above_sea, METRES)} m above mean sea level"
    who = "as the vehicle reported it" if home.reported else "as the policy declares it"
    mark = _placemark(parent, "home", who, height)
    _point(mark, home.longitude, home.latitude, home.above_sea)


def _track(parent: Element, export: FlightExport) -> None:
    parts = list(segments(export.track))
    mark = _placemark(parent, "track", "heights above mean sea level", style="track")
    if len(parts) == 1:
        into = mark
    else:
        into = add(mark, "gx:MultiTrack")
        add(into, "gx:interpolate", "0")
    for part in parts:
        track = add(into, "gx:Track")
        add(track, "altitudeMode", "absolute")
        for point in part:
            add(track, "when", utc_text(export.flight.utc_of(point.t_us)))
        for point in part:
            coordinates = _place(point.longitude, point.latitude, point.above_sea)
            add(track, "gx:coord", coordinates.replace(",", " "))


def _planned(parent: Element, export: FlightExport, home: HomeHeight) -> None:
    path = planned_path(export.flight)
    if not path:
        return
    mode, above = ("relativeToGround", 0) if home.above_sea is None else ("absolute", home.above_sea)
    mark = _placemark(parent, "planned path", "from the declared home", style="planned")
    geometry = add(mark, "MultiGeometry")
    for part in cut_line([(each.longitude, each.latitude, each.above_home + above) for each in path]):
        line = add(geometry, "LineString")
        add(line, "altitudeMode", mode)
        add(line, "coordinates", " ".join(_place(*each[:3]) for each in part))


def _decisions(parent: Element, export: FlightExport) -> None:
    folder = _folder(parent, "decisions")
    for decision in export.decisions:
        known = place_at(export.track, decision.t_us)
        if known is None:
            continue
        at, when = known.point, utc_text(export.flight.utc_of(decision.t_us))
        height = (
            f"{decimal(at.above_sea, METRES)} m above mean sea level, {decimal(at.above_home, METRES)} m above home"
        )
        lines = (shown(decision.words), when, height, known.remark)
        mark = _placemark(folder, decision.label, *lines, when=when)
        _point(mark, at.longitude, at.latitude, at.above_sea)


def _zone(parent: Element, zone: ZoneShape, home: HomeHeight) -> None:
    use = f"airspace: stay {zone.use}" if zone.use else ""
    radius = "" if zone.radius is None else f"circle with radius {decimal(zone.radius, METRES)} m"
    times = "applies at some times only" if zone.timed else ""
    mark = _placemark(parent, shown(zone.name), use, radius, _band(zone, home), times, style=zone.use or "zone")
    geometry = add(mark, "MultiGeometry")
    low = None if zone.floor is None or zone.floor <= 0 else zone.floor
    for height, extruded in ((low, False), (zone.ceiling, low is None)):
        if height is not None:
            _polygons(geometry, zone.areas, height, home, extruded=extruded)
    if low is None and zone.ceiling is None:
        _polygons(geometry, zone.areas, None, home, extruded=False)


def _band(zone: ZoneShape, home: HomeHeight) -> str:
    def height(value: int) -> str:
        sea = "" if home.above_sea is None else f" ({decimal(value + home.above_sea, METRES)} m above mean sea level)"
        return f"{decimal(value, METRES)} m above home{sea}"

    low = "" if zone.floor is None else f"from {height(zone.floor)} "
    return f"{low}to {height(zone.ceiling)}" if zone.ceiling is not None else f"{low}without a ceiling"


def _polygons(
    parent: Element, areas: Iterable[GeoArea], height: int | None, home: HomeHeight, *, extruded: bool
) -> None:
    """Polygons at a height in mm above home; on the ground if it is None."""
    if height is None:
        mode, above = "clampToGround", None
    elif home.above_sea is None:
        mode, above = "relativeToGround", height
    else:
        mode, above = "absolute", height + home.above_sea
    for area in areas:
        polygon = add(parent, "Polygon")
        if extruded:
            add(polygon, "extrude", "1")
        add(polygon, "altitudeMode", mode)
        _ring(add(polygon, "outerBoundaryIs"), area.outer, above)
        for hole in area.holes:
            _ring(add(polygon, "innerBoundaryIs"), hole, above)


def _ring(parent: Element, ring: Ring, above: int | None) -> None:
    places = " ".join(_place(*each, above) for each in (*ring, ring[0]))
    add(add(parent, "LinearRing"), "coordinates", places)
