"""Frames that move nothing, and may leave without a permit: the whole list.

Questions, telemetry rates, texts and our own heartbeat pass always. A geofence may be handed over before the flight,
never during it. What is not here is not housekeeping: no mission is uploaded, no parameter written but the two that
switch ArduCopter's fence on, no signing key set, no file opened, no manual control given.
"""

from collections.abc import Callable
from enum import Enum, auto
from typing import Any, Final

from rtshcua.mavlink import enums, layouts
from rtshcua.mavlink.layouts import LAYOUTS
from rtshcua.onboard.enforcement.frame_shape import Frame

_OWN_HEARTBEAT: Final = (enums.MAV_TYPE_ONBOARD_CONTROLLER, enums.MAV_AUTOPILOT_INVALID, 0)
_POLYGONS_TOO: Final = tuple(bits for bits in range(16) if bits & 4)  # FENCE_TYPE is a set of bits
_FENCE_ITEMS: Final = range(enums.MAV_CMD_NAV_FENCE_RETURN_POINT, enums.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION + 1)

_identity: Final = LAYOUTS[layouts.HEARTBEAT].getter("type autopilot base_mode")
_command_number: Final = LAYOUTS[layouts.COMMAND_LONG].getter("command")
_parameters: Final = LAYOUTS[layouts.COMMAND_LONG].getter("param1 param2 param3 param4 param5 param6 param7")
_setting: Final = LAYOUTS[layouts.PARAM_SET].getter("param_id param_value")
_item: Final = LAYOUTS[layouts.MISSION_ITEM_INT].getter("command current mission_type")


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
    return Housekeeping.ALWAYS if _identity(fields) == _OWN_HEARTBEAT else None


def _command(fields: _Fields) -> _When:
    number = _command_number(fields)
    if number == enums.MAV_CMD_RUN_PREARM_CHECKS:
        return Housekeeping.ALWAYS if not any(_parameters(fields)) else None
    asks = number in (enums.MAV_CMD_SET_MESSAGE_INTERVAL, enums.MAV_CMD_REQUEST_MESSAGE)
    return Housekeeping.ALWAYS if asks else None


def _parameter(fields: _Fields) -> _When:
    """FENCE_ENABLE on; FENCE_TYPE with polygons among what it heeds. Nothing else of the vehicle is set from here."""
    name, value = _setting(fields)
    match name.rstrip(b"\0"):
        case b"FENCE_ENABLE":
            on = value == 1
        case b"FENCE_TYPE":
            on = value in _POLYGONS_TOO
        case _:
            on = False
    return Housekeeping.BEFORE_FLIGHT if on else None


def _of_fence(message: int) -> Callable[[_Fields], _When]:
    """Part of the upload of a fence."""
    kind = LAYOUTS[message].getter("mission_type")
    return lambda fields: Housekeeping.BEFORE_FLIGHT if kind(fields) == enums.MAV_MISSION_TYPE_FENCE else None


def _fence_item(fields: _Fields) -> _When:
    """Not `current`: 2 and 3 there are ArduPilot's way to say "go there now" and "climb to there now"."""
    number, current, mission_type = _item(fields)
    stored = mission_type == enums.MAV_MISSION_TYPE_FENCE and current == 0
    return Housekeeping.BEFORE_FLIGHT if stored and number in _FENCE_ITEMS else None


_RULES: Final[dict[int, Callable[[_Fields], _When]]] = {
    layouts.HEARTBEAT: _heartbeat,
    layouts.PARAM_REQUEST_READ: _always,
    layouts.PARAM_REQUEST_LIST: _always,
    layouts.MISSION_REQUEST: _always,
    layouts.MISSION_REQUEST_LIST: _always,
    layouts.MISSION_REQUEST_INT: _always,
    layouts.MISSION_ACK: _always,
    layouts.TIMESYNC: _always,
    layouts.STATUSTEXT: _always,
    layouts.COMMAND_LONG: _command,
    layouts.PARAM_SET: _parameter,
    layouts.MISSION_COUNT: _of_fence(layouts.MISSION_COUNT),
    layouts.MISSION_CLEAR_ALL: _of_fence(layouts.MISSION_CLEAR_ALL),
    layouts.MISSION_ITEM_INT: _fence_item,
}


def housekeeping(frame: Frame) -> Housekeeping | None:
    """When the frame may leave without a permit; None: never."""
    rule = _RULES.get(frame.message)
    return None if rule is None else rule(frame.fields)
