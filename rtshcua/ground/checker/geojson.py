"""Areas from GeoJSON (RFC 7946): one Polygon or MultiPolygon of a file, alone or among features.

The parser is strict, because the signer of a policy must see the same zone: no repeated key, no NaN, no open ring.
Numbers stay decimal until they are whole 1e-7 degrees (rounded to the nearest, half to even: at most 6 mm on the
ground), so that no float decides on which side of a fence a place is.

`DataFiles` reads each file once. Sections 2, 3.2 and 3.3 of the RFC define which geometry is selected. Heights, times
and radii, which a zone ignores, are refused.
"""

import json
import re
from array import array
from codecs import BOM_UTF8
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import ROUND_HALF_EVEN, Decimal, localcontext
from enum import Enum
from itertools import pairwise
from typing import Any

import msgspec

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.codes import Code
from rtshcua.diagnostics.kinds import GEOJSON, recognised
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.geometry.polygons import Point, contains, crossing, touching_edges
from rtshcua.ground.language.size_limits import bare_of, values_of
from rtshcua.model.flat.zone import MAX_RINGS, MAX_VERTICES
from rtshcua.model.ir.places import GeoJson


class NoArea(Exception):
    """Raised when a file has no valid area: the code, the message and a help."""

    def __init__(self, code: Code, message: str, help: str | None = None) -> None:
        super().__init__(message)
        self.code, self.message, self.help = code, message, help


MOST_TOLD = 4


class What(Enum):
    """The kinds of members that a zone ignores."""

    HEIGHT = "height"
    TIME = "time"
    RADIUS = "radius"
    LENGTH = "length"


#: parts of names, without separators; some are of national feeds, French and German
_STEMS = {
    What.HEIGHT: ("altitude", "ceiling", "height", "elevation", "vertical", "lowerlimit", "upperlimit", "hauteur",
                  "plafond", "plancher", "h\u00f6he", "hoehe", "obergrenze", "untergrenze"),
    What.TIME: ("applicab", "schedule", "datetime", "starttime", "endtime", "startdate", "enddate", "validfrom",
                "validto", "validuntil", "timesofuse", "timeofuse", "expir", "notbefore", "notafter"),
    What.RADIUS: ("radius", "diameter"),
}  # fmt: skip
#: whole words of names
_WORDS = {
    What.HEIGHT: {"alt", "agl", "amsl", "asl", "msl", "floor", "floors", "upper", "lower", "layer", "elev", "z",
                  "limite", "zmin", "zmax", "minz", "maxz", "minalt", "maxalt", "top", "bottom",
                  "level", "levels", "fl"},
    What.TIME: {"time", "times", "start", "starts", "end", "ends", "begin", "begins", "from", "until", "till", "since",
                "valid", "validity", "effective", "eff", "permanent", "temporary", "active", "activation", "day",
                "days", "weekday", "weekdays", "hours", "hour", "wkhr", "period", "periods", "season", "curfew", "date",
                "dates"},
    What.RADIUS: {"extent", "buffer"},
}  # fmt: skip
#: a time in a name with such a word is that of the record, not of the area
_OF_THE_RECORD = {
    "created", "creation", "edit", "edited", "editor", "modified", "modification", "update", "updated", "changed",
    "issued", "published", "imported", "exported", "downloaded", "retrieved", "surveyed", "captured", "generated",
}  # fmt: skip
#: names with another meaning
_HARMLESS = {"admin_level"}
_NAMES = {"id", "name", "title"}
#: members of RFC 7946 itself, and members with a check of their own
_STRUCTURE = {"type", "coordinates", "geometry", "geometries", "features", "crs", "bbox"}
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
#: a string that is one length, with its datum, or a flight level
_LENGTH = re.compile(
    r"\s*(?:FL\s*[0-9]{1,3}|[+-]?[0-9]+(?:[.,][0-9]+)?\s*(?:m|ft|feet|met(?:er|re)s?|km|nm))"
    r"(?:\s*(?:agl|amsl|msl|asl|gnd|sfc))?\s*",
    re.IGNORECASE,
)


