"""Read the outline of an area from a GeoJSON or KML file.

A KML file (OGC 12-007r2) is written as GeoJSON and read by the same strict reader, so both have the same checks. The
XML is parsed by the standard library's expat. A document type declaration is refused: without one there are no
entities, so none can expand or name another file.
"""

import json
import re
from collections.abc import Iterator
from decimal import Decimal
from pathlib import Path
from typing import Final
from xml.etree.ElementTree import Element, ParseError, TreeBuilder, XMLParser

from rtshcua.adapters.store.reading import read_regular
from rtshcua.app.exit_codes import words_of
from rtshcua.diagnostics.codes import GEOJSON_UNREAD
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.kinds import ARCHIVE, GEOJSON, KML, recognised
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.checker.geojson import GeoPolygon, NoArea, read_area
from rtshcua.ground.language.size_limits import MAX_SIZE

_NUMBER: Final = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?", re.ASCII)
#: the most polygons of a file that are offered by name
_MOST_AREAS: Final = 1_000
_GROUND: Final = ("clampToGround", "clampToSeaFloor", "")
_HEIGHTS: Final = "remove heights and times from the file: `--below` limits the height"


class _BadKml(Exception):
    """A KML file that cannot be read; the text and the help are for people."""

    def __init__(self, text: str, help: str = "") -> None:
        super().__init__(text)
        self.help = help


class _NoDeclarations(TreeBuilder):
    """Builds the tree of a document without a document type declaration."""

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        """Called by the parser for a document type declaration."""
        raise _BadKml("it has a document type declaration", "remove the line that begins with `<!DOCTYPE`")


def read_outline(path: Path, feature: str | None = None) -> tuple[GeoPolygon, ...] | Refusal:
    """Return the polygons of the only area in a file, or of the one with a name, in 1e-7 degree."""
    try:
        data = read_regular(path, MAX_SIZE)
    except OSError as error:
        return Refusal("input", f"cannot read `{path}`: {words_of(error)}", "", ExitCode.INPUT)
    if len(data) > MAX_SIZE:
        return _refused(path, f"it has more than {MAX_SIZE >> 20} MiB", "simplify the outline")
    kind = recognised(data)
    if path.suffix.lower() == ".kmz" or kind is ARCHIVE:
        return _refused(path, "it is an archive", f"unzip it, and use its `doc.kml`: `unzip {path.name} doc.kml`")
    is_kml = kind is KML or (kind is not GEOJSON and path.suffix.lower() == ".kml")
    try:
        return read_area(_as_geojson(data) if is_kml else data, feature)
    except _BadKml as error:
        return _refused(path, str(error), error.help)
    except NoArea as error:
        help = _HEIGHTS if error.code is GEOJSON_UNREAD else (error.help or "").replace("`feature`", "`FILE#NAME`")
        return _refused(path, error.message, help)


def _refused(path: Path, text: str, help: str) -> Refusal:
    return Refusal("no-area", f"`{path}`: {text}", help, ExitCode.INPUT)


def _as_geojson(data: bytes) -> bytes:
    """Return the polygons of a KML document as a feature collection. Raises `_BadKml`."""
    parser = XMLParser(target=_NoDeclarations())
    try:
        parser.feed(data)
        root = parser.close()
    except ParseError as error:
        line, column = error.position
        what = str(error).partition(":")[0]
        raise _BadKml(
            f"line {line}, column {column}: {what}", "export it again from the program that made it"
        ) from None
    except (ValueError, LookupError) as error:  # an encoding that the parser does not have
        raise _BadKml(f"it is not readable as XML: {error}", "save it as UTF-8") from None
    features = list(_features(root))
    if not features:
        raise _BadKml("it has no polygon", "draw the field as a polygon; a path or a point is no area")
    return f'{{"type":"FeatureCollection","features":[{",".join(features)}]}}'.encode()


def _features(root: Element) -> Iterator[str]:
    """The placemarks with polygons, each as a Feature."""
    for number, mark in enumerate(each for each in root.iter() if _tag(each) == "Placemark"):
        if number >= _MOST_AREAS:
            raise _BadKml(f"it has more than {_MOST_AREAS} placemarks", "export the field alone")
        polygons = [_polygon(each) for each in mark.iter() if _tag(each) == "Polygon"]
        if polygons:
            name = " ".join(_text(mark, "name").split())
            properties = json.dumps({"name": name} if name else {}, ensure_ascii=False)
            geometry = f'{{"type":"MultiPolygon","coordinates":[{",".join(polygons)}]}}'
            yield f'{{"type":"Feature","properties":{properties},"geometry":{geometry}}}'


def _polygon(polygon: Element) -> str:
    """The coordinates of a polygon: its outer ring, then its holes."""
    flat = _text(polygon, "altitudeMode").strip() in _GROUND
    outer = [each for each in polygon if _tag(each) == "outerBoundaryIs"]
    inner = [each for each in polygon if _tag(each) == "innerBoundaryIs"]
    if len(outer) != 1:
        raise _BadKml(f"a polygon has {len(outer) or 'no'} outer boundaries; expected one")
    rings = [
        _ring(_text(ring, "coordinates"), flat=flat)
        for each in (*outer, *inner)
        for ring in each
        if _tag(ring) == "LinearRing"
    ]
    return f"[{','.join(rings)}]"


def _ring(text: str, *, flat: bool) -> str:
    """The coordinates of a ring of positions `longitude,latitude[,height]`, separated by white space. `flat`: the area
    lies on the ground, so the heights are ignored.
    """
    found = []
    for each in text.split():
        parts = each.split(",")
        if not 2 <= len(parts) <= 3 or not all(_NUMBER.fullmatch(part) for part in parts):
            raise _BadKml(f"`{each[:40]}` is not a position", "expected `LONGITUDE,LATITUDE[,HEIGHT]`")
        found.append(f"[{','.join(str(Decimal(part)) for part in parts[: 2 if flat else 3])}]")
    return f"[{','.join(found)}]"


def _text(parent: Element, name: str) -> str:
    """The text of the first child of a name; empty without one."""
    return next((each.text or "" for each in parent if _tag(each) == name), "")


def _tag(element: Element) -> str:
    """The name of an element without its namespace."""
    return element.tag.rpartition("}")[2]
