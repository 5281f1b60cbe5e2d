"""The payload layouts of the messages that are sent to a vehicle, and of those that show the gate the vehicle's
position, flight state and parameters.

Fields are ordered by falling size, followed by extensions (https://mavlink.io/en/guide/serialization.html).
"""

from collections.abc import Callable
from operator import itemgetter
from struct import Struct
from typing import Any, Final, NamedTuple

from rtshcua.mavlink.framing import HEADER

HEARTBEAT: Final = 0
SYSTEM_TIME: Final = 2
PING: Final = 4
SET_MODE: Final = 11
PARAM_REQUEST_READ: Final = 20
PARAM_REQUEST_LIST: Final = 21
PARAM_VALUE: Final = 22
PARAM_SET: Final = 23
GLOBAL_POSITION_INT: Final = 33
MISSION_WRITE_PARTIAL_LIST: Final = 38
MISSION_ITEM: Final = 39
MISSION_REQUEST: Final = 40
MISSION_SET_CURRENT: Final = 41
MISSION_CURRENT: Final = 42
MISSION_REQUEST_LIST: Final = 43
MISSION_COUNT: Final = 44
MISSION_CLEAR_ALL: Final = 45
MISSION_ITEM_REACHED: Final = 46
MISSION_ACK: Final = 47
MISSION_REQUEST_INT: Final = 51
REQUEST_DATA_STREAM: Final = 66
MANUAL_CONTROL: Final = 69
RC_CHANNELS_OVERRIDE: Final = 70
MISSION_ITEM_INT: Final = 73
COMMAND_INT: Final = 75
COMMAND_LONG: Final = 76
COMMAND_ACK: Final = 77
COMMAND_CANCEL: Final = 80
SET_ATTITUDE_TARGET: Final = 82
SET_POSITION_TARGET_LOCAL_NED: Final = 84
SET_POSITION_TARGET_GLOBAL_INT: Final = 86
RADIO_STATUS: Final = 109
FILE_TRANSFER_PROTOCOL: Final = 110
TIMESYNC: Final = 111
LOG_REQUEST_LIST: Final = 117
ALTITUDE: Final = 141
AUTOPILOT_VERSION: Final = 148
AUTOPILOT_VERSION_REQUEST: Final = 183
HOME_POSITION: Final = 242
EXTENDED_SYS_STATE: Final = 245
STATUSTEXT: Final = 253
SETUP_SIGNING: Final = 256
CAMERA_CAPTURE_STATUS: Final = 262
CAMERA_IMAGE_CAPTURED: Final = 263
PROTOCOL_VERSION: Final = 300
TUNNEL: Final = 385
CONTROL_STATUS: Final = 512

TEXT_OCTETS: Final = 50  # in one STATUSTEXT


class Layout(NamedTuple):
    """A message's fields, in the order of the wire.

    `extra` is the octet that the frame's checksum includes after the payload, a digest of the layout.
    """

    extra: int
    fields: Struct
    names: tuple[str, ...]

    def at(self, name: str) -> int:
        """The index of a field; -1 if the message has none of this name."""
        return self.names.index(name) if name in self.names else -1

    def getter(self, names: str) -> Callable[[tuple[Any, ...]], Any]:
        """A function that selects these fields: one as it is, several as a tuple."""
        return itemgetter(*map(self.names.index, names.split()))

    def read(self, frame: bytes) -> tuple[Any, ...]:
        """The fields of a complete frame whose payload is no longer than the layout."""
        length, fields = frame[1], self.fields
        if length == fields.size:
            return fields.unpack_from(frame, HEADER)
        return fields.unpack(frame[HEADER : HEADER + length].ljust(fields.size, b"\0"))  # trailing zeros are not sent


def layout(extra: int, fields: str, names: str) -> Layout:
    """The layout with fields as `struct` writes them, and their names."""
    return Layout(extra, Struct(fields), tuple(names.split()))


_TARGET: Final = "target_system target_component"
_PARAMETERS: Final = "param1 param2 param3 param4"

LAYOUTS: Final = {
    HEARTBEAT: layout(50, "<IBBBBB", "custom_mode type autopilot base_mode system_status mavlink_version"),
    SYSTEM_TIME: layout(137, "<QI", "time_unix_usec time_boot_ms"),
    PARAM_REQUEST_READ: layout(214, "<hBB16s", f"param_index {_TARGET} param_id"),
    PARAM_REQUEST_LIST: layout(159, "<BB", _TARGET),
    PARAM_VALUE: layout(220, "<fHH16sB", "param_value param_count param_index param_id param_type"),
    PARAM_SET: layout(168, "<fBB16sB", f"param_value {_TARGET} param_id param_type"),
    GLOBAL_POSITION_INT: layout(104, "<IiiiihhhH", "time_boot_ms lat lon alt relative_alt vx vy vz hdg"),
    MISSION_REQUEST: layout(230, "<HBBB", f"seq {_TARGET} mission_type"),
    MISSION_REQUEST_LIST: layout(132, "<BBB", f"{_TARGET} mission_type"),
    MISSION_COUNT: layout(221, "<HBBB", f"count {_TARGET} mission_type"),
    MISSION_CLEAR_ALL: layout(232, "<BBB", f"{_TARGET} mission_type"),
    MISSION_ACK: layout(153, "<BBBB", f"{_TARGET} type mission_type"),
    MISSION_REQUEST_INT: layout(196, "<HBBB", f"seq {_TARGET} mission_type"),
    MISSION_ITEM_INT: layout(
        38, "<4f2ifHHBBBBBB", f"{_PARAMETERS} x y z seq command {_TARGET} frame current autocontinue mission_type"
    ),
    COMMAND_INT: layout(158, "<4f2ifHBBBBB", f"{_PARAMETERS} x y z command {_TARGET} frame current autocontinue"),
    COMMAND_LONG: layout(152, "<7fHBBB", f"{_PARAMETERS} param5 param6 param7 command {_TARGET} confirmation"),
    SET_POSITION_TARGET_GLOBAL_INT: layout(
        5, "<I2i9fHBBB",
        f"time_boot_ms lat_int lon_int alt vx vy vz afx afy afz yaw yaw_rate type_mask {_TARGET} coordinate_frame",
    ),
    TIMESYNC: layout(34, "<qq", "tc1 ts1"),
    LOG_REQUEST_LIST: layout(128, "<HHBB", f"start end {_TARGET}"),
    EXTENDED_SYS_STATE: layout(130, "<BB", "vtol_state landed_state"),
    STATUSTEXT: layout(83, f"<B{TEXT_OCTETS}sHB", "severity text id chunk_seq"),
}  # fmt: skip

#: the fields of commands that an autopilot acts on
of_command_long: Final = LAYOUTS[COMMAND_LONG].getter("param1 param2 param3 param4 param5 param6 param7 command")
of_command_int: Final = LAYOUTS[COMMAND_INT].getter("param1 param2 param3 param4 x y z command frame")
of_position_target: Final = LAYOUTS[SET_POSITION_TARGET_GLOBAL_INT].getter(
    "lat_int lon_int alt yaw type_mask coordinate_frame"
)