def refuse_unread(tree: dict[str, Any], pointer: str = "") -> None:
    """Raise `NoArea` if an object has members that a zone ignores, at any depth, also in a feature's geometry; the
    features of a collection are not examined.
    """
    found = [*_members(tree.get("geometry"), f"{pointer}/geometry"), *_members(tree, pointer)]
    if not found:
        return
    named = [f"a {what.value} at `{place}`" for place, what in found[:MOST_TOLD]]
    more = f" and {len(found) - MOST_TOLD} more" if len(found) > MOST_TOLD else ""
    raise NoArea(codes.GEOJSON_UNREAD, f"it has members that a zone ignores: {', '.join(named)}{more}", _HELP)


_HELP = (
    "write heights as `floor` and `ceiling`, times as `active`, a circle as `circle(...)` in the source, "
    "and remove these members from the file"
)


def refuse_height(numbers: list[str], pointer: str) -> None:
    """Raise `NoArea` if a position (RFC 7946, 3.1.1) has a third number other than zero."""
    for text in numbers[2:]:
        if Decimal(text):
            raise NoArea(
                codes.GEOJSON_UNREAD,
                f"the position at `{pointer}` has a height, {text}, which a zone ignores",
                "write heights as `floor` and `ceiling` in the source, and remove them from the positions of the file",
            )


def said_by(name: str) -> What | None:
    """Return the kind of a member by its name; None if it is harmless."""
    if name in _HARMLESS:
        return None
    words = {word.casefold() for word in _WORD.findall(name)}
    run = name.casefold().replace("_", "").replace("-", "").replace(" ", "")
    for what in _WORDS:
        if what is What.TIME and words & _OF_THE_RECORD:
            continue
        if words & _WORDS[what] or any(stem in run for stem in _STEMS[what]):
            return what
    return None


def _is_height(number: Any) -> bool:
    text = getattr(number, "text", None)
    return not isinstance(text, str) or bool(Decimal(text))


def _members(tree: Any, pointer: str) -> Iterator[tuple[str, What]]:
    if isinstance(tree, list):
        for number, each in enumerate(tree):
            yield from _members(each, f"{pointer}/{number}")
    if not isinstance(tree, dict):
        return
    for name, value in tree.items():
        place = f"{pointer}/{name.replace('~', '~0').replace('/', '~1')}"  # RFC 6901, 3
        if name == "bbox" and isinstance(value, list) and len(value) > 4:
            if any(_is_height(value[each]) for each in range(2, len(value), 3)):
                yield place, What.HEIGHT
        elif name in _STRUCTURE or value is None or value in ("", [], {}):
            continue
        elif (what := said_by(name)) is not None:
            yield place, what
        elif isinstance(value, str) and name not in _NAMES and _LENGTH.fullmatch(value):
            yield place, What.LENGTH
        else:
            yield from _members(value, place)


AREAS = ("Polygon", "MultiPolygon")
#: RFC 7946, 1.4
GEOMETRIES = ("Point", "MultiPoint", "LineString", "MultiLineString", *AREAS, "GeometryCollection")
#: names of the only reference system of RFC 7946, 4, in older files. EPSG 4326 has the latitude first; GeoJSON has the
#: longitude first, with any `crs` (GeoJSON 2008, 2.1.1)
_WGS84 = re.compile(
    r"urn:ogc:def:crs:OGC:[0-9.]*:CRS84|OGC:CRS84|(?:urn:ogc:def:crs:)?EPSG:(?:[0-9.]*:)?4326"
    r"|https?://www\.opengis\.net/(?:def/crs/OGC/1\.3/CRS84|def/crs/EPSG/0/4326|gml/srs/epsg\.xml#4326)|WGS ?84",
    re.IGNORECASE,
)
MOST_NAMED = 5


