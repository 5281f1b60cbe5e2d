"""Files with zones in the form in which they are published, written for tests."""

import io
import json
import zipfile
from pathlib import Path
from typing import Any

#: a square of some 150 m, as positions of GeoJSON, and a hole in it
SQUARE = [[8.544, 47.397], [8.546, 47.397], [8.546, 47.3985], [8.544, 47.3985], [8.544, 47.397]]
HOLE = [[8.5448, 47.3975], [8.5452, 47.3975], [8.5452, 47.398], [8.5448, 47.398], [8.5448, 47.3975]]
ALWAYS = [{"permanent": "YES"}]


def ed269(**changed: Any) -> dict[str, Any]:
    """A file of ED-269 with one zone."""
    return {"title": "zones", "features": [ed269_zone(**changed)]}


def ed269_zone(**changed: Any) -> dict[str, Any]:
    zone = {
        "identifier": "XX-1", "country": "CHE", "name": "Power plant", "type": "COMMON", "restriction": "PROHIBITED",
        "reason": ["SENSITIVE"], "applicability": ALWAYS, "zoneAuthority": [], "geometry": [volume()],
    }  # fmt: skip
    return zone | changed


def volume(flat: Any = None, **changed: Any) -> dict[str, Any]:
    flat = {"type": "Polygon", "coordinates": [SQUARE]} if flat is None else flat
    made = {
        "uomDimensions": "M", "lowerLimit": 0, "lowerVerticalReference": "AGL", "upperLimit": 600,
        "upperVerticalReference": "AMSL", "horizontalProjection": flat,
    }  # fmt: skip
    return made | changed


CIRCLE = {"type": "Circle", "center": [8.545, 47.398], "radius": 250.5}


def layer(**changed: Any) -> dict[str, Any]:
    return {"upper": 600, "upperReference": "AMSL", "lower": 0, "lowerReference": "AGL", "uom": "m"} | changed


def ed318(geometry: Any = None, **changed: Any) -> dict[str, Any]:
    """A file of ED-318 with one zone."""
    geometry = {"type": "Polygon", "coordinates": [SQUARE], "layer": layer()} if geometry is None else geometry
    properties = {
        "identifier": "XX2", "country": "CHE", "name": [{"text": "Stadium", "lang": "en-GB"}], "variant": "COMMON",
        "type": "PROHIBITED", "zoneAuthority": [],
    }  # fmt: skip
    feature = {"type": "Feature", "geometry": geometry, "properties": properties | changed}
    return {"type": "FeatureCollection", "metadata": {"issued": "2026-01-01T00:00:00Z"}, "features": [feature]}


def geojson(properties: Any = None, kind: str = "Polygon", coordinates: Any = None) -> dict[str, Any]:
    """A feature collection with one feature."""
    geometry = {"type": kind, "coordinates": [SQUARE, HOLE] if coordinates is None else coordinates}
    feature = {"type": "Feature", "properties": {} if properties is None else properties, "geometry": geometry}
    return {"type": "FeatureCollection", "features": [feature]}


def openaip(upper: Any, lower: Any, **more: Any) -> dict[str, Any]:
    """An airspace as the API of OpenAIP answers it; limits are value, unit and datum."""
    names = ("value", "unit", "referenceDatum")
    limits = {"upperLimit": dict(zip(names, upper, strict=True)), "lowerLimit": dict(zip(names, lower, strict=True))}
    item = {"name": "CTR", "icaoClass": 3, **limits, "geometry": {"type": "Polygon", "coordinates": [SQUARE]}}
    return {"items": [item | more], "totalCount": 1}


def faa(**changed: Any) -> dict[str, Any]:
    """A class airspace of the FAA."""
    members = {
        "NAME": "CLASS D", "CLASS": "D", "UPPER_VAL": 3000, "UPPER_UOM": "FT", "UPPER_CODE": "MSL", "LOWER_VAL": 0,
        "LOWER_UOM": "FT", "LOWER_CODE": "SFC",
    }  # fmt: skip
    return geojson(members | changed, coordinates=[SQUARE])


def ring(corners: Any = SQUARE, height: str = "") -> str:
    places = " ".join(f"{each[0]},{each[1]}{height}" for each in corners)
    return f"<LinearRing><coordinates>{places}</coordinates></LinearRing>"


def polygon(height: str = "", mode: str = "", extrude: bool = False, hole: bool = False) -> str:
    inner = f"<innerBoundaryIs>{ring(HOLE, height)}</innerBoundaryIs>" if hole else ""
    altitude = f"<altitudeMode>{mode}</altitudeMode>" if mode else ""
    outer = f"<outerBoundaryIs>{ring(SQUARE, height)}</outerBoundaryIs>"
    return f"<Polygon><extrude>{int(extrude)}</extrude>{altitude}{outer}{inner}</Polygon>"


def mark(inside: str, name: str = "Quarry") -> str:
    return f"<Placemark><name>{name}</name>{inside}</Placemark>"


def kml(*inside: str) -> str:
    text = "".join(inside)
    return f'<?xml version="1.0"?>\n<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{text}</Document></kml>'


def kmz(**files: bytes) -> bytes:
    """An archive with these files; `_` in a name stands for a dot."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name.replace("_", "."), data)
    return made.getvalue()


def write(folder: Path, value: Any, name: str) -> Path:
    path = folder / name
    text = value if isinstance(value, str | bytes) else json.dumps(value)
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path
