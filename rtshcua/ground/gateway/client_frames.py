"""Read the frames of clients, and make frames for them, of MAVLink 2: the relay converts those of MAVLink 1.

The layouts are those of `mavlink.layouts` and of the further messages that clients send or get. A frame of another
message cannot be verified, and nothing of it is read but its number.
"""

from math import isnan
from struct import error as struct_error
from typing import Any, Final, NamedTuple

from rtshcua.mavlink import layouts
from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1
from rtshcua.mavlink.framing import (
    CHECKSUM,
    FLAG_SIGNED,
    HEAD,
    HEADER,
    MARKER,
    checksum,
    frame_length,
    octets_of_checksum,
)
from rtshcua.mavlink.layouts import LAYOUTS, layout

#: streams that move a vehicle, in words
SETPOINTS: Final = {
    layouts.SET_POSITION_TARGET_LOCAL_NED: "local setpoints",
    layouts.SET_ATTITUDE_TARGET: "attitude and thrust setpoints",
    layouts.RC_CHANNELS_OVERRIDE: "RC override",
    layouts.MANUAL_CONTROL: "manual control",
    layouts.SET_POSITION_TARGET_GLOBAL_INT: "setpoints other than a position",
}

_TARGET: Final = "target_system target_component"
_MOTION: Final = "vx vy vz afx afy afz yaw yaw_rate type_mask"


#: Of an array only the first element has the field's name. The layouts without all fields end before the others.
LAYOUTS_OF_CLIENTS: Final = LAYOUTS | {
    layouts.SET_MODE: layout(89, "<IBB", "custom_mode target_system base_mode"),
    layouts.MISSION_WRITE_PARTIAL_LIST: layout(9, "<hhBBB", f"start_index end_index {_TARGET} mission_type"),
    layouts.MISSION_ITEM: layout(
        254, "<4f3fHHBBBBBB",
        f"param1 param2 param3 param4 x y z seq command {_TARGET} frame current autocontinue mission_type",
    ),
    layouts.MISSION_SET_CURRENT: layout(28, "<HBB", f"seq {_TARGET}"),
    layouts.MISSION_CURRENT: layout(28, "<HHBB", "seq total mission_state mission_mode"),
    layouts.MISSION_ITEM_REACHED: layout(11, "<H", "seq"),
    layouts.REQUEST_DATA_STREAM: layout(148, "<HBBBB", f"req_message_rate {_TARGET} req_stream_id start_stop"),
    layouts.MANUAL_CONTROL: layout(243, "<hhhhHB", "x y z r buttons target_system"),
    layouts.RC_CHANNELS_OVERRIDE: layout(124, "<16xBB", _TARGET),
    layouts.COMMAND_ACK: layout(143, "<HBBiBB", f"command result progress result_param2 {_TARGET}"),
    layouts.SET_ATTITUDE_TARGET: layout(49, "<36xBBB", f"{_TARGET} type_mask"),
    layouts.SET_POSITION_TARGET_LOCAL_NED: layout(
        143, "<I11fHBBB", f"time_boot_ms x y z {_MOTION} {_TARGET} coordinate_frame"
    ),
    layouts.FILE_TRANSFER_PROTOCOL: layout(84, "<BBB251s", f"target_network {_TARGET} payload"),
    layouts.AUTOPILOT_VERSION_REQUEST: layout(85, "<BB", _TARGET),
    layouts.HOME_POSITION: layout(104, "<iii", "latitude longitude altitude"),
    layouts.SETUP_SIGNING: layout(71, "<Q", "initial_timestamp"),
    layouts.COMMAND_CANCEL: layout(14, "<HBB", f"command {_TARGET}"),
    layouts.CONTROL_STATUS: layout(21, "<BB", "flags gcs_main"),  # of the development dialect, since 2026
}  # fmt: skip


class Received(NamedTuple):
    """A frame of a client: its sender, its message, and its fields by name; without fields if the layout is unknown."""

    system: int
    component: int
    message: int
    fields: dict[str, Any]

    @property
    def sender(self) -> tuple[int, int]:
        """System and component of the sender."""
        return self.system, self.component

    def number(self, name: str) -> float:
        """A numeric field; NaN if the message has none of this name."""
        value = self.fields.get(name)
        return value if isinstance(value, int | float) else float("nan")

    def whole(self, name: str) -> int:
        """A numeric field as an integer; -1 for one that is none."""
        value = self.number(name)
        return -1 if isnan(value) or value in (float("inf"), float("-inf")) or value != int(value) else int(value)

    def is_for(self, system: int) -> bool:
        """Whether the frame is for the autopilot of this system, for all, or names no target."""
        systems, components = (0, system), (0, MAV_COMP_ID_AUTOPILOT1)
        return self.fields.get("target_system", 0) in systems and self.fields.get("target_component", 0) in components


def received(frame: bytes) -> Received | None:
    """The fields of one complete frame, signed or not; None for damaged or incomplete octets.

    The checksum is verified where the layout is known.
    """
    if len(frame) < HEADER + CHECKSUM or frame[0] != MARKER or len(frame) != frame_length(frame, 0):
        return None
    _, length, flags, compatible, _, system, component, low, high = HEAD.unpack_from(frame)
    if flags & ~FLAG_SIGNED or compatible:
        return None
    number, end = low | high << 16, HEADER + length
    of = LAYOUTS_OF_CLIENTS.get(number)
    if of is None:
        return Received(system, component, number, {})
    if checksum(frame[1:end] + bytes([of.extra])) != int.from_bytes(frame[end : end + CHECKSUM], "little"):
        return None
    size = of.fields.size
    payload = frame[HEADER : min(end, HEADER + size)].ljust(size, b"\0")  # trailing zeros are not sent
    return Received(system, component, number, dict(zip(of.names, of.fields.unpack(payload), strict=True)))


def made(number: int, values: dict[str, Any], sender: tuple[int, int], sequence: int) -> bytes:
    """An unsigned MAVLink 2 frame of a message in `LAYOUTS_OF_CLIENTS`; fields that are not given are 0.

    Raises ValueError for a value that does not fit its field.
    """
    of = LAYOUTS_OF_CLIENTS[number]
    texts = ("text", "param_id", "payload")
    try:
        payload = of.fields.pack(*[values.get(name, b"" if name in texts else 0) for name in of.names])
    except (struct_error, OverflowError) as error:
        raise ValueError(str(error)) from None
    payload = payload.rstrip(b"\0") or b"\0"
    head = HEAD.pack(MARKER, len(payload), 0, 0, sequence % 256, *sender, number & 0xFFFF, number >> 16)
    return head + payload + octets_of_checksum(head[1:] + payload + bytes([of.extra]))