def chosen(tree: Any, feature: str | None) -> tuple[dict[str, Any], str]:
    """Return the selected Polygon or MultiPolygon, and the JSON pointer to it."""
    kind = tree.get("type") if isinstance(tree, dict) else None
    if not isinstance(kind, str) or kind not in (*GEOMETRIES, "Feature", "FeatureCollection"):
        raise NoArea(
            codes.NOT_GEOJSON,
            "it is JSON, but not a GeoJSON object",
            'a GeoJSON object has a `"type"`, such as `"FeatureCollection"` (RFC 7946, 3)',
        )
    reference_system(tree)
    if kind == "FeatureCollection":
        return _among(tree, feature)
    if kind == "Feature":
        if feature is not None and feature not in _names(tree):
            raise NoArea(codes.GEOJSON_SHAPE, f"its only feature is not named `{feature}`", _known([tree]))
        return _geometry(tree, "")
    if feature is not None:
        raise NoArea(codes.GEOJSON_SHAPE, f"it is a {kind} without features", "remove `feature`")
    refuse_unread(tree)
    return _area(tree, "")


def _among(tree: dict[str, Any], feature: str | None) -> tuple[dict[str, Any], str]:
    """The feature of that name, or the only area."""
    features = tree.get("features")
    if not isinstance(features, list):
        raise NoArea(codes.NOT_GEOJSON, "its `/features` is not an array (RFC 7946, 3.3)")
    for number, each in enumerate(features):
        if not isinstance(each, dict) or each.get("type") != "Feature":
            raise NoArea(codes.NOT_GEOJSON, f"its `/features/{number}` is not a Feature (RFC 7946, 3.3)")
    if feature is None:
        found = [number for number, each in enumerate(features) if _is_area(each.get("geometry"))]
        what = "are areas"
    else:
        found = [number for number, each in enumerate(features) if feature in _names(each)]
        what = f"are named `{feature}`"
    if len(found) == 1:
        refuse_unread(tree)
        return _geometry(features[found[0]], f"/features/{found[0]}")
    if feature is not None and not found:
        raise NoArea(codes.GEOJSON_SHAPE, f"no feature is named `{feature}`", _known(features, feature))
    raise NoArea(
        codes.GEOJSON_SHAPE,
        f"{len(found) or 'none'} of its {len(features)} features {what}",
        _known([features[number] for number in found]) if feature is None else "give each feature a unique id",
    )


def _geometry(feature: dict[str, Any], pointer: str) -> tuple[dict[str, Any], str]:
    """RFC 7946, 3.2: the geometry of a Feature is a geometry object, or null without a place."""
    reference_system(feature)
    refuse_unread(feature, pointer)
    geometry = feature.get("geometry")
    if geometry is None:
        raise NoArea(codes.GEOJSON_SHAPE, f"the feature at `{pointer or '/'}` has no geometry")
    return _area(geometry, f"{pointer}/geometry")


def _area(geometry: Any, pointer: str) -> tuple[dict[str, Any], str]:
    kind = geometry.get("type") if isinstance(geometry, dict) else None
    if kind not in GEOMETRIES:
        raise NoArea(codes.NOT_GEOJSON, f"its `{pointer}` is not a geometry (RFC 7946, 3.1)")
    if kind not in AREAS:
        raise NoArea(
            codes.GEOJSON_SHAPE,
            f"the geometry at `{pointer or '/'}` is a {kind}",
            "a zone is read from a Polygon or a MultiPolygon",
        )
    assert isinstance(geometry, dict)
    reference_system(geometry)
    return geometry, pointer


def _is_area(geometry: Any) -> bool:
    """Whether a geometry may describe a zone, also one that is refused later, such as a circle of ED-318."""
    if not isinstance(geometry, dict):
        return False
    inner = geometry.get("geometries")
    return (
        geometry.get("type") in AREAS
        or (geometry.get("type") == "Point" and bool(geometry.get("extent")))
        or (geometry.get("type") == "GeometryCollection" and isinstance(inner, list) and any(map(_is_area, inner)))
    )


