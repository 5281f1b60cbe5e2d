"""Frames that move nothing, and may leave without a permit: the whole list.

Questions, telemetry rates, texts and our own heartbeat pass always. A geofence may be handed over before the flight,
never during it. What is not here is not housekeeping: no mission is uploaded, no parameter written but the two that
switch ArduCopter's fence on, no signing key set, no file opened, no manual control given.
"""

from collections.abc import Callable
from enum import Enum, auto
from typing import Any, Final

from rtshcua.onboard.enforcement import frame_shape as shape
from rtshcua.onboard.enforcement.frame_shape import Frame

_ONBOARD_CONTROLLER: Final = 18  # MAV_TYPE
_NO_AUTOPILOT: Final = 8  # MAV_AUTOPILOT_INVALID
_SET_MESSAGE_INTERVAL: Final = 511  # MAV_CMD
_REQUEST_MESSAGE: Final = 512
_RUN_PREARM_CHECKS: Final = 401  # says why it would not arm, and does nothing else
_POLYGONS_TOO: Final = tuple(bits for bits in range(16) if bits & 4)  # FENCE_TYPE is a set of bits
_FENCE: Final = 1  # MAV_MISSION_TYPE
_FENCE_ITEMS: Final = range(5_000, 5_005)  # MAV_CMD_NAV_FENCE_RETURN_POINT to _CIRCLE_EXCLUSION


class Housekeeping(Enum):
    """When a frame that moves nothing may leave."""

    ALWAYS = auto()
    BEFORE_FLIGHT = auto()


_Fields = tuple[Any, ...]
_When = Housekeeping | None


def _always(fields: _Fields) -> _When:
    return Housekeeping.ALWAYS


def _heartbeat(fields: _Fields) -> _When:
    """Ours only: a ground station's would hide that the real one is gone (vehicles.md, 2)."""
    _, type_, autopilot, base_mode, *_ = fields
    own = (type_, autopilot, base_mode) == (_ONBOARD_CONTROLLER, _NO_AUTOPILOT, 0)
    return Housekeeping.ALWAYS if own else None


def _command(fields: _Fields) -> _When:
    if fields[7] == _RUN_PREARM_CHECKS:
        return Housekeeping.ALWAYS if not any(fields[:7]) else None
    return Housekeeping.ALWAYS if fields[7] in (_SET_MESSAGE_INTERVAL, _REQUEST_MESSAGE) else None


def _parameter(fields: _Fields) -> _When:
    """FENCE_ENABLE on; FENCE_TYPE with polygons among what it heeds. Nothing else of the vehicle is set from here."""
    value, _, _, name, _ = fields
    match name.rstrip(b"\0"):
        case b"FENCE_ENABLE":
            on = value == 1
        case b"FENCE_TYPE":
            on = value in _POLYGONS_TOO
        case _:
            on = False
    return Housekeeping.BEFORE_FLIGHT if on else None


def _fence_by(field: int) -> Callable[[_Fields], _When]:
    """Part of the upload of a fence, by the field that holds the MAV_MISSION_TYPE."""
    return lambda fields: Housekeeping.BEFORE_FLIGHT if fields[field] == _FENCE else None


def _fence_item(fields: _Fields) -> _When:
    """Not `current`: 2 and 3 there are ArduPilot's way to say "go there now" and "climb to there now"."""
    number, current, mission_type = fields[8], fields[12], fields[14]
    stored = mission_type == _FENCE and current == 0
    return Housekeeping.BEFORE_FLIGHT if stored and number in _FENCE_ITEMS else None


_RULES: Final[dict[int, Callable[[_Fields], _When]]] = {
    shape.HEARTBEAT: _heartbeat,
    shape.PARAM_REQUEST_READ: _always,
    shape.PARAM_REQUEST_LIST: _always,
    shape.MISSION_REQUEST: _always,
    shape.MISSION_REQUEST_LIST: _always,
    shape.MISSION_REQUEST_INT: _always,
    shape.MISSION_ACK: _always,
    shape.TIMESYNC: _always,
    shape.STATUSTEXT: _always,
    shape.COMMAND_LONG: _command,
    shape.PARAM_SET: _parameter,
    shape.MISSION_COUNT: _fence_by(3),
    shape.MISSION_CLEAR_ALL: _fence_by(2),
    shape.MISSION_ITEM_INT: _fence_item,
}


def housekeeping(frame: Frame) -> Housekeeping | None:
    """When the frame may leave without a permit; None: never."""
    rule = _RULES.get(frame.message)
    return None if rule is None else rule(frame.fields)
