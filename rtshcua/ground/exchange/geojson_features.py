"""The features of a GeoJSON file as zones: ED-318, airspaces of OpenAIP, airspace and facility maps of the FAA, plain
areas.

Of each form the members are read that say where and when an airspace is. A feature with any other member that may be a
height, a time or a radius is not kept, as a zone that names such a file is refused (E0115).
"""

import re
from collections.abc import Iterator, Sequence
from decimal import Decimal
from typing import Any, Final, NamedTuple

from rtshcua.ground.checker.geojson import (
    AREAS,
    NoArea,
    Number,
    polygon_of,
    reference_system,
    refuse_unread,
)
from rtshcua.ground.exchange.losses import Loss, NotReadable
from rtshcua.ground.exchange.qgc_reading import degrees_e7
from rtshcua.ground.exchange.zone_features import (
    GROUND,
    PRESSURE,
    SEA,
    Limit,
    Period,
    UnkeptFeature,
    ZoneFeature,
    period_of,
)
from rtshcua.ground.exchange.zone_source import corridor_text, polygons_text

_METRE, _FOOT = Decimal(1000), Decimal("304.8")
#: units and datums, as OpenAIP numbers and names them, and as the FAA names them; None: a flight level
_UNITS: Final[dict[str, Decimal | None]] = {
    "0": _METRE, "M": _METRE, "1": _FOOT, "FT": _FOOT, "F": _FOOT, "6": None, "FL": None,
}  # fmt: skip
_DATUMS: Final = {
    "0": GROUND, "GND": GROUND, "AGL": GROUND, "SFC": GROUND, "1": SEA, "MSL": SEA, "AMSL": SEA, "2": PRESSURE,
    "STD": PRESSURE,
}  # fmt: skip
#: texts of the FAA that mean always, and the number that means no limit
_ALWAYS: Final = ("CONT", "CONTINUOUS", "H24", "24/7")
_FAA_UNLIMITED: Final = -9998
#: members of OpenAIP that say that the times are not in the file
_BY_NOTAM: Final = ("onDemand", "onRequest", "byNotam")
_WIDTH_HELP: Final = "state how wide its corridor is: `--width 20` in m"


class _Band(NamedTuple):
    """What a form says of a feature: its limits, comments, the members that were read, and its periods."""

    floor: Limit | None
    ceiling: Limit | None
    comments: tuple[str, ...]
    read: tuple[str, ...]
    periods: tuple[Period, ...] = ()


def features_of(tree: Any) -> list[tuple[str, dict[str, Any]]]:
    """The features of a file, each with its pointer. Raises `NotReadable`."""
    if isinstance(tree, dict) and isinstance(tree.get("items"), list):  # an answer of the API of OpenAIP
        items = [(f"/items/{number}", each) for number, each in enumerate(tree["items"])]
        return [(place, _as_feature(place, each)) for place, each in items]
    kind = tree.get("type") if isinstance(tree, dict) else None
    if kind == "Feature":
        return [("/", tree)]
    if kind in (*AREAS, "LineString"):
        return [("/", {"type": "Feature", "properties": {}, "geometry": tree})]
    if kind == "FeatureCollection":
        return list(_collected(tree))
    raise NotReadable("it is no feature collection of GeoJSON", "imported are features with areas and lines")