def _names(feature: dict[str, Any]) -> Iterator[str]:
    """The names of a feature: its id, a string or a number (RFC 7946, 3.2), and its property `name`."""
    properties = feature.get("properties")
    for each in (feature.get("id"), properties.get("name") if isinstance(properties, dict) else None):
        text = getattr(each, "text", each)
        if isinstance(text, str):
            yield text


def _known(features: list[dict[str, Any]], wanted: str | None = None) -> str | None:
    """A help with the names of the features."""
    names = [name for name in dict.fromkeys(name for each in features for name in _names(each)) if name.isprintable()]
    near = None if wanted is None else nearest(wanted, names)
    if near is not None:
        return f"did you mean `{near}`?"
    if not names:
        return "give the feature an `id`, or a property `name`"
    more = "" if len(names) <= MOST_NAMED else f" and {len(names) - MOST_NAMED} more"
    return "select one with `feature`: " + ", ".join(f"`{name}`" for name in names[:MOST_NAMED]) + more


def reference_system(tree: dict[str, Any]) -> None:
    """Raise `NoArea` if an object names another reference system than WGS 84. RFC 7946, 4: all positions are WGS 84. A
    `crs` of an older file must be the same (GeoJSON 2008, 3).
    """
    crs = tree.get("crs")
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if crs is not None and not (isinstance(name, str) and _WGS84.fullmatch(name)):
        shown = f" `{name}`" if isinstance(name, str) and name.isprintable() and len(name) < 80 else ""
        raise NoArea(
            codes.GEOJSON_SHAPE,
            f"its `crs`{shown} is not WGS 84, the only reference system of GeoJSON",
            "convert it to longitudes and latitudes in WGS 84 (RFC 7946, 4)",
        )


#: the MultiPolygon of a FeatureCollection needs nine levels; foreign members (RFC 7946, 6.1) may need more
MAX_DEPTH = 32
#: the most objects, lists, strings and numbers of a file, without keys and positions. The number of positions is only
#: limited by the size of the file, because borders of countries have hundreds of thousands. Only those of the selected
#: area are read
MAX_VALUES = 250_000
#: characters of a number: a double needs no more than 24
MAX_NUMBER = 64
MAX_EXPONENT = 3  # digits; that of a double has no more
#: the local projection is not valid nearer to a pole
MAX_LATITUDE, MAX_LONGITUDE = 85, 180
#: adjacent positions stay unparsed until they are needed: reading all of the millions in a file takes seconds and
#: hundreds of megabytes. The pattern keeps a place for each of its repetitions
_RUN = 1_000
_SPACE = rb"[ \t\n\r]*+"
_NUMBER = rb"%b-?(?:0|[1-9][0-9]*+)(?:\.[0-9]++)?(?:[eE][+-]?[0-9]++)?%b" % (_SPACE, _SPACE)
_POSITION = rb"\[%b,%b(?:,%b)?\]" % (_NUMBER, _NUMBER, _NUMBER)
#: a string, or the beginning of one; a number that is invalid in JSON; a run of positions
_PART = re.compile(rb'"[^"]*+"?|NaN|%b(?:%b,%b%b){0,%d}' % (_POSITION, _SPACE, _SPACE, _POSITION, _RUN - 1))
#: the stand-in for a run while the rest is parsed
_STAND_IN = "NaN"
_DEGREE = Decimal(10_000_000)
_AS_BRACKETS = bytes.maketrans(b"{}", b"[]")
_NO_BRACKETS = bytes(each for each in range(256) if each not in b"[]{}")

#: the corners of one ring as (longitude, latitude) in 1e-7 degree, without the closing corner
GeoRing = tuple[Point, ...]


@dataclass(frozen=True, slots=True)
class GeoPolygon:
    """An exterior ring and its holes."""

    outer: GeoRing
    holes: tuple[GeoRing, ...]


