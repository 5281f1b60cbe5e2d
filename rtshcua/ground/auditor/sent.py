"""What a frame that we sent would have an autopilot do: the auditor's own reading, which shares nothing with the gate.

Everything counts as a command that is not known to be harmless, so that a message nobody thought of is not overlooked.
Layouts are those of the MAVLink 2 dialect (https://mavlink.io/en/guide/serialization.html).
"""

from enum import Enum, auto
from struct import Struct
from typing import Any, Final, NamedTuple

MARKER: Final = 0xFD
_HEAD: Final = Struct("<BBBBBBBHB")  # marker, length, incompatible, compatible, sequence, system, component, message

HEARTBEAT, PARAM_SET, GLOBAL_POSITION_INT, MISSION_COUNT, MISSION_CLEAR_ALL = 0, 23, 33, 44, 45
MISSION_ITEM_INT, COMMAND_INT, COMMAND_LONG, SET_POSITION_TARGET_GLOBAL_INT = 73, 75, 76, 86
#: PARAM_REQUEST_READ and _LIST, MISSION_REQUEST, _LIST and _INT, MISSION_ACK, TIMESYNC, STATUSTEXT
_QUESTIONS: Final = frozenset({20, 21, 40, 43, 47, 51, 111, 253})
#: MAV_CMD of commands that only ask: RUN_PREARM_CHECKS, SET_MESSAGE_INTERVAL, REQUEST_MESSAGE
_ASKS: Final = frozenset({401, 511, 512})

_LAYOUTS: Final = {
    HEARTBEAT: Struct("<IBBBBB"),
    PARAM_SET: Struct("<fBB16sB"),
    GLOBAL_POSITION_INT: Struct("<IiiiihhhH"),
    MISSION_COUNT: Struct("<HBBB"),
    MISSION_CLEAR_ALL: Struct("<BBB"),
    MISSION_ITEM_INT: Struct("<4f2ifHHBBBBBB"),
    COMMAND_INT: Struct("<4f2ifHBBBBB"),
    COMMAND_LONG: Struct("<7fHBBB"),
    SET_POSITION_TARGET_GLOBAL_INT: Struct("<I2i9fHBBB"),
}
#: the field of a fence's upload that holds the MAV_MISSION_TYPE, which for a fence is 1
_MISSION_TYPE: Final = {MISSION_COUNT: 3, MISSION_CLEAR_ALL: 2, MISSION_ITEM_INT: 14}
_FENCE: Final = 1
_FENCE_PARAMETERS: Final = frozenset({b"FENCE_ENABLE", b"FENCE_TYPE"})


class Nature(Enum):
    """What kind of thing a frame is."""

    HARMLESS = auto()
    FENCE = auto()  # harmless before the first command
    COMMAND = auto()


class Frame(NamedTuple):
    """A frame. `fields` are in the order of the wire, empty where its message is none of those that are read."""

    system: int
    component: int
    message: int
    fields: tuple[Any, ...]


def read(octets: bytes) -> Frame | None:
    """What a frame says; None if the octets are no whole frame of MAVLink 2."""
    if len(octets) < _HEAD.size or octets[0] != MARKER or len(octets) < _HEAD.size + octets[1]:
        return None
    _, length, _, _, _, system, component, low, high = _HEAD.unpack_from(octets)
    message = low | high << 16
    layout = _LAYOUTS.get(message)
    if layout is None or length > layout.size:
        return Frame(system, component, message, ())
    # Zeros at the end of a payload are not sent.
    fields = layout.unpack(octets[_HEAD.size : _HEAD.size + length].ljust(layout.size, b"\0"))
    return Frame(system, component, message, fields)


def nature(frame: Frame) -> Nature:
    """What kind of thing a frame of ours is."""
    fields = frame.fields
    if frame.message in _QUESTIONS:
        return Nature.HARMLESS
    if not fields:
        return Nature.COMMAND
    if frame.message == HEARTBEAT or (frame.message == COMMAND_LONG and fields[7] in _ASKS):
        return Nature.HARMLESS
    if frame.message == PARAM_SET:
        return Nature.FENCE if fields[3].rstrip(b"\0") in _FENCE_PARAMETERS else Nature.COMMAND
    at = _MISSION_TYPE.get(frame.message)
    if at is None or fields[at] != _FENCE or (frame.message == MISSION_ITEM_INT and fields[12] != 0):
        return Nature.COMMAND  # `current` 2 and 3 of an item are ArduPilot's "go there now"
    return Nature.FENCE


def name(frame: Frame) -> str:
    """A frame in words, for a finding."""
    if frame.fields and frame.message in (COMMAND_LONG, COMMAND_INT):
        return f"command {frame.fields[7]}"
    return f"message {frame.message}"
