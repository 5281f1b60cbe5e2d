"""UAS geographical zones of ED-269 and ED-318: volumes with limits by datum, circles, periods, and kinds of
restriction.

The members that decide where and when a zone is are validated by the types of `uas-standards` (the extra `import`);
their numbers are read from the file itself, without floats. Members that a zone does not need, such as the authority's
address, are not validated, because many published files lack them or write them in their own way.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from decimal import Decimal
from typing import Any, Final

from implicitdict import ImplicitDict
from uas_standards import eurocae_ed269, eurocae_ed318

from rtshcua.ground.checker.geojson import NoArea, Number, polygon_of
from rtshcua.ground.exchange.losses import Loss, NotReadable
from rtshcua.ground.exchange.qgc_reading import degrees_e7
from rtshcua.ground.exchange.zone_features import (
    NO_USE,
    OUTSIDE,
    Hours,
    Limit,
    Period,
    UnkeptFeature,
    ZoneFeature,
    period_of,
)
from rtshcua.ground.exchange.zone_source import circle_text, polygons_text

#: mm in a unit
UNITS_MM: Final = {"M": Decimal(1000), "FT": Decimal("304.8"), "KM": Decimal(1_000_000), "NM": Decimal(1_852_000)}
#: what a zone is for, by the kind of its restriction
_USE: Final = {"PROHIBITED": OUTSIDE, "REQ_AUTHORISATION": OUTSIDE, "CONDITIONAL": OUTSIDE, "USPACE": OUTSIDE,
               "NO_RESTRICTION": NO_USE}  # fmt: skip
_AUTHORISED: Final = ("REQ_AUTHORISATION", "USPACE")
_DAYS: Final = ("MON", "TUE", "WED", "THU", "FRI", "SAT", "SUN")
_TIME: Final = re.compile(
    r"([0-2][0-9]):([0-5][0-9])(?::([0-5][0-9])(?:\.[0-9]{1,9})?)?(?:Z|([+-])([0-2][0-9]):?([0-5][0-9]))"
)
_DAY_S: Final = 86_400
#: the greatest offset from UTC, in minutes
_FARTHEST: Final = 18 * 60
_NO_HEIGHT: Final = Decimal(99_999)


def read_ed269(tree: Any) -> list[ZoneFeature]:
    """The zones of an ED-269 file. Raises `NotReadable`."""
    features = tree.get("features") if isinstance(tree, dict) else tree
    if isinstance(tree, dict) and features is None:
        features = tree.get("UASZoneList")
    return [
        zone
        for number, each in enumerate(_list(features, "/features"))
        for zone in _ed269_zone(each, f"/features/{number}")
    ]


def _ed269_zone(zone: Any, place: str) -> Iterator[ZoneFeature]:
    if not isinstance(zone, dict):
        raise NotReadable(f"`{place}` is not an object")
    name = _name(zone, place)
    base = ZoneFeature(name, place)
    try:
        _restrict(base, zone, eurocae_ed269.Restriction, "restriction")
        periods = tuple(_periods(zone.get("applicability") or [], typed=eurocae_ed269.ApplicableTimePeriod))
        volumes = _list(zone.get("geometry"), f"{place}/geometry")
        if not volumes:
            raise UnkeptFeature("it has no geometry")
    except (UnkeptFeature, NotReadable) as error:
        yield _refused(base, error)
        return
    for number, volume in enumerate(volumes):
        made = ZoneFeature(name, f"{place}/geometry/{number}", periods=periods, use=base.use, comments=base.comments,
                           rules=base.rules, losses=base.losses if not number else [])  # fmt: skip
        try:
            _volume(made, volume)
        except (UnkeptFeature, NotReadable, NoArea) as error:
            made = _refused(made, error)
        yield made


def read_ed269_feature(feature: dict[str, Any], place: str) -> Iterator[ZoneFeature]:
    """The zones of a feature of GeoJSON whose properties are a zone of ED-269: the limits are in its `geometry`, the
    outline in that of the feature.
    """
    properties = dict(feature["properties"])
    limits = properties["geometry"]
    outline = feature.get("geometry")
    if isinstance(limits, list) and len(limits) == 1:
        limits = limits[0]
    properties["geometry"] = [{**limits, "horizontalProjection": outline}] if isinstance(limits, dict) else []
    for made in _ed269_zone(properties, place):
        yield replace(made, place=place)


def _volume(made: ZoneFeature, volume: Any) -> None:
    """The shape and the limits of a volume of ED-269."""
    if not isinstance(volume, dict):
        raise UnkeptFeature("its geometry is not an object")
    typed = _typed(volume, eurocae_ed269.UASZoneAirspaceVolume)
    unit = UNITS_MM[typed.uomDimensions.value]
    made.floor = _limit(volume.get("lowerLimit"), unit, typed.lowerVerticalReference.value)
    made.ceiling = _limit(volume.get("upperLimit"), unit, typed.upperVerticalReference.value)
    flat = volume["horizontalProjection"]
    if typed.horizontalProjection.type.value == "Circle":
        made.shape = _circle(flat.get("center"), flat.get("radius"))
    else:
        rings = _list(flat.get("coordinates"), f"{made.place}/horizontalProjection/coordinates")
        made.shape = polygons_text([polygon_of(rings, f"{made.place}/horizontalProjection/coordinates")])


def read_ed318(feature: dict[str, Any], place: str) -> Iterator[ZoneFeature]:
    """The zones of a feature of ED-318: one for each of its volumes."""
    properties = feature["properties"]
    name = _name(properties, place)
    base = ZoneFeature(name, place)
    try:
        _restrict(base, properties, eurocae_ed318.CodeZoneType, "type")
        periods = tuple(_periods(properties.get("limitedApplicability") or [], typed=eurocae_ed318.TimePeriod))
    except (UnkeptFeature, NotReadable) as error:
        yield _refused(base, error)
        return
    geometry = feature.get("geometry")
    collection, parts = False, geometry
    if isinstance(geometry, dict) and geometry.get("type") == "GeometryCollection":
        collection, parts = True, geometry.get("geometries")
    for number, part in enumerate(parts if isinstance(parts, list) and collection else [parts]):
        where = f"{place}/geometry/geometries/{number}" if collection else f"{place}/geometry"
        made = ZoneFeature(name, where, periods=periods, use=base.use, comments=base.comments, rules=base.rules,
                           losses=base.losses if not number else [])  # fmt: skip
        try:
            _layered(made, part)
        except (UnkeptFeature, NotReadable, NoArea) as error:
            made = _refused(made, error)
        yield made


def _layered(made: ZoneFeature, geometry: Any) -> None:
    """The shape and the limits of a geometry of ED-318."""
    if not isinstance(geometry, dict):
        raise UnkeptFeature("it has no geometry")
    layer = geometry.get("layer")
    if layer is None:
        made.losses.append(Loss("no-height", made.place, "no `layer`"))
    else:
        typed = _typed(layer, eurocae_ed318.VerticalLayer)
        unit = UNITS_MM[typed.uom.value.upper()]
        made.floor = _limit(layer.get("lower"), unit, typed.lowerReference.value)
        made.ceiling = _limit(layer.get("upper"), unit, typed.upperReference.value)
    kind, coordinates = geometry.get("type"), geometry.get("coordinates")
    pointer = f"{made.place}/coordinates"
    if kind == "Point":
        extent = geometry.get("extent")
        if not isinstance(extent, dict) or extent.get("subType") != "Circle":
            raise UnkeptFeature("it is a point without the extent of a circle")
        made.shape = _circle(coordinates, extent.get("radius"))
    elif kind == "Polygon":
        made.shape = polygons_text([polygon_of(_list(coordinates, pointer), pointer)])
    elif kind == "MultiPolygon":
        polygons = [polygon_of(_list(each, pointer), pointer) for each in _list(coordinates, pointer)]
        if not polygons:
            raise UnkeptFeature("it has no polygon")
        made.shape = polygons_text(polygons)
    else:
        raise UnkeptFeature("its geometry is neither an area nor a circle")


# ---------------------------------------------------------------- members


def _name(zone: dict[str, Any], place: str) -> str:
    """The identifier of a zone and its name, in the first language."""
    name = zone.get("name")
    if isinstance(name, list):
        name = name[0].get("text") if name and isinstance(name[0], dict) else None
    parts = [each for each in (zone.get("identifier"), name) if isinstance(each, str) and each.strip()]
    return " ".join(parts) or place


def _restrict(base: ZoneFeature, zone: dict[str, Any], kinds: Any, member: str) -> None:
    """What a zone is for, and what a policy must say besides."""
    said = zone.get(member)
    try:
        kind = kinds(said).value.replace("AUTHORIZATION", "AUTHORISATION")
    except ValueError:
        known = ", ".join(f"`{each.value}`" for each in kinds)
        raise UnkeptFeature(f"its `{member}` is not a kind of restriction", f"accepted: {known}") from None
    base.use = _USE[kind]
    base.comments = (kind,)
    if kind in _AUTHORISED:
        base.losses.append(Loss("authority", base.place, kind))
        base.rules = ("forbid goto by any when target inside ZONE",)
    conditions = zone.get("restrictionConditions")
    if kind == "CONDITIONAL" or conditions:
        each = conditions if isinstance(conditions, list) else [conditions or "not stated"]
        told = ", ".join(one if isinstance(one, str) else "no text" for one in each)
        base.losses.append(Loss("conditions", base.place, told[:200]))
        base.comments = (kind, f"conditions: {told}")
        base.rules = ("forbid goto by any when target inside ZONE",)
    if base.use == NO_USE:
        base.rules = ()


def _periods(written: Any, *, typed: Any) -> Iterator[Period]:
    """The periods of a zone; none if it always exists."""
    periods = _list(written, "applicability")
    if any(isinstance(each, dict) and each.get("permanent") == "YES" and not each.get("schedule") for each in periods):
        return
    for each in periods:
        dates = {name: value for name, value in _object(each).items() if name != "schedule"}
        _typed(dates, typed)
        moments = each.get("startDateTime"), each.get("endDateTime")
        schedule = _list(each.get("schedule") or [], "schedule")
        if not schedule and not any(moments):
            raise UnkeptFeature("its times are not stated")
        if not schedule:
            yield period_of(*moments)
        for day in schedule:
            yield period_of(*moments, _hours(_object(day)))


def _hours(period: dict[str, Any]) -> Hours:
    if period.get("startEvent") is not None or period.get("endEvent") is not None:
        raise UnkeptFeature("it begins or ends with the light of the day, whose times are not known")
    days = [str(each) for each in _list(period.get("day") or [], "day")]
    if not days or not set(days) <= {*_DAYS, "ANY"}:
        raise UnkeptFeature("its days of the week are not stated")
    numbers = range(len(_DAYS)) if "ANY" in days else (_DAYS.index(each) for each in days)
    return Hours(
        tuple(sorted(set(numbers))), _minutes(period.get("startTime")), _minutes(period.get("endTime"), up=True)
    )


def _minutes(written: Any, *, up: bool = False) -> int:
    """A time of day in minutes of the same day in UTC, which it may precede or follow; rounded up at the end of a
    window.
    """
    found = _TIME.fullmatch(written) if isinstance(written, str) else None
    if found is None:
        raise UnkeptFeature("a time of day is not stated with its offset from UTC")
    hour, minute, second, sign, ahead, rest = found.groups(default="0")
    minutes, seconds, offset = int(hour) * 60 + int(minute), int(second), int(ahead) * 60 + int(rest)
    if minutes * 60 + seconds > _DAY_S or offset > _FARTHEST:
        raise UnkeptFeature("a time of day does not exist")
    return minutes + (up and seconds > 0) - (-offset if sign == "-" else offset)


def _limit(written: Any, unit: Decimal, datum: str) -> Limit | None:
    """A limit; None if there is none. A feed that has to write a number writes 99999 for no limit."""
    if written is None:
        return None
    if not isinstance(written, Number):
        raise UnkeptFeature("a limit is not a number")
    value = Decimal(written.text)
    if value >= _NO_HEIGHT:
        return None
    if abs(value) > _NO_HEIGHT:
        raise UnkeptFeature("a limit is out of range")
    return Limit(round(value * unit), datum)


def _circle(centre: Any, radius: Any) -> str:
    """A circle around a place with the longitude first; the radius in m."""
    written = [*centre[:2], radius] if isinstance(centre, list) and len(centre) >= 2 else []
    numbers = [Decimal(each.text) for each in written if isinstance(each, Number)]
    if len(numbers) != 3:
        raise UnkeptFeature("its circle has no centre or no radius")
    longitude, latitude, metres = numbers
    if abs(latitude) > 85 or abs(longitude) > 180 or not 0 < metres < 1_000_000:
        raise UnkeptFeature("its circle is not on the globe, or has an impossible radius")
    return circle_text(degrees_e7(latitude), degrees_e7(longitude), round(metres * 1000))


def _typed(value: Any, kind: Any) -> Any:
    """The value as its type in the standard; `UnkeptFeature` if it is none."""
    try:
        return ImplicitDict.parse(_plain(_object(value)), kind)
    except (ValueError, TypeError, OverflowError, AttributeError, KeyError) as error:
        told = " ".join(str(error).split()).partition(" to any of the following formats")[0]
        raise UnkeptFeature(f"it is not valid: {told[:160]}") from None


def _plain(value: Any) -> Any:
    """A tree with numbers as the standard library reads them."""
    if isinstance(value, Number):
        number = Decimal(value.text)
        return int(number) if abs(number) < 10**15 and number == number.to_integral_value() else float(number)
    if isinstance(value, list):
        return [_plain(each) for each in value]
    return {name: _plain(each) for name, each in value.items()} if isinstance(value, dict) else value


def _refused(feature: ZoneFeature, error: Exception) -> ZoneFeature:
    """The feature, with the reason why it is not kept."""
    text = error.message if isinstance(error, NoArea) else str(error)
    help = error.why[1] if isinstance(error, UnkeptFeature) else getattr(error, "help", "") or ""
    feature.refused = text, help
    return feature


def _list(value: Any, place: str) -> Sequence[Any]:
    if not isinstance(value, list):
        raise NotReadable(f"`{place}` is not an array")
    return value


def _object(value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise UnkeptFeature("a part of it is not an object")
    return value