class Number(msgspec.Struct, frozen=True, gc=False):
    """A number as written."""

    text: str


class Run(msgspec.Struct, frozen=True, eq=False, gc=False):
    """Adjacent positions in a text, unparsed, from `start` to `end`."""

    data: bytes
    start: int
    end: int

    def count(self) -> int:
        """The number of positions."""
        return self.data.count(b"[", self.start, self.end)

    def read(self) -> list[list[Number]]:
        """Parse the positions. Raises `NoArea` if a number is too long."""
        found: list[list[Number]] = _read(f"[{self.data[self.start : self.end].decode()}]", _no_number)
        return found


def _not_json(message: str) -> NoArea:
    return NoArea(codes.NOT_GEOJSON, message)


def read_area(data: bytes, feature: str | None) -> tuple[GeoPolygon, ...]:
    """Return the polygons of the only area in a file, or of the feature with that id or name; raises `NoArea`."""
    kind = recognised(data)
    if kind is not None and kind is not GEOJSON:
        raise NoArea(codes.NOT_GEOJSON, f"it is {kind.name}, not GeoJSON", kind.help or None)
    geometry, pointer = chosen(_json(data), feature)
    return _polygons(geometry, pointer)


def polygon_of(rings: Sequence[Any], pointer: str) -> GeoPolygon:
    """A polygon from its rings as in a file, of positions whose values are `Number`; raises `NoArea`."""
    return _polygon(rings, pointer)


# ------------------------------------------------------------------------------------------------------------ JSON


def read_json(data: bytes) -> Any:
    """Parse the JSON of a file with the same limits and the same strictness as an area; numbers are `Number`. Raises
    `NoArea`.
    """
    tree = _json(data)
    if _positions(tree) > MAX_VALUES:
        raise _not_json(f"it has more than {MAX_VALUES} positions: remove the features that are not needed")
    return _all_laid_out(tree)


def _json(data: bytes) -> Any:
    """Parse JSON. Numbers stay as written, and adjacent positions are a `Run`."""
    try:
        data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise _not_json(f"byte {error.start} (0x{data[error.start]:02x}) is not UTF-8") from error
    outline = _Outline(data.removeprefix(BOM_UTF8))  # RFC 8259, 8.1: a parser may ignore a byte order mark
    bare = bare_of(outline.text, MAX_VALUES)
    if bare is None or values_of(bare) > MAX_VALUES:
        raise _too_many()
    if _too_deep(bare):
        raise _nested()
    runs = outline.runs()

    def constant(name: str) -> Run:
        run = next(runs) if name == _STAND_IN else None
        if run is None or not run.count():
            raise _no_number(name)
        return run

    text = outline.text.decode()
    try:
        return _read(text, constant)
    except json.JSONDecodeError as error:
        line, column = outline.place(len(text[: error.pos].encode()))
        raise _not_json(f"line {line}, column {column}: {error.msg[0].lower()}{error.msg[1:]}") from error


class _Outline:
    """A text with a stand-in for each run of positions. Raises `NoArea` for too many runs.

    A stand-in that the text itself has is an empty run.
    """

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._starts, self._ends = array("L"), array("L")
        bare = bare_of(data, MAX_VALUES)
        if bare is None:
            raise _too_many()
        if (
            sum(map(bare.count, (b"[", b"{"))) - sum(map(bare.count, (b"]", b"}"))) > MAX_DEPTH
        ):  # quicker than to search
            raise _too_many() if values_of(bare) > MAX_VALUES else _nested()
        del bare
        made, at = bytearray(), 0
        # a quote within a text ends none; what is masked is as long as before
        masked = data.replace(b"\\\\", b"__").replace(b'\\"', b"__") if b"\\" in data else data
        for part in _PART.finditer(masked):
            start = part.start()
            if masked[start] == ord('"'):
                continue
            made += data[at:start]
            made += _STAND_IN.encode()
            at = part.end()
            self._starts.append(start)
            self._ends.append(at)
            if len(self._starts) > MAX_VALUES:
                raise _too_many()
        made += data[at:]
        self.text = bytes(made)

    def runs(self) -> Iterator["Run"]:
        """The runs of the stand-ins, in order."""
        return (Run(self._data, start, end) for start, end in zip(self._starts, self._ends, strict=True))

    def place(self, position: int) -> tuple[int, int]:
        """The line and column of the original text, from 1, at a byte of the text with stand-ins."""
        shorter = 0
        for start, end in zip(self._starts, self._ends, strict=True):
            if start - shorter >= position:
                break
            shorter += end - start - len(_STAND_IN)
        before = self._data[: position + shorter]
        return before.count(b"\n") + 1, len(before[before.rfind(b"\n") + 1 :].decode()) + 1


