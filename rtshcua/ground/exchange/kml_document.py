"""Read KML (OGC 12-007r2) and KMZ: placemarks with polygons and lines, their heights and periods.

The XML is parsed by the standard library's expat. A document type declaration is refused: without one there are no
entities, so none can expand or name another file. Of a KMZ the document is read in memory, with a limit; nothing is
extracted, and no link is followed.
"""

import json
import re
import struct
import zlib
from collections.abc import Iterator
from decimal import Decimal
from io import BytesIO
from typing import Final, NamedTuple
from xml.etree.ElementTree import Element, ParseError, TreeBuilder, XMLParser
from zipfile import BadZipFile, LargeZipFile, ZipFile

from rtshcua.diagnostics.excerpt import visible
from rtshcua.ground.exchange.losses import NotReadable
from rtshcua.ground.language.size_limits import MAX_SIZE

_NUMBER: Final = re.compile(r"[+-]?(?:[0-9]{1,40}(?:\.[0-9]{0,40})?|\.[0-9]{1,40})(?:[eE][+-]?[0-9]{1,3})?", re.ASCII)
#: the most placemarks with areas that are read, and the most files of an archive
MOST_AREAS: Final = 1_000
_MOST_FILES: Final = 10_000
_ENCRYPTED: Final = 1  # flag of a file of an archive
_METHODS: Final = (0, 8)  # stored, deflated
#: what reading a damaged archive raises
_BROKEN: Final = (
    BadZipFile, LargeZipFile, zlib.error, EOFError, OSError, NotImplementedError, RuntimeError, ValueError,
    struct.error,
)  # fmt: skip
ON_GROUND: Final = ("clampToGround", "clampToSeaFloor", "")
ABSOLUTE, RELATIVE = "absolute", "relativeToGround"

Position = tuple[Decimal, ...]


class KmlPolygon(NamedTuple):
    """A polygon: its rings (the outer one first) of longitudes, latitudes and, perhaps, heights in m; the altitude mode
    and whether it is extruded to the ground.
    """

    rings: tuple[tuple[Position, ...], ...]
    mode: str
    extruded: bool


class KmlLine(NamedTuple):
    """A line, as a polygon has them."""

    positions: tuple[Position, ...]
    mode: str


class KmlMark(NamedTuple):
    """A placemark: its place in the document, its name, geometries, and the span of time in which it is shown (empty:
    none given). `others` are the kinds of its further geometries, `parts` those of its other elements.
    """

    place: str
    name: str
    polygons: tuple[KmlPolygon, ...]
    lines: tuple[KmlLine, ...]
    others: tuple[str, ...]
    span: tuple[str, str] | None
    parts: tuple[str, ...]


class KmlDocument(NamedTuple):
    """The placemarks of a document; the elements that are neither placemarks nor folders (each with its place)."""

    marks: tuple[KmlMark, ...]
    others: tuple[tuple[str, str], ...]


class _NoDeclarations(TreeBuilder):
    """Builds the tree of a document without a document type declaration."""

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        """Called by the parser for a document type declaration."""
        raise NotReadable("it has a document type declaration", "remove the line that begins with `<!DOCTYPE`")


def parse_kml(data: bytes) -> Element:
    """The root of a document. Raises `NotReadable`."""
    parser = XMLParser(target=_NoDeclarations())
    try:
        parser.feed(data)
        root: Element = parser.close()
    except ParseError as error:
        line, column = error.position
        what = str(error).partition(":")[0]
        help = "export it again from the program that made it"
        raise NotReadable(f"line {line}, column {column}: {what}", help) from None
    except (ValueError, LookupError) as error:  # an encoding that the parser does not have
        raise NotReadable(f"it is not readable as XML: {error}", "save it as UTF-8") from None
    return root


