"""Plans in the form in which QGroundControl saves them, written for tests."""

import json
from pathlib import Path
from typing import Any

#: home of the plans: latitude, longitude, and the height above sea
HOME = (47.39774, 8.54559, 408.0)
PX4, ARDUPILOT = 12, 3
FENCE = ((47.3960, 8.5430), (47.3960, 8.5490), (47.4000, 8.5490), (47.4000, 8.5430))


def item(command: int, *params: float | None, frame: int = 3, mode: int | None = 1, **more: Any) -> dict[str, Any]:
    """A simple item; parameters that are not given are 0."""
    shown = {} if mode is None else {"AltitudeMode": mode, "Altitude": (*params, *[0] * 7)[6]}
    padded = [*params, *[0] * (7 - len(params))]
    return {
        "autoContinue": True, "command": command, "frame": frame, "params": padded, "type": "SimpleItem",
    } | shown | more  # fmt: skip


def at(
    command: int, north: float, east: float, height: float | None, *first: float | None, **more: Any
) -> dict[str, Any]:
    """An item at a place, given in 1e-4 degree from home."""
    four = (*first, *(0, 0, 0, None)[len(first) :])
    return item(command, *four, HOME[0] + north / 10_000, HOME[1] + east / 10_000, height, **more)


def simple(command: int, *params: float | None, **more: Any) -> dict[str, Any]:
    """An item without a place."""
    return item(command, *params, frame=2, mode=None, **more)


TAKEOFF = at(22, 0, 0, 20)
RETURN = simple(20)


def survey(*items: dict[str, Any], kind: str = "survey") -> dict[str, Any]:
    """A survey with the items that the planner made of it."""
    return {
        "type": "ComplexItem", "complexItemType": kind, "version": 5, "polygon": [list(each) for each in FENCE],
        "TransectStyleComplexItem": {"version": 1, "Items": list(items), "CameraCalc": {"DistanceToSurface": 20}},
    }  # fmt: skip


#: a camera of a survey at 40 m: a picture shows 60 m by 40 m, each 10 m a picture
CAMERA = {
    "CameraName": "Test 20", "SensorWidth": 13.2, "SensorHeight": 8.8, "FocalLength": 8.8, "ImageWidth": 5472,
    "ImageHeight": 3648, "Landscape": True, "MinTriggerInterval": 1, "FrontalOverlap": 75, "SideOverlap": 70,
    "DistanceToSurface": 40, "AdjustedFootprintSide": 18, "AdjustedFootprintFrontal": 10, "version": 2,
}  # fmt: skip
CORNERS = ((2, 1), (2, 10), (8, 10), (8, 1))


def near(corners: Any) -> list[list[float]]:
    """Places given in 1e-4 degree from home."""
    return [[HOME[0] + north / 10_000, HOME[1] + east / 10_000] for north, east in corners]


def mapped(kind: str = "survey", height: float = 40, trigger: float = 10, more: Any = None, **options: Any) -> Any:
    """A survey, or a corridor scan, with a camera: `options` are those of its legs, `more` those of its item."""
    legs = [at(16, 3, 0, height), simple(206, trigger, 0, 1), at(16, 3, 11, height), simple(206, 0),
            at(16, 6, 11, height), simple(206, trigger, 0, 1), at(16, 6, 0, height), simple(206, 0)]  # fmt: skip
    transects = {"version": 2, "CameraCalc": CAMERA, "Items": legs, "TurnAroundDistance": 5, **options}
    shape = {"polygon": near(CORNERS), "angle": 45} if kind == "survey" else {
        "polyline": near(((3, 0), (8, 2))), "CorridorWidth": 40}  # fmt: skip
    item = {"type": "ComplexItem", "complexItemType": kind, "version": 5, "TransectStyleComplexItem": transects}
    return item | shape | (more or {})


def structure(corners: Any = ((5, 5), (5, 6), (5.7, 6), (5.7, 5)), camera: Any = None, **more: Any) -> dict[str, Any]:
    """A structure scan."""
    figures = {"DistanceToSurface": 15, "AdjustedFootprintSide": 6, "AdjustedFootprintFrontal": 10}
    figures |= {"FrontalOverlap": 30, "MinTriggerInterval": 0.7}
    return {
        "type": "ComplexItem", "complexItemType": "StructureScan", "version": 3, "polygon": near(corners),
        "EntranceAltitude": 45, "ScanBottomAlt": 5, "StructureHeight": 35, "Layers": 2, "StartFromTop": False,
        "GimbalPitch": 0, "CameraCalc": CAMERA | figures | (camera or {}),
    } | more  # fmt: skip


def fence(inclusion: bool = True, corners: tuple[tuple[float, float], ...] = FENCE) -> dict[str, Any]:
    return {"inclusion": inclusion, "polygon": [list(each) for each in corners], "version": 1}


def circle(north: float, east: float, radius: float, inclusion: bool = False) -> dict[str, Any]:
    centre = [HOME[0] + north / 10_000, HOME[1] + east / 10_000]
    return {"inclusion": inclusion, "circle": {"center": centre, "radius": radius}, "version": 1}


def plan(
    *items: dict[str, Any], firmware: int = PX4, polygons: Any = (), circles: Any = (), rally: Any = (), **mission: Any
) -> dict[str, Any]:
    """A plan with these items."""
    return {
        "fileType": "Plan",
        "groundStation": "QGroundControl",
        "version": 1,
        "mission": {
            "version": 2, "firmwareType": firmware, "vehicleType": 2, "cruiseSpeed": 15, "hoverSpeed": 5,
            "globalPlanAltitudeMode": 1, "plannedHomePosition": list(HOME), "items": list(items),
        } | mission,
        "geoFence": {"version": 2, "polygons": list(polygons), "circles": list(circles)},
        "rallyPoints": {"version": 2, "points": list(rally)},
    }  # fmt: skip


def write(folder: Path, value: Any, name: str = "site.plan") -> Path:
    path = folder / name
    path.write_text(value if isinstance(value, str) else json.dumps(value), encoding="utf-8")
    return path