def _read(text: str, constant: Callable[[str], Any]) -> Any:
    return json.loads(text, parse_float=_number, parse_int=_number, parse_constant=constant, object_pairs_hook=_object)


def _too_many() -> NoArea:
    return _not_json(
        f"it has more than {MAX_VALUES} values besides its positions: remove the features that are not needed"
    )


def _nested() -> NoArea:
    return _not_json(f"it is nested more than {MAX_DEPTH} levels deep")


def _too_deep(bare: bytes) -> bool:
    """Whether brackets are nested too deep, in a text without strings and positions.

    Each round removes all innermost pairs at once, because one at a time takes seconds. Unbalanced brackets remain, and
    the JSON parser reports them.
    """
    left = bare.translate(_AS_BRACKETS, _NO_BRACKETS)
    for _ in range(MAX_DEPTH):
        if not left:
            return False
        left = left.replace(b"[]", b"")
    return b"[]" in left or left.count(b"[") > MAX_DEPTH


def _number(text: str) -> Number:
    if len(text) > MAX_NUMBER:
        raise _not_json(f"the number `{text[:20]}...` has more than {MAX_NUMBER} characters")
    if len(text.lower().partition("e")[2].lstrip("+-")) > MAX_EXPONENT:
        raise _not_json(f"the exponent of `{text}` has more than {MAX_EXPONENT} digits")
    return Number(text)


def _no_number(text: str) -> NoArea:
    return _not_json(f"`{text}` is not a number in JSON")  # RFC 8259, 6


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made: dict[str, Any] = {}
    for key, value in pairs:
        if key in made:  # RFC 7493, 2.3: names must be unique; RFC 8259 does not define repeated ones
            raise _not_json(f"an object repeats the key `{key}`")
        if isinstance(value, Run) and value.count() > 1:
            raise _not_json(f"the key `{key}` has several values without brackets")
        made[key] = value
    return made


# ------------------------------------------------------------------------------------------------------- geometries


def _polygons(geometry: dict[str, Any], pointer: str) -> tuple[GeoPolygon, ...]:
    """The polygons of a Polygon (RFC 7946, 3.1.6) or a MultiPolygon (3.1.7)."""
    pointer = f"{pointer}/coordinates"
    written = geometry.get("coordinates")
    count = _count(written)
    if count > MAX_VERTICES + MAX_RINGS:  # the exact limit is checked in the local plane
        raise NoArea(
            codes.GEOJSON_SHAPE,
            f"the area at `{pointer}` has {count:,} positions; the limit is {MAX_VERTICES:,} corners",
            "simplify the outline",
        )
    coordinates = _array(_laid_out(written), pointer)
    if geometry["type"] == "Polygon":
        return (_polygon(coordinates, pointer),)
    found = tuple(_polygon(_array(each, f"{pointer}/{i}"), f"{pointer}/{i}") for i, each in enumerate(coordinates))
    if not found:
        raise NoArea(codes.GEOJSON_SHAPE, f"`{pointer}` has no polygon")
    return found


def _count(value: Any) -> int:
    """The number of positions."""
    if isinstance(value, Run):
        return value.count()
    return sum(map(_count, value)) if isinstance(value, list) else 0