def kml_of(archive: bytes) -> bytes:
    """The document of a KMZ: `doc.kml`, or else its first KML file. Raises `NotReadable`."""
    try:
        with ZipFile(BytesIO(archive)) as opened:
            files = opened.infolist()
            if len(files) > _MOST_FILES:
                raise NotReadable(f"the archive has more than {_MOST_FILES} files")
            found = [each for each in files if each.filename.lower().endswith(".kml")]
            chosen = next((each for each in found if each.filename == "doc.kml"), found[0] if found else None)
            if chosen is None:
                raise NotReadable("the archive has no KML file")
            if sum(each.filename == chosen.filename for each in files) > 1:
                raise NotReadable(f"the archive has several files of the name `{visible(chosen.filename)}`")
            if chosen.flag_bits & _ENCRYPTED or chosen.compress_type not in _METHODS:
                raise NotReadable("the KML file of the archive is encrypted, or compressed in an unusual way")
            with opened.open(chosen) as file:
                data = file.read(MAX_SIZE + 1)
    except _BROKEN as error:
        raise NotReadable(f"it is not a readable archive: {' '.join(str(error).split())[:120]}") from None
    if len(data) > MAX_SIZE:
        raise NotReadable(f"the KML file of the archive has more than {MAX_SIZE >> 20} MiB")
    return data


def read_kml(data: bytes) -> KmlDocument:
    """The placemarks of a document. Raises `NotReadable`."""
    root = parse_kml(data)
    if _tag(root) not in ("kml", "Document", "Folder", "Placemark"):
        raise NotReadable("it is no KML document")
    marks: list[KmlMark] = []
    others: list[tuple[str, str]] = []
    counts: dict[str, int] = {}
    for element in _features(root):
        tag = _tag(element)
        counts[tag] = counts.get(tag, 0) + 1
        place = f"{tag}[{counts[tag]}]"
        if tag != "Placemark":
            others.append((tag, place))
        elif counts[tag] > MOST_AREAS * 10:
            raise NotReadable(f"it has more than {MOST_AREAS * 10} placemarks", "export the areas alone")
        else:
            marks.append(_mark(element, place))
    return KmlDocument(tuple(marks), tuple(others))


def _features(root: Element) -> Iterator[Element]:
    """Placemarks, overlays, links, and spans of whole folders, in the order of the document; not what is inside. Also
    elements of any other kind that have placemarks or links in them.
    """
    open_ = [root]
    while open_:
        element = open_.pop()
        if _tag(element) in ("kml", "Document", "Folder"):
            open_ += reversed(element)
        elif _tag(element) in (*_MARKS, *OVERLAYS, "TimeSpan") or any(_tag(each) in _MARKS for each in element.iter()):
            yield element


_MARKS: Final = ("Placemark", "NetworkLink")
#: elements that show something and are no zones
OVERLAYS: Final = ("GroundOverlay", "PhotoOverlay", "ScreenOverlay", "Tour")
#: elements of a placemark that are its geometry, or are read
_GEOMETRIES: Final = ("Polygon", "LineString")
_OTHER_GEOMETRIES: Final = ("Point", "LinearRing", "Model", "Track", "MultiTrack")
_READ: Final = ("name", "MultiGeometry", "TimeSpan", *_GEOMETRIES, *_OTHER_GEOMETRIES)


def _mark(mark: Element, place: str) -> KmlMark:
    inside = [each for each in mark.iter() if each is not mark]
    return KmlMark(
        place,
        " ".join(text_of(mark, "name").split()),
        tuple(_polygon(each) for each in inside if _tag(each) == "Polygon"),
        tuple(_line(each) for each in inside if _tag(each) == "LineString"),
        tuple(_others(inside)),
        _span(mark),
        tuple(dict.fromkeys(_tag(each) for each in mark if _tag(each) not in _READ)),
    )


def _others(inside: list[Element]) -> Iterator[str]:
    """The kinds of geometries that are no areas; a ring that is a boundary of a polygon is none of them."""
    bounds = {id(part) for each in inside if _tag(each) in ("outerBoundaryIs", "innerBoundaryIs") for part in each}
    for each in inside:
        if _tag(each) in _OTHER_GEOMETRIES and id(each) not in bounds:
            yield _tag(each)


