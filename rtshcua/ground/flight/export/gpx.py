"""A flight as GPX 1.1 (https://www.topografix.com/GPX/1/1/): the track, and the decisions as waypoints.

`ele` is the height above mean sea level in metres, as the autopilot reported it. Times are UTC to the millisecond, as
the schema provides.
"""

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
from rtshcua.ground.flight.export.xml_text import add, document
from rtshcua.ground.flight.flown import TrackPoint
from rtshcua.ground.flight.track import place_at

DATUM: Final = "above mean sea level as the autopilot reported it"
_SPACE: Final = "http://www.topografix.com/GPX/1/1"
_MILLISECONDS: Final = 3


def gpx(export: FlightExport) -> bytes:
    """The document; the order of elements is that of the schema."""
    flight = export.flight
    root = Element(
        "gpx",
        {
            "version": "1.1",
            "creator": export.made_by,
            "xmlns": _SPACE,
            "xmlns:xsi": "http://www.w3.org/2001/XMLSchema-instance",
            "xsi:schemaLocation": f"{_SPACE} {_SPACE}/gpx.xsd",
        },
    )
    metadata = add(root, "metadata")
    add(metadata, "name", export.title)
    add(metadata, "desc", "\n".join(export.description(f"elevations: {DATUM}")))
    add(metadata, "time", utc_text(flight.genesis.utc_us, _MILLISECONDS))
    for decision in export.decisions:
        known = place_at(export.track, decision.t_us)
        if known is not None:
            mark = _place(root, "wpt", known.point, flight.utc_of(decision.t_us))
            add(mark, "name", decision.label)
            words = shown(decision.words)
            add(mark, "desc", f"{words} ({known.remark})" if known.remark else words)
    track = add(root, "trk")
    add(track, "name", export.title)
    for part in segments(export.track):
        into = add(track, "trkseg")
        for point in part:
            _place(into, "trkpt", point, flight.utc_of(point.t_us))
    return document(root)


def _place(parent: Element, tag: str, point: TrackPoint, utc_us: int) -> Element:
    place = add(parent, tag, lat=decimal(point.latitude, DEGREES), lon=decimal(point.longitude, DEGREES))
    add(place, "ele", decimal(point.above_sea, METRES))
    add(place, "time", utc_text(utc_us, _MILLISECONDS))
    return place