def _laid_out(value: Any) -> Any:
    """A value with its runs parsed into the lists that contain them."""
    if isinstance(value, Run):
        return value.read()[0]
    if not isinstance(value, list):
        return value
    made: list[Any] = []
    for each in value:
        if isinstance(each, Run):
            made += each.read()
        else:
            made.append(_laid_out(each))
    return made


def _positions(tree: Any) -> int:
    """The number of positions anywhere in a tree."""
    return sum(map(_positions, tree.values())) if isinstance(tree, dict) else _listed_positions(tree)


def _listed_positions(tree: Any) -> int:
    if isinstance(tree, Run):
        return tree.count()
    return sum(map(_positions, tree)) if isinstance(tree, list) else 0


def _all_laid_out(tree: Any) -> Any:
    """A tree with the runs of all its lists parsed."""
    if isinstance(tree, dict):
        return {name: _all_laid_out(each) for name, each in tree.items()}
    if not isinstance(tree, list):
        return _laid_out(tree)
    return [_all_laid_out(each) if isinstance(each, dict | list) else each for each in _laid_out(tree)]


def _polygon(rings: Sequence[Any], pointer: str) -> GeoPolygon:
    """RFC 7946, 3.1.6: the first ring is the exterior ring, all others are holes."""
    made = [_ring(_array(ring, f"{pointer}/{i}"), f"{pointer}/{i}") for i, ring in enumerate(rings)]
    if not made:
        raise NoArea(codes.GEOJSON_SHAPE, f"`{pointer}` has no ring")
    _holes(made, pointer)
    return GeoPolygon(made[0], tuple(made[1:]))


def _holes(rings: Sequence[GeoRing], pointer: str) -> None:
    """RFC 7946, 3.1.6, as for a polygon in a source: all holes are inside the exterior ring and do not overlap."""
    met = touching_edges(rings)
    if met is not None:
        (one, i), (other, j) = met
        raise NoArea(
            codes.GEOJSON_SHAPE,
            f"the hole at `{pointer}/{max(one, other)}` crosses or touches the ring at `{pointer}/{min(one, other)}`: "
            f"the edge from {_written(rings[one][i])} meets the one from {_written(rings[other][j])}",
            "a hole must be inside the polygon and outside all other holes",
        )
    for number, hole in enumerate(rings[1:], 1):
        around = next((i for i, each in enumerate(rings[1:], 1) if i != number and contains(each, hole[0])), None)
        if around is not None or not contains(rings[0], hole[0]):
            where = (
                f"outside its polygon, `{pointer}/0`" if around is None else f"inside the hole at `{pointer}/{around}`"
            )
            raise NoArea(
                codes.GEOJSON_SHAPE,
                f"the hole at `{pointer}/{number}` is {where}",
                "a hole must be inside the polygon and outside all other holes",
            )


def _ring(positions: Sequence[Any], pointer: str) -> GeoRing:
    """RFC 7946, 3.1.6: a closed line of four or more positions, the first and last identical. Either orientation is
    accepted: parsers should not reject polygons that do not follow the right-hand rule.
    """
    if len(positions) < 4:
        raise NoArea(
            codes.GEOJSON_SHAPE,
            f"the ring at `{pointer}` has fewer than four positions",
            "a ring ends with its first position (RFC 7946, 3.1.6)",
        )
    corners = [_position(_array(each, f"{pointer}/{i}"), f"{pointer}/{i}") for i, each in enumerate(positions)]
    if corners[0] != corners[-1]:
        raise NoArea(
            codes.GEOJSON_SHAPE,
            f"the ring at `{pointer}` is not closed",
            "a ring ends with its first position (RFC 7946, 3.1.6)",
        )
    for i, (a, b) in enumerate(pairwise(corners)):
        if abs(a[0] - b[0]) > MAX_LONGITUDE * int(_DEGREE):
            raise NoArea(
                codes.GEOJSON_SHAPE,
                f"the ring at `{pointer}` crosses the antimeridian after its position {i}",
                "cut the area at longitude 180 into two parts of a MultiPolygon (RFC 7946, 3.1.9)",
            )
    ring = [a for a, b in pairwise(corners) if a != b]
    if len(ring) < 3:
        raise NoArea(codes.GEOJSON_SHAPE, f"the ring at `{pointer}` encloses no area")
    met = crossing(ring)
    if met is not None:
        one, other = (_written(ring[i]) for i in met)
        raise NoArea(
            codes.GEOJSON_SHAPE,
            f"the ring at `{pointer}` crosses or touches itself: its edge from {one} meets the one from {other}",
        )
    return tuple(ring)


