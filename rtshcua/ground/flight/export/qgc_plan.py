"""The planned mission as a plan of QGroundControl (`.plan`), with the airspace as its geofence.

Format: https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html. Of a simple item, the place is
in the last three parameters; QGroundControl refuses one that also has the older key `coordinate`, because it appends
that to the parameters. Heights are relative to home (`MAV_FRAME_GLOBAL_RELATIVE_ALT`, altitude mode 1), that of home is
above mean sea level.
"""

import json
from collections.abc import Iterator, Sequence
from typing import Any, Final

from rtshcua.diagnostics.excerpt import escaped
from rtshcua.ground.flight.export.exported import DEGREES, HEADING, METRES, SECONDS, FlightExport, number
from rtshcua.ground.flight.track import home_of
from rtshcua.mavlink import enums
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import ALONG, Invocation
from rtshcua.model.flat.zone import unproject

DATUM: Final = "above home; home itself above mean sea level"
WAYPOINT, LOITER_TIME = 16, 19  # MAV_CMD_NAV_WAYPOINT, MAV_CMD_NAV_LOITER_TIME
_MISSION_FRAME: Final = 2  # MAV_FRAME_MISSION: of an item without a place
_GENERIC, _QUADROTOR = 0, 2  # MAV_AUTOPILOT_GENERIC, MAV_TYPE_QUADROTOR
_RELATIVE: Final = 1  # QGroundControl's altitude mode

#: a fence item as in MAVLink: command, latitude and longitude in 1e-7 degree, corners of its ring or radius in m
FencePart = tuple[int, int, int, float]
_CIRCLES: Final = {
    enums.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: True,
    enums.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: False,
}
_VERTICES: Final = {
    enums.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    enums.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}


def qgc_plan(export: FlightExport, fence: Sequence[FencePart]) -> tuple[bytes, int]:
    """The plan and the number of its items. It has no place for a description, so that is in a key that QGroundControl
    ignores.
    """
    flight, home = export.flight, home_of(export.flight)
    limits = flight.policy.vehicle
    speed = number(limits.speed if limits.speeds is None else limits.speeds.cruise, METRES)
    height = 0 if home.above_sea is None else number(home.above_sea, METRES)
    items = [item | {"doJumpId": number} for number, item in enumerate(_items(export), start=1)]
    plan = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "mission": {
            "version": 2,
            "firmwareType": _GENERIC,
            "vehicleType": _QUADROTOR,
            "cruiseSpeed": speed,
            "hoverSpeed": speed,
            "globalPlanAltitudeMode": _RELATIVE,
            "plannedHomePosition": [number(home.latitude, DEGREES), number(home.longitude, DEGREES), height],
            "items": items,
        },
        "geoFence": {"version": 2, "circles": list(_circles(fence)), "polygons": list(_polygons(fence))},
        "rallyPoints": {"version": 2, "points": []},
        "rtshcua": {"description": list(export.description(f"heights: {DATUM}"))},
    }
    return escaped(json.dumps(plan, ensure_ascii=False, indent=2)).encode() + b"\n", len(items)


def _items(export: FlightExport) -> Iterator[dict[str, Any]]:
    """The items of the steps. A step that stays is at the place and height of the step before it."""
    projection = export.flight.policy.projection
    x, y, height, speed = 0, 0, 0, 0
    flying = False
    for step in export.flight.mission.invocations:
        plan = step.plan
        if plan.kind in (MotionKind.CLIMB, MotionKind.FLY, MotionKind.COVER):
            height = plan.altitude
        if plan.speed and plan.speed != speed:
            speed = plan.speed
            yield _simple(enums.MAV_CMD_DO_CHANGE_SPEED, 1, number(speed, METRES), -1, 0)  # 1: over ground
        if plan.kind == MotionKind.HOME:
            yield _simple(enums.MAV_CMD_NAV_RETURN_TO_LAUNCH, 0, 0, 0, 0)
            x, y, height, flying = 0, 0, 0, False
            continue
        if plan.kind in (MotionKind.FLY, MotionKind.COVER):
            headings = plan.headings or (ALONG,) * (len(plan.path) // 2)
            for (x, y, height), heading in zip(plan.points(), headings, strict=True):
                yield _at(unproject(projection, x, y), height, WAYPOINT, 0, 0, 0, heading=heading)
        elif plan.kind == MotionKind.CLIMB:
            command = WAYPOINT if flying else enums.MAV_CMD_NAV_TAKEOFF
            yield _at(unproject(projection, x, y), height, command, 0, 0, 0)
        elif plan.kind == MotionKind.HOLD:
            yield _at(unproject(projection, x, y), height, LOITER_TIME, number(_holds_us(step), SECONDS), 0, 0)
        else:
            yield _at(unproject(projection, x, y), 0, enums.MAV_CMD_NAV_LAND, 0, 0, 0)
            height = 0
        flying = plan.kind != MotionKind.LAND


def _holds_us(step: Invocation) -> int:
    """How long a step holds: its argument, or else its greatest duration."""
    cell = step.contract.motion.time
    return step.arguments[cell] if cell >= 0 else step.contract.duration_us


def _simple(command: int, *four: float) -> dict[str, Any]:
    """An item without a place."""
    return _item(command, _MISSION_FRAME, (*four, 0, 0, 0))


def _at(place: tuple[int, int], above_home: int, command: int, *three: float, heading: int = ALONG) -> dict[str, Any]:
    """An item at a place; its fourth parameter is the yaw in degrees, which is left to the vehicle without a heading
    (null means NaN).
    """
    height, yaw = number(above_home, METRES), None if heading == ALONG else number(heading, HEADING)
    params = (*three, yaw, number(place[0], DEGREES), number(place[1], DEGREES), height)
    shown = {"AMSLAltAboveTerrain": None, "Altitude": height, "AltitudeMode": _RELATIVE}
    return shown | _item(command, enums.MAV_FRAME_GLOBAL_RELATIVE_ALT, params)


def _item(command: int, frame: int, params: Sequence[float | None]) -> dict[str, Any]:
    return {"autoContinue": True, "command": command, "frame": frame, "params": list(params), "type": "SimpleItem"}


def _circles(fence: Sequence[FencePart]) -> Iterator[dict[str, Any]]:
    for command, latitude, longitude, radius in fence:
        if command in _CIRCLES:
            circle = {"center": [number(latitude, DEGREES), number(longitude, DEGREES)], "radius": radius}
            yield {"circle": circle, "inclusion": _CIRCLES[command], "version": 1}


def _polygons(fence: Sequence[FencePart]) -> Iterator[dict[str, Any]]:
    vertices = [each for each in fence if each[0] in _VERTICES]
    while vertices:
        command, _, _, corners = vertices[0]
        ring, vertices = vertices[: int(corners)], vertices[int(corners) :]
        places = [[number(each[1], DEGREES), number(each[2], DEGREES)] for each in ring]
        places.reverse()  # the format documents clockwise corners
        yield {"polygon": places, "inclusion": _VERTICES[command], "version": 1}