def _span(mark: Element) -> tuple[str, str] | None:
    span = next((each for each in mark if _tag(each) == "TimeSpan"), None)
    return None if span is None else (text_of(span, "begin").strip(), text_of(span, "end").strip())


def _polygon(polygon: Element) -> KmlPolygon:
    """The rings of a polygon: its outer one, then its holes."""
    outer = [each for each in polygon if _tag(each) == "outerBoundaryIs"]
    inner = [each for each in polygon if _tag(each) == "innerBoundaryIs"]
    if len(outer) != 1:
        raise NotReadable(f"a polygon has {len(outer) or 'no'} outer boundaries; expected one")
    drawn = [[ring for ring in each if _tag(ring) == "LinearRing"] for each in (*outer, *inner)]
    if len(drawn[0]) != 1 or not all(drawn):
        raise NotReadable("a boundary of a polygon has no ring, or an outer one has several")
    rings = [_coordinates(ring) for each in drawn for ring in each]
    return KmlPolygon(tuple(rings), _mode(polygon), text_of(polygon, "extrude").strip() in ("1", "true"))


def _line(line: Element) -> KmlLine:
    return KmlLine(_coordinates(line), _mode(line))


def _mode(geometry: Element) -> str:
    """The altitude mode, also of the extension `gx`; all of them if they are not the same."""
    modes = list(dict.fromkeys((each.text or "").strip() for each in geometry if _tag(each) == "altitudeMode"))
    return " ".join(modes) if not {*modes} <= {*ON_GROUND} else "".join(modes[:1])


def _coordinates(geometry: Element) -> tuple[Position, ...]:
    """The positions of a ring or a line. Raises `NotReadable` if readers could take them for others."""
    found = [each for each in geometry if _tag(each) == "coordinates"]
    if len(found) > 1 or any(len(each) for each in found):
        raise NotReadable("a ring or a line has several `coordinates`, or elements in them")
    return _positions(text_of(geometry, "coordinates"))


def _positions(text: str) -> tuple[Position, ...]:
    """Positions `longitude,latitude[,height]`, separated by white space."""
    found = []
    for each in text.split():
        parts = each.split(",")
        if not 2 <= len(parts) <= 3 or not all(_NUMBER.fullmatch(part) for part in parts):
            raise NotReadable(f"`{each[:40]}` is not a position", "expected `LONGITUDE,LATITUDE[,HEIGHT]`")
        found.append(tuple(Decimal(part) for part in parts))
    return tuple(found)


def polygons_as_geojson(data: bytes) -> bytes:
    """The polygons of a document as a feature collection, with the heights of those that are not on the ground. Raises
    `NotReadable`.
    """
    features = []
    for mark in read_kml(data).marks:
        if mark.polygons:
            properties = json.dumps({"name": mark.name} if mark.name else {}, ensure_ascii=False)
            polygons = ",".join(_as_geojson(each) for each in mark.polygons)
            geometry = f'{{"type":"MultiPolygon","coordinates":[{polygons}]}}'
            features.append(f'{{"type":"Feature","properties":{properties},"geometry":{geometry}}}')
    if len(features) > MOST_AREAS:
        raise NotReadable(f"it has more than {MOST_AREAS} placemarks", "export the field alone")
    if not features:
        raise NotReadable("it has no polygon", "draw the field as a polygon; a path or a point is no area")
    return f'{{"type":"FeatureCollection","features":[{",".join(features)}]}}'.encode()


def _as_geojson(polygon: KmlPolygon) -> str:
    places = 2 if polygon.mode in ON_GROUND else 3
    rings = (",".join(f"[{','.join(map(str, each[:places]))}]" for each in ring) for ring in polygon.rings)
    return f"[{','.join(f'[{each}]' for each in rings)}]"


def text_of(parent: Element, name: str) -> str:
    """The text of the first child of a name; empty without one."""
    return next((each.text or "" for each in parent if _tag(each) == name), "")


def _tag(element: Element) -> str:
    """The name of an element without its namespace."""
    return element.tag.rpartition("}")[2]
