"""The zones of a KML document: a polygon on the ground, an extruded one up to its height, or two at a floor and a
ceiling.

A height is above sea (`absolute`) or above ground (`relativeToGround`). A single surface at a height is no volume, and
neither is one that slopes; a line needs a width. https://developers.google.com/kml/documentation/altitudemode
"""

from collections.abc import Iterator
from decimal import Decimal
from typing import NamedTuple

from rtshcua.ground.checker.geojson import GeoPolygon, NoArea, Number, polygon_of
from rtshcua.ground.exchange.geojson_features import line_text, place_of
from rtshcua.ground.exchange.kml_document import (
    ABSOLUTE,
    ON_GROUND,
    OVERLAYS,
    RELATIVE,
    KmlDocument,
    KmlLine,
    KmlMark,
    KmlPolygon,
)
from rtshcua.ground.exchange.losses import Loss, NotKept
from rtshcua.ground.exchange.zone_features import GROUND, SEA, Limit, Period, UnkeptFeature, ZoneFeature, period_of
from rtshcua.ground.exchange.zone_source import polygons_text

_DATUMS = {ABSOLUTE: SEA, RELATIVE: GROUND}
#: elements that may change where or when a zone is, with the reason why they are not kept and a help
_UNKEPT = {
    "NetworkLink": ("its content is elsewhere, and no link is followed", "save the document with its content"),
    "TimeSpan": ("it limits a whole folder", "give each placemark its own span"),
}
_NOT_READ = ("it is not read, and has placemarks or links in it", "move them into a folder")
#: elements of a placemark by the loss that they are
_LOSSES = {
    "description": "description", "Snippet": "description", "snippet": "description", "address": "description",
    "ExtendedData": "description", "Metadata": "description", "phoneNumber": "description", "author": "description",
    "link": "description", "TimeStamp": "time-stamp",
}  # fmt: skip


class KmlZones(NamedTuple):
    """The features of a document with zones, the losses, and what is not kept."""

    features: tuple[ZoneFeature, ...]
    losses: tuple[Loss, ...]
    not_kept: tuple[NotKept, ...]


def zones_of_kml(document: KmlDocument, width_mm: int | None, use: str) -> KmlZones:
    """The zones of a document. `use`: what they are for."""
    losses = [Loss("style", place, tag) for tag, place in document.others if tag in OVERLAYS]
    links = [NotKept(tag, place, *_UNKEPT.get(tag, _NOT_READ)) for tag, place in document.others if tag not in OVERLAYS]
    features = []
    for mark in document.marks:
        losses += _losses(mark)
        features += list(_features(mark, width_mm, use))
    return KmlZones(tuple(features), tuple(losses), tuple(links))


def _losses(mark: KmlMark) -> Iterator[Loss]:
    for other in mark.others:
        name = "track" if other in ("Track", "MultiTrack") else "point"
        yield Loss(name, mark.place, f"{other} {mark.name}".strip())
    for part in mark.parts:
        yield Loss(_LOSSES.get(part, "style"), mark.place, part)


def _features(mark: KmlMark, width_mm: int | None, use: str) -> Iterator[ZoneFeature]:
    """The zones of a placemark: one for each outline, and for each line."""
    outlines: dict[object, list[KmlPolygon]] = {}
    for polygon in mark.polygons:
        outlines.setdefault(tuple(tuple(each[:2] for each in ring) for ring in polygon.rings), []).append(polygon)
    makers: list[list[KmlPolygon] | KmlLine] = [*outlines.values(), *mark.lines]
    for number, each in enumerate(makers, start=1):
        place = mark.place if len(makers) == 1 else f"{mark.place}/{number}"
        made = ZoneFeature(mark.name or mark.place, place, use=use)
        try:
            if mark.span is not None:
                made.periods = _periods(*mark.span)
            if isinstance(each, list):
                made.shape = polygons_text([_polygon(each[0])])
                _limits(made, each)
            else:
                if each.mode not in ON_GROUND:
                    raise UnkeptFeature("its line is at a height, which a corridor has not", "clamp it to the ground")
                made.shape = line_text([place_of(*position[:2]) for position in each.positions], width_mm)
                made.losses.append(Loss("no-height", place, "a line on the ground"))
        except UnkeptFeature as error:
            made.refused = error.why
        except NoArea as error:
            made.refused = error.message, error.help or ""
        yield made


def _periods(begin: str, end: str) -> tuple[Period, ...]:
    return (period_of(begin, end),) if begin or end else ()


def _polygon(polygon: KmlPolygon) -> GeoPolygon:
    rings = [[[Number(str(value)) for value in each[:2]] for each in ring] for ring in polygon.rings]
    return polygon_of(rings, "coordinates")


def _limits(made: ZoneFeature, polygons: list[KmlPolygon]) -> None:
    """The floor and the ceiling that surfaces with one outline are."""
    modes = {each.mode for each in polygons}
    if modes <= {*ON_GROUND}:
        made.losses.append(Loss("no-height", made.place, "a polygon on the ground"))
        return
    datum = _DATUMS.get(next(iter(modes))) if len(modes) == 1 else None
    if datum is None:
        raise UnkeptFeature("its altitude mode is not known, or it has several")
    heights = sorted({_height(each) for each in polygons})
    if len(heights) == 1 and any(each.extruded for each in polygons):
        made.ceiling = Limit(heights[0], datum)
    elif len(heights) == 2 and len(polygons) == 2:
        made.floor, made.ceiling = (Limit(each, datum) for each in heights)
    else:
        help = "extrude it to the ground, or add the same outline at another height"
        raise UnkeptFeature("it is a surface at a height, which is no volume", help)


def _height(polygon: KmlPolygon) -> int:
    """The height of a flat polygon, mm."""
    heights = {each[2] if len(each) > 2 else Decimal(0) for ring in polygon.rings for each in ring}
    if len(heights) != 1:
        raise UnkeptFeature("its corners have different heights: it slopes")
    height = heights.pop()
    if abs(height) > 100_000:
        raise UnkeptFeature("its height is out of range")
    return round(height * 1000)
