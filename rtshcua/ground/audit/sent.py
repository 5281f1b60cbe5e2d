"""What a frame that we sent would have an autopilot do: the auditor's own reading, written apart from the gate's.

Both read the same layouts and numbers, which tests compare with the dialect. Everything counts as a command that is not
known to be harmless, so that a message nobody thought of is not overlooked.
"""

from enum import Enum, auto
from math import isfinite
from typing import Any, Final, NamedTuple

from rtshcua.mavlink import enums, layouts
from rtshcua.mavlink.framing import HEAD, HEADER, MARKER
from rtshcua.mavlink.layouts import COMMAND_INT, COMMAND_LONG, LAYOUTS, MISSION_ITEM_INT, PARAM_SET
from rtshcua.mavlink.parameters import decode, is_bytewise

_QUESTIONS: Final = frozenset((
    layouts.PARAM_REQUEST_READ, layouts.PARAM_REQUEST_LIST, layouts.MISSION_REQUEST, layouts.MISSION_REQUEST_LIST,
    layouts.MISSION_REQUEST_INT, layouts.MISSION_ACK, layouts.TIMESYNC, layouts.STATUSTEXT,
))  # fmt: skip
#: commands that only ask
_ASKS: Final = frozenset(
    {enums.MAV_CMD_RUN_PREARM_CHECKS, enums.MAV_CMD_SET_MESSAGE_INTERVAL, enums.MAV_CMD_REQUEST_MESSAGE}
)
_AREAS: Final = 4  # a bit of FENCE_TYPE

_number: Final = LAYOUTS[COMMAND_LONG].getter("command")
_parameters: Final = {
    message: LAYOUTS[message].getter("param_id param_value param_type") for message in (PARAM_SET, layouts.PARAM_VALUE)
}
_current: Final = LAYOUTS[MISSION_ITEM_INT].getter("current")
_mission_types: Final = {
    message: LAYOUTS[message].getter("mission_type")
    for message in (layouts.MISSION_COUNT, layouts.MISSION_CLEAR_ALL, MISSION_ITEM_INT)
}


class Nature(Enum):
    """What kind of thing a frame is."""

    HARMLESS = auto()
    FENCE = auto()  # harmless before the first command
    SETTING = auto()  # a parameter, which a record has to list
    COMMAND = auto()


class Frame(NamedTuple):
    """A frame. `fields` are in the order of the wire, empty where its message is none of those that are read."""

    system: int
    component: int
    message: int
    fields: tuple[Any, ...]


def read(octets: bytes) -> Frame | None:
    """What a frame says; None if the octets are no whole frame of MAVLink 2."""
    if len(octets) < HEADER or octets[0] != MARKER or len(octets) < HEADER + octets[1]:
        return None
    _, length, _, _, _, system, component, low, high = HEAD.unpack_from(octets)
    message = low | high << 16
    layout = LAYOUTS.get(message)
    fields = () if layout is None or length > layout.fields.size else layout.read(octets)
    return Frame(system, component, message, fields)


def nature(frame: Frame) -> Nature:
    """What kind of thing a frame of ours is."""
    fields = frame.fields
    if frame.message in _QUESTIONS:
        return Nature.HARMLESS
    if not fields:
        return Nature.COMMAND
    if frame.message == layouts.HEARTBEAT:
        return Nature.HARMLESS
    if frame.message == COMMAND_LONG:
        return Nature.HARMLESS if _number(fields) in _ASKS else Nature.COMMAND
    if frame.message == PARAM_SET:
        return Nature.SETTING
    kind = _mission_types.get(frame.message)
    if kind is None or kind(fields) != enums.MAV_MISSION_TYPE_FENCE:
        return Nature.COMMAND
    if frame.message == MISSION_ITEM_INT and _current(fields) != 0:
        return Nature.COMMAND  # 2 and 3 are ArduPilot's "go there now"
    return Nature.FENCE


def parameter(frame: Frame, autopilot: int) -> tuple[str, float]:
    """Name and value in a PARAM_SET or PARAM_VALUE, as this autopilot has them."""
    name, raw, kind = _parameters[frame.message](frame.fields)
    return name.rstrip(b"\0").decode("latin-1"), decode(raw, kind, bytewise=is_bytewise(autopilot))


def switches_fence_on(name: str, value: float, types: float | None) -> bool:
    """Whether this setting switches ArduPilot's fence on, and takes nothing from what its owner has in it: `types` is
    the FENCE_TYPE that was told last, None before.
    """
    if name == "FENCE_TYPE":
        return isfinite(value) and value == (int(value) if types is None else int(types)) | _AREAS
    return (name, value) == ("FENCE_ENABLE", 1)


def name(frame: Frame) -> str:
    """A frame in words, for a finding."""
    if frame.fields and frame.message in (COMMAND_LONG, COMMAND_INT):
        return f"command {frame.fields[LAYOUTS[frame.message].at('command')]}"
    return f"message {frame.message}"
