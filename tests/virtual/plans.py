"""Uploads and downloads by the mission protocol, like a ground station, and some plans."""

from math import nan
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

MISSION, FENCE, RALLY, ALL = 0, 1, 2, 255
RELATIVE, AMSL = 6, 5

Row = tuple[int, int, tuple[float, float, float, float], float, float, float]
"""Command, frame, parameters 1 to 4, metres north and east of home, altitude."""


def item(pilot: Any, row: Row, number: int, kind: int = MISSION) -> Any:
    """MISSION_ITEM_INT."""
    command, frame, params, north, east, up = row
    x, y = pilot.config.home.globe(north, east) if frame != 2 else (0, 0)
    return mavlink.MAVLink_mission_item_int_message(1, 1, number, frame, command, 0, 1, *params, x, y, up, kind)


def waypoint(north: float, east: float, up: float, hold: float = 0, frame: int = RELATIVE) -> Row:
    return (16, frame, (hold, 0, 0, nan), north, east, up)


def takeoff(up: float) -> Row:
    return (22, RELATIVE, (0, 0, 0, nan), 0, 0, up)


RETURN: Row = (20, 2, (0, 0, 0, 0), 0, 0, 0)
LAND: Row = (21, RELATIVE, (0, 0, 0, 0), 0, 0, 0)
HOME: Row = (16, 0, (0, 0, 0, 0), 0, 0, 0)


def fence(*corners: tuple[float, float], command: int = 5001) -> list[Row]:
    return [(command, 0, (len(corners), 0, 0, 0), north, east, 0) for north, east in corners]


def square(half_m: float, north: float = 0, east: float = 0, command: int = 5001) -> list[Row]:
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return fence(*((north + half_m * n, east + half_m * e) for n, e in corners), command=command)


def upload(pilot: Any, rows: list[Row], kind: int = MISSION, at_once: bool = True) -> tuple[list[str], int | None]:
    """Upload a plan; return the names of the request messages, and the result of MISSION_ACK, if any."""
    asked: list[str] = []
    replies = pilot.send(mavlink.MAVLink_mission_count_message(1, 1, len(rows), kind))
    for _ in range(len(rows) + 1):
        message = next(
            (f for f in replies if f.name in ("MISSION_ACK", "MISSION_REQUEST", "MISSION_REQUEST_INT")), None
        )
        if message is None or message.name == "MISSION_ACK":
            return sorted(set(asked)), message and message.message.type
        asked.append(message.name)
        number = message.message.seq
        replies = pilot.send(item(pilot, rows[number], number, kind))
    raise AssertionError("asked for more than there is")


def mission(pilot: Any, rows: list[Row]) -> list[Row]:
    """Return the items for the flavour: ArduCopter reserves slot 0 for home."""
    return rows if pilot.px4 else [HOME, *rows]


def download(pilot: Any, kind: int = MISSION, whole: bool = True) -> list[Any]:
    """Download a plan; return the items' messages."""
    replies = pilot.send(mavlink.MAVLink_mission_request_list_message(1, 1, kind))
    count = next(f.message.count for f in replies if f.name == "MISSION_COUNT")
    ask = mavlink.MAVLink_mission_request_int_message if whole else mavlink.MAVLink_mission_request_message
    items = []
    for number in range(count):
        replies = pilot.send(ask(1, 1, number, kind))
        name = "MISSION_ITEM_INT" if whole else "MISSION_ITEM"
        items.append(next(f.message for f in replies if f.name == name))
    pilot.send(mavlink.MAVLink_mission_ack_message(1, 1, 0, kind))
    return items


def names(received: list[Any], prefix: str = "MISSION_") -> list[str]:
    return [f.name for f in received if f.name.startswith(prefix) and f.name != "MISSION_CURRENT"]