def _position(numbers: Sequence[Any], pointer: str) -> Point:
    """RFC 7946, 3.1.1: longitude, latitude, and an optional altitude, which must be zero: the source has the floor and
    ceiling of a zone. WGS 84 by section 4.
    """
    if len(numbers) < 2 or not all(isinstance(each, Number) for each in numbers):
        raise NoArea(
            codes.GEOJSON_SHAPE,
            f"`{pointer}` is not a position",
            "a position is a longitude and a latitude, as in `[8.5456, 47.3977]` (RFC 7946, 3.1.1)",
        )
    refuse_height([each.text for each in numbers], pointer)
    longitude, latitude = (Decimal(each.text) for each in numbers[:2])
    north, east = latitude.copy_abs(), longitude.copy_abs()  # exact; `abs` rounds
    if north > MAX_LATITUDE or east > MAX_LONGITUDE:
        swapped = east <= MAX_LATITUDE and north <= MAX_LONGITUDE
        raise NoArea(
            codes.GEOJSON_SHAPE,
            f"`{pointer}` is {longitude}, {latitude}, outside the supported coordinates",
            "the longitude comes first (RFC 7946, 3.1.1)"
            if swapped
            else "longitudes are from -180 to 180, latitudes from -85 to 85",
        )
    return _whole(longitude), _whole(latitude)


def _whole(degrees: Decimal) -> int:
    """Degrees in 1e-7 degree, rounded to the nearest, half to even; exact, because the context has enough digits."""
    with localcontext(prec=4 * MAX_NUMBER, rounding=ROUND_HALF_EVEN):
        if degrees.adjusted() < -MAX_NUMBER:
            return 0
        return int((degrees * _DEGREE).to_integral_value())


def _array(value: Any, pointer: str) -> Sequence[Any]:
    if isinstance(value, list):
        return value
    raise NoArea(codes.GEOJSON_SHAPE, f"`{pointer}` is not an array")


def _written(corner: Point) -> str:
    """A position as written in a file."""
    longitude, latitude = (Decimal(each) / _DEGREE for each in corner)
    return f"[{longitude}, {latitude}]"


class DataFiles:
    """The zone files: `content` has their bytes by name, `names` maps a source and the written path to a name."""

    def __init__(
        self, content: Mapping[str, bytes] | None = None, names: Mapping[tuple[str, str], str] | None = None
    ) -> None:
        self.content = content or {}
        self._names = names or {}
        self._areas: dict[tuple[str, str | None], tuple[GeoPolygon, ...] | NoArea] = {}

    def name(self, shape: GeoJson) -> str | None:
        """The name of a zone's file; None if it could not be read."""
        return self._names.get((shape.span.file, shape.path))

    def area(self, shape: GeoJson) -> tuple[GeoPolygon, ...] | NoArea | None:
        """The polygons of a zone, or the reason why there are none; None if the file could not be read."""
        name = self.name(shape)
        if name is None:
            return None
        key = (name, shape.feature)
        found = self._areas.get(key)
        if found is None:
            try:
                found = read_area(self.content[name], shape.feature)
            except NoArea as refused:
                found = refused
            self._areas[key] = found
        return found
