"""Which geometry of a GeoJSON text is meant: RFC 7946, sections 2, 3.2 and 3.3."""

import re
from collections.abc import Iterator
from typing import Any

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.checker.refused import Refused
from rtshcua.ground.checker.unread import refuse_unread

AREAS = ("Polygon", "MultiPolygon")
#: RFC 7946, 1.4
GEOMETRIES = ("Point", "MultiPoint", "LineString", "MultiLineString", *AREAS, "GeometryCollection")
#: the one reference system of RFC 7946, 4, as files name it that were written before it. The register of EPSG has the
#: latitude of 4326 first; GeoJSON has the longitude first, whatever a `crs` says (GeoJSON 2008, 2.1.1)
_WGS84 = re.compile(
    r"urn:ogc:def:crs:OGC:[0-9.]*:CRS84|OGC:CRS84|(?:urn:ogc:def:crs:)?EPSG:(?:[0-9.]*:)?4326"
    r"|https?://www\.opengis\.net/(?:def/crs/OGC/1\.3/CRS84|def/crs/EPSG/0/4326|gml/srs/epsg\.xml#4326)|WGS ?84",
    re.IGNORECASE,
)
MOST_NAMED = 5


def chosen(tree: Any, feature: str | None) -> tuple[dict[str, Any], str]:
    """The Polygon or MultiPolygon that is meant, and the JSON pointer to it."""
    kind = tree.get("type") if isinstance(tree, dict) else None
    if not isinstance(kind, str) or kind not in (*GEOMETRIES, "Feature", "FeatureCollection"):
        raise Refused(
            codes.NOT_GEOJSON,
            "it is JSON, and no GeoJSON object",
            'a GeoJSON object has a `"type"`, such as `"FeatureCollection"` (RFC 7946, 3)',
        )
    _reference_system(tree)
    if kind == "FeatureCollection":
        return _among(tree, feature)
    if kind == "Feature":
        if feature is not None and feature not in _names(tree):
            raise Refused(codes.GEOJSON_SHAPE, f"its one feature is not called `{feature}`", _known([tree]))
        return _geometry(tree, "")
    if feature is not None:
        raise Refused(codes.GEOJSON_SHAPE, f"it is a {kind}, and has no features", "leave out `feature`")
    refuse_unread(tree)
    return _area(tree, "")


def _among(tree: dict[str, Any], feature: str | None) -> tuple[dict[str, Any], str]:
    """The feature of that name, or the only one that is an area."""
    features = tree.get("features")
    if not isinstance(features, list):
        raise Refused(codes.NOT_GEOJSON, "its `/features` is not an array (RFC 7946, 3.3)")
    for number, each in enumerate(features):
        if not isinstance(each, dict) or each.get("type") != "Feature":
            raise Refused(codes.NOT_GEOJSON, f"its `/features/{number}` is not a Feature (RFC 7946, 3.3)")
    if feature is None:
        found = [number for number, each in enumerate(features) if _is_area(each.get("geometry"))]
        what = "are areas"
    else:
        found = [number for number, each in enumerate(features) if feature in _names(each)]
        what = f"are called `{feature}`"
    if len(found) == 1:
        refuse_unread(tree)
        return _geometry(features[found[0]], f"/features/{found[0]}")
    if feature is not None and not found:
        raise Refused(codes.GEOJSON_SHAPE, f"none of its features is called `{feature}`", _known(features, feature))
    raise Refused(
        codes.GEOJSON_SHAPE,
        f"{len(found) or 'none'} of its {len(features)} features {what}",
        _known([features[number] for number in found]) if feature is None else "give each an id of its own",
    )


def _geometry(feature: dict[str, Any], pointer: str) -> tuple[dict[str, Any], str]:
    """RFC 7946, 3.2: a Feature's geometry is a geometry object, or null where it has no place."""
    _reference_system(feature)
    refuse_unread(feature, pointer)
    geometry = feature.get("geometry")
    if geometry is None:
        raise Refused(codes.GEOJSON_SHAPE, f"the feature at `{pointer or '/'}` has no geometry")
    return _area(geometry, f"{pointer}/geometry")


def _area(geometry: Any, pointer: str) -> tuple[dict[str, Any], str]:
    kind = geometry.get("type") if isinstance(geometry, dict) else None
    if kind not in GEOMETRIES:
        raise Refused(codes.NOT_GEOJSON, f"its `{pointer}` is not a geometry (RFC 7946, 3.1)")
    if kind not in AREAS:
        raise Refused(
            codes.GEOJSON_SHAPE,
            f"the geometry at `{pointer or '/'}` is a {kind}",
            "a zone is read from a Polygon or a MultiPolygon",
        )
    assert isinstance(geometry, dict)
    _reference_system(geometry)
    return geometry, pointer


def _is_area(geometry: Any) -> bool:
    """Whether a zone might be meant by it: also what is refused then, such as the circles of ED-318."""
    if not isinstance(geometry, dict):
        return False
    inner = geometry.get("geometries")
    return (
        geometry.get("type") in AREAS
        or (geometry.get("type") == "Point" and bool(geometry.get("extent")))
        or (geometry.get("type") == "GeometryCollection" and isinstance(inner, list) and any(map(_is_area, inner)))
    )


def _names(feature: dict[str, Any]) -> Iterator[str]:
    """What a feature is called: its id, a text or a number (RFC 7946, 3.2), and its property `name`."""
    properties = feature.get("properties")
    for each in (feature.get("id"), properties.get("name") if isinstance(properties, dict) else None):
        text = getattr(each, "text", each)
        if isinstance(text, str):
            yield text


def _known(features: list[dict[str, Any]], asked: str | None = None) -> str | None:
    """A hint at the features' names."""
    names = [name for name in dict.fromkeys(name for each in features for name in _names(each)) if name.isprintable()]
    near = None if asked is None else nearest(asked, names)
    if near is not None:
        return f"did you mean `{near}`?"
    if not names:
        return "give the feature an `id`, or a property `name`"
    more = "" if len(names) <= MOST_NAMED else f" and {len(names) - MOST_NAMED} more"
    return "name one of them with `feature`: " + ", ".join(f"`{name}`" for name in names[:MOST_NAMED]) + more


def _reference_system(tree: dict[str, Any]) -> None:
    """RFC 7946, 4: all positions are WGS 84; a `crs`, as files had before, must say the same,
    wherever it stands (GeoJSON 2008, 3)."""
    crs = tree.get("crs")
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if crs is not None and not (isinstance(name, str) and _WGS84.fullmatch(name)):
        told = f", `{name}`," if isinstance(name, str) and name.isprintable() and len(name) < 80 else ""
        raise Refused(
            codes.GEOJSON_SHAPE,
            f"its `crs`{told} does not name WGS 84, the one reference system of GeoJSON",
            "convert it to longitudes and latitudes in WGS 84 (RFC 7946, 4)",
        )