def _collected(tree: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """The features of a collection."""
    try:
        reference_system(tree)
    except NoArea as error:
        raise NotReadable(error.message, error.help or "") from None
    features = tree.get("features")
    for number, each in enumerate(features if isinstance(features, list) else [None]):
        if not isinstance(each, dict) or each.get("type") != "Feature":
            raise NotReadable(f"`/features/{number}` is not a Feature (RFC 7946, 3.3)")
        yield f"/features/{number}", each


def _as_feature(place: str, item: Any) -> dict[str, Any]:
    if not isinstance(item, dict):
        raise NotReadable(f"`{place}` is not an object")
    properties = {name: value for name, value in item.items() if name != "geometry"}
    return {"type": "Feature", "properties": properties, "geometry": item.get("geometry")}


def read_feature(feature: dict[str, Any], place: str, width_mm: int | None, use: str) -> ZoneFeature:
    """The zone of a feature that is not of ED-318. `use`: what a plain area is for."""
    properties = feature.get("properties")
    properties = properties if isinstance(properties, dict) else {}
    made = ZoneFeature(_name(feature, properties, place), place)
    try:
        band = _band(properties)
        made.floor, made.ceiling, made.comments = band.floor, band.ceiling, band.comments
        made.periods = band.periods
        rest = {name: value for name, value in properties.items() if name not in band.read}
        refuse_unread({**feature, "properties": rest}, place.rstrip("/"))
        made.shape = _shape(feature.get("geometry"), f"{place.rstrip('/')}/geometry", width_mm)
        if not band.read:
            made.use = use
            made.losses.append(Loss("no-height", place, "an area on the ground"))
    except UnkeptFeature as error:
        made.refused = error.why
    except NoArea as error:
        made.refused = error.message, error.help or ""
    return made


def is_ed269(tree: Any) -> bool:
    """Whether a file is one of ED-269, whose features are no features of GeoJSON."""
    features = tree if isinstance(tree, list) else tree.get("features", tree.get("UASZoneList"))
    return isinstance(features, list) and any(
        isinstance(each, dict) and "type" in each and each["type"] != "Feature" and "restriction" in each
        for each in features
    )


def is_ed269_feature(feature: Any) -> bool:
    """Whether a feature of GeoJSON has the members of ED-269 as its properties, as some national feeds write them."""
    properties = feature.get("properties") if isinstance(feature, dict) else None
    return isinstance(properties, dict) and {"restriction", "applicability", "geometry"} <= properties.keys()


def is_ed318(feature: Any) -> bool:
    """Whether a feature of GeoJSON is a zone of ED-318."""
    properties = feature.get("properties") if isinstance(feature, dict) else None
    return (
        isinstance(properties, dict)
        and "type" in properties
        and bool({"variant", "limitedApplicability", "zoneAuthority"} & properties.keys())
    )


def is_point(feature: dict[str, Any]) -> bool:
    """Whether a feature is a point, which is no area."""
    geometry = feature.get("geometry")
    return isinstance(geometry, dict) and geometry.get("type") in ("Point", "MultiPoint") and "extent" not in geometry


def _name(feature: dict[str, Any], properties: dict[str, Any], place: str) -> str:
    found = (properties.get("name"), properties.get("NAME"), properties.get("title"), feature.get("id"))
    return next((each for each in found if isinstance(each, str) and each.strip()), place)


def _shape(geometry: Any, pointer: str, width_mm: int | None) -> str:
    kind = geometry.get("type") if isinstance(geometry, dict) else None
    if not isinstance(geometry, dict):
        raise UnkeptFeature("it has no geometry")
    reference_system(geometry)
    coordinates = geometry.get("coordinates")
    if not isinstance(coordinates, list):
        raise UnkeptFeature("its coordinates are not an array")
    if kind == "Polygon":
        return polygons_text([polygon_of(coordinates, f"{pointer}/coordinates")])
    if kind == "MultiPolygon" and coordinates and all(isinstance(each, list) for each in coordinates):
        return polygons_text([polygon_of(each, f"{pointer}/coordinates/{n}") for n, each in enumerate(coordinates)])
    if kind == "LineString":
        return line_text([_position(each) for each in coordinates], width_mm)
    raise UnkeptFeature(f"its geometry is a {kind}, which is no area")


def line_text(line: Sequence[tuple[int, int]], width_mm: int | None) -> str:
    """A corridor along a line of places in 1e-7 degree, longitude first."""
    if width_mm is None:
        raise UnkeptFeature("it is a line, which has no width", _WIDTH_HELP)
    if len(line) < 2:
        raise UnkeptFeature("its line has fewer than two places")
    return corridor_text(line, width_mm)


def _position(written: Any) -> tuple[int, int]:
    numbers = written if isinstance(written, list) else []
    if not 2 <= len(numbers) <= 3 or not all(isinstance(each, Number) for each in numbers):
        raise UnkeptFeature("a position is not a longitude and a latitude")
    if len(numbers) == 3 and Decimal(numbers[2].text):
        raise UnkeptFeature("its positions have heights, which a zone ignores")
    longitude, latitude = (Decimal(each.text) for each in numbers[:2])
    return place_of(longitude, latitude)


def place_of(longitude: Decimal, latitude: Decimal) -> tuple[int, int]:
    """A place in 1e-7 degree, longitude first."""
    if abs(latitude) > 85 or abs(longitude) > 180:
        raise UnkeptFeature("a position is not on the globe, or too near to a pole")
    return degrees_e7(longitude), degrees_e7(latitude)


# ---------------------------------------------------------------- forms


def _band(properties: dict[str, Any]) -> _Band:
    """The limits of a feature, in the form of its members."""
    if "NOTAM_KEY" in properties:  # a temporary restriction of the FAA
        raise UnkeptFeature("its heights and times are in a notice, not in the file", "write it from the notice")
    for forms in (_openaip, _faa_airspace, _faa_facility_map):
        found = forms(properties)
        if found is not None:
            return found
    return _Band(None, None, (), ())


def _openaip(properties: dict[str, Any]) -> _Band | None:
    """An airspace of OpenAIP: `upperLimit` of its API, `upperCeiling` of its parser."""
    for high, low in (("upperLimit", "lowerLimit"), ("upperCeiling", "lowerCeiling")):
        if isinstance(properties.get(high), dict) and isinstance(properties.get(low), dict):
            break
    else:
        return None
    if any(properties.get(name) is True for name in _BY_NOTAM):
        raise UnkeptFeature("it is active by notice, at times that are not in the file")
    hours = properties.get("hoursOfOperation")
    if hours is not None and not _is_always(hours):
        raise UnkeptFeature("its hours of operation are local or by notice, which the file does not place in time")
    comments = tuple(f"{name} {value}" for name in ("class", "icaoClass", "type") if (value := _text(properties, name)))
    read = (high, low, "hoursOfOperation", "activationTimes", *_BY_NOTAM)
    periods = tuple(_activations(properties.get("activationTimes") or []))
    return _Band(_openaip_limit(properties[low]), _openaip_limit(properties[high]), comments, read, periods)


def _activations(written: Any) -> Iterator[Period]:
    """The periods of an airspace that is activated at times."""
    for each in written if isinstance(written, list) else [None]:
        if not isinstance(each, dict) or not (each.get("start") or each.get("end")):
            raise UnkeptFeature("its activation times are not stated")
        yield period_of(each.get("start"), each.get("end"))


def _openaip_limit(written: dict[str, Any]) -> Limit:
    return _limit(_number(written.get("value")), _text(written, "unit"), _text(written, "referenceDatum"))


def _is_always(hours: Any) -> bool:
    """Whether hours of operation are all hours of all days."""
    days = hours.get("operatingHours") if isinstance(hours, dict) else None
    if not isinstance(days, list) or len(days) < 7:
        return False
    whole = [
        isinstance(each, dict)
        and each.get("startTime") == "00:00"
        and each.get("endTime") in ("00:00", "23:59", "24:00")
        and not any(each.get(name) for name in ("byNotam", "sunrise", "sunset", "publicHolidaysExcluded"))
        for each in days
    ]
    return all(whole) and len({_text(each, "dayOfWeek") for each in days}) == 7


def _faa_airspace(properties: dict[str, Any]) -> _Band | None:
    """A class or special use airspace of the FAA: UPPER_VAL, UPPER_UOM, UPPER_CODE and the same of LOWER."""
    if "UPPER_VAL" not in properties or "LOWER_VAL" not in properties:
        return None
    times = properties.get("TIMESOFUSE")
    if times not in (None, "") and str(times).strip().upper().rstrip(".") not in _ALWAYS:
        raise UnkeptFeature("its times of use are a text, which the import does not interpret")
    floor, ceiling = (_faa_limit(properties, side) for side in ("LOWER", "UPPER"))
    if floor is None:
        raise UnkeptFeature("it has no lower limit")
    comments = tuple(f"{name} {value}" for name in ("CLASS", "TYPE_CODE") if (value := _text(properties, name)))
    read = tuple(f"{side}_{what}" for side in ("LOWER", "UPPER") for what in ("VAL", "UOM", "CODE", "DESC"))
    return _Band(floor, ceiling, comments, (*read, "TIMESOFUSE", "LEVEL_CODE", "Shape__Area", "Shape__Length"))


def _faa_limit(properties: dict[str, Any], side: str) -> Limit | None:
    """A limit of an airspace of the FAA; None if it has none."""
    value, code = properties[f"{side}_VAL"], _text(properties, f"{side}_CODE")
    number = _number(Number(value) if _is_number(value) else value)
    if number == _FAA_UNLIMITED:
        return None
    if number == 0 and code in ("SFC", ""):
        return Limit(0, GROUND)
    return _limit(number, _text(properties, f"{side}_UOM"), code)


def _faa_facility_map(properties: dict[str, Any]) -> _Band | None:
    """A cell of a facility map of the FAA: above CEILING, in ft above ground, an authorisation is needed."""
    if "CEILING" not in properties or not {"APT1_ICAO", "APT1_FAAID", "APT1_NAME", "MAP_EFF"} & properties.keys():
        return None
    floor = _limit(_number(properties["CEILING"]), "FT", "AGL")
    comments = (f"facility map: an authorisation is needed above {_text(properties, 'CEILING')} ft above ground",)
    read = ("CEILING", "MAP_EFF", "LAST_EDIT", "UNIT", "EFFECTIVE", "Shape__Area", "Shape__Length")
    return _Band(floor, None, comments, read)


def _limit(value: Decimal, unit: str, datum: str) -> Limit:
    if unit not in _UNITS or datum not in _DATUMS:
        raise UnkeptFeature(f"a limit has the unit `{unit[:12]}` and the datum `{datum[:12]}`, which are not known")
    scale = _UNITS[unit]
    if scale is None or _DATUMS[datum] == PRESSURE:
        return Limit(0, PRESSURE)
    if abs(value) > 1_000_000:
        raise UnkeptFeature("a limit is out of range")
    return Limit(round(value * scale), _DATUMS[datum])


def _number(written: Any) -> Decimal:
    if not isinstance(written, Number):
        raise UnkeptFeature("a limit is not a number")
    return Decimal(written.text)


def _is_number(written: Any) -> bool:
    """Whether a text is a number, as some exports write them."""
    return isinstance(written, str) and re.fullmatch(r"-?[0-9]{1,9}(\.[0-9]{1,6})?", written, re.ASCII) is not None


def _text(properties: dict[str, Any], name: str) -> str:
    """A member as text, in capitals; empty if it is none."""
    value = properties.get(name)
    found = getattr(value, "text", value)
    return found.strip().upper() if isinstance(found, str) else ""


def read_point(feature: dict[str, Any], place: str) -> Loss | ZoneFeature:
    """A point is a loss; but one with a radius, a height or a time may stand for an area, and is not kept."""
    properties = feature.get("properties")
    name = _name(feature, properties if isinstance(properties, dict) else {}, place)
    try:
        refuse_unread(feature, place.rstrip("/"))
    except NoArea as error:
        return ZoneFeature(name, place, refused=(error.message, error.help or ""))
    return Loss("point", place, name)
