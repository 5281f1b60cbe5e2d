"""A MAVLink 2 frame as octets (https://mavlink.io/en/guide/serialization.html), read by the boundary itself.

The boundary shares no parser with the adapters that it checks. Layouts are those of the dialect: fields by falling
size, extensions behind them; a test compares them with pymavlink's.
"""

from struct import Struct
from typing import Any, Final, NamedTuple

MARKER: Final = 0xFD
HEADER: Final = Struct("<BBBBBBBHB")  # marker, length, incompatible, compatible, sequence, system, component, message
CHECKSUM: Final = 2

HEARTBEAT: Final = 0
PARAM_REQUEST_READ: Final = 20
PARAM_REQUEST_LIST: Final = 21
PARAM_SET: Final = 23
GLOBAL_POSITION_INT: Final = 33
MISSION_REQUEST: Final = 40
MISSION_REQUEST_LIST: Final = 43
MISSION_COUNT: Final = 44
MISSION_CLEAR_ALL: Final = 45
MISSION_ACK: Final = 47
MISSION_REQUEST_INT: Final = 51
MISSION_ITEM_INT: Final = 73
COMMAND_INT: Final = 75
COMMAND_LONG: Final = 76
SET_POSITION_TARGET_GLOBAL_INT: Final = 86
TIMESYNC: Final = 111
STATUSTEXT: Final = 253


class Layout(NamedTuple):
    """How a message's payload is laid out, and at which field its target system stands (-1: it has none)."""

    fields: Struct
    target: int


#: every message that may leave, and those that the boundary reads
LAYOUTS: Final = {
    HEARTBEAT: Layout(Struct("<IBBBBB"), -1),
    PARAM_REQUEST_READ: Layout(Struct("<hBB16s"), 1),
    PARAM_REQUEST_LIST: Layout(Struct("<BB"), 0),
    PARAM_SET: Layout(Struct("<fBB16sB"), 1),
    GLOBAL_POSITION_INT: Layout(Struct("<IiiiihhhH"), -1),
    MISSION_REQUEST: Layout(Struct("<HBBB"), 1),
    MISSION_REQUEST_LIST: Layout(Struct("<BBB"), 0),
    MISSION_COUNT: Layout(Struct("<HBBB"), 1),
    MISSION_CLEAR_ALL: Layout(Struct("<BBB"), 0),
    MISSION_ACK: Layout(Struct("<BBBB"), 0),
    MISSION_REQUEST_INT: Layout(Struct("<HBBB"), 1),
    MISSION_ITEM_INT: Layout(Struct("<4f2ifHHBBBBBB"), 9),
    COMMAND_INT: Layout(Struct("<4f2ifHBBBBB"), 8),
    COMMAND_LONG: Layout(Struct("<7fHBBB"), 8),
    SET_POSITION_TARGET_GLOBAL_INT: Layout(Struct("<I2i9fHBBB"), 13),
    TIMESYNC: Layout(Struct("<qq"), -1),
    STATUSTEXT: Layout(Struct("<B50sHB"), -1),
}


class Frame(NamedTuple):
    """One whole frame. `fields` are in the order of the wire; `target` is (system, component) where it has one."""

    system: int
    component: int
    message: int
    fields: tuple[Any, ...]
    target: tuple[int, int] | None


_frame = tuple.__new__  # the constructor that a named tuple is given is a function more


def read_frame(octets: bytes) -> Frame | None:
    """The frame that these octets are; None unless they are one whole unsigned frame of a message in `LAYOUTS`.

    The checksum is the receiver's to check: a frame whose checksum is wrong moves nothing.
    """
    if len(octets) < HEADER.size or octets[0] != MARKER:
        return None
    _, length, incompatible, compatible, _, system, component, low, high = HEADER.unpack_from(octets)
    layout = LAYOUTS.get(low | high << 16)
    if layout is None or incompatible or compatible or len(octets) != HEADER.size + length + CHECKSUM:
        return None
    if length > layout.fields.size:
        return None
    # Zeros at the end of a payload are not sent.
    payload = octets[HEADER.size : HEADER.size + length].ljust(layout.fields.size, b"\0")
    fields = layout.fields.unpack(payload)
    target = None if layout.target < 0 else fields[layout.target : layout.target + 2]
    return _frame(Frame, (system, component, low | high << 16, fields, target))
