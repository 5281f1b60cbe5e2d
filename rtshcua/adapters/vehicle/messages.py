"""The MAVLink messages that adapters send, made in one place with the fields that nobody uses filled in."""

from copy import copy
from functools import lru_cache
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as dialect

from rtshcua.codec.frames import kind_of
from rtshcua.mavlink import enums
from rtshcua.mavlink.layouts import COMMAND_LONG, TEXT_OCTETS
from rtshcua.mavlink.modes import CopterMode, Px4Mode

NAN = float("nan")

DO_SET_MODE = enums.MAV_CMD_DO_SET_MODE
ARM_DISARM = enums.MAV_CMD_COMPONENT_ARM_DISARM
TAKEOFF = enums.MAV_CMD_NAV_TAKEOFF
REPOSITION = enums.MAV_CMD_DO_REPOSITION
CHANGE_SPEED = enums.MAV_CMD_DO_CHANGE_SPEED
SET_INTERVAL = enums.MAV_CMD_SET_MESSAGE_INTERVAL
REQUEST_MESSAGE = enums.MAV_CMD_REQUEST_MESSAGE
RUN_PREARM_CHECKS = enums.MAV_CMD_RUN_PREARM_CHECKS
FENCE = enums.MAV_MISSION_TYPE_FENCE
RALLY = enums.MAV_MISSION_TYPE_RALLY

Message = Any  # one of pymavlink's classes

_ZEROS = (0.0,) * 7
_COMMAND_LONG = kind_of(COMMAND_LONG)
assert _COMMAND_LONG is not None
_COMMAND = _COMMAND_LONG

_AUTOPILOT = enums.MAV_COMP_ID_AUTOPILOT1


def heartbeat() -> Message:
    """Of an onboard controller; never of a ground station, which would hide the loss of the real one."""
    return dialect.MAVLink_heartbeat_message(
        enums.MAV_TYPE_ONBOARD_CONTROLLER, enums.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3
    )


def command(system: int, number: int, *parameters: float) -> Message:
    """COMMAND_LONG with up to seven parameters, the rest 0."""
    filled = (*parameters, *_ZEROS[len(parameters) :])
    return _COMMAND.build(*filled, number, system, _AUTOPILOT, 0)  # in the order of the wire


def set_mode(system: int, mode: Px4Mode | CopterMode) -> Message:
    """DO_SET_MODE to a custom mode."""
    return command(system, DO_SET_MODE, enums.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, *mode.parameters)


def arm(system: int) -> Message:
    """Arm, never by force."""
    return command(system, ARM_DISARM, 1, 0)


def reposition_amsl(system: int, latitude: int, longitude: int, amsl_m: float, speed_mm_s: int) -> Message:
    """DO_REPOSITION as COMMAND_INT: 1e-7 degree, metres above mean sea level, changing the mode (not `in_hold`)."""
    return _reposition(system, speed_mm_s / 1_000 if speed_mm_s else -1.0, latitude, longitude, amsl_m)


def stop_here(system: int) -> Message:
    """DO_REPOSITION to no place, height or heading: PX4 brakes, and stays where it comes to stand ("pause").

    As COMMAND_INT, where INT32_MAX is what NaN is in a float (vehicles.md 5; PX4: `Navigator`, DO_REPOSITION).
    """
    return _reposition(system, -1.0, enums.NO_PLACE, enums.NO_PLACE, NAN)


def in_hold(reposition: Message) -> Message:
    """The same DO_REPOSITION for a vehicle that is in Hold: it changes no mode, so it takes none from a pilot.

    PX4 from 1.14 to 1.17 answers that it does not support it, and obeys it, in Hold and within half a second alone
    (recorded; `Navigator::run`, `Loiter::on_active`); from 1.18 on it answers for what it does (pull request 27563).
    """
    made = copy(reposition)
    made.param2 = 0.0
    return made


def _reposition(system: int, speed_m_s: float, latitude: int, longitude: int, amsl_m: float) -> Message:
    return dialect.MAVLink_command_int_message(
        system, _AUTOPILOT, enums.MAV_FRAME_GLOBAL, REPOSITION, 0, 0,
        speed_m_s, enums.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE, 0, NAN, latitude, longitude, amsl_m,
    )  # fmt: skip


def position_target(system: int, latitude: int, longitude: int, height_m: float) -> Message:
    """SET_POSITION_TARGET_GLOBAL_INT: a place at a height in metres above home."""
    return dialect.MAVLink_set_position_target_global_int_message(
        0, system, _AUTOPILOT, enums.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, enums.POSITION_ONLY,
        latitude, longitude, height_m, 0, 0, 0, 0, 0, 0, 0, 0,
    )  # fmt: skip


def number_of(message: str) -> int | None:
    """The message's number on the wire; None when the dialect has no such message."""
    number: int | None = getattr(dialect, f"MAVLINK_MSG_ID_{message}", None)
    return number


def message_interval(system: int, message: str, interval_us: int) -> Message:
    """SET_MESSAGE_INTERVAL by the name of a message that the dialect has."""
    return command(system, SET_INTERVAL, number_of(message) or 0, interval_us)


@lru_cache(maxsize=16)
def request(system: int, message: str) -> Message:
    """REQUEST_MESSAGE: once, by the name of a message that the dialect has. The same one each time: to be sent only."""
    return command(system, enums.MAV_CMD_REQUEST_MESSAGE, number_of(message) or 0)


def time_sync(now_ns: int) -> Message:
    """TIMESYNC: our monotonic time, to come back beside the vehicle's."""
    return dialect.MAVLink_timesync_message(0, now_ns)


def status_text(severity: int, text: str) -> Message:
    """STATUSTEXT of at most 50 octets."""
    return dialect.MAVLink_statustext_message(severity, text.encode("ascii", "replace")[:TEXT_OCTETS])


def parameter_read(system: int, name: str) -> Message:
    """PARAM_REQUEST_READ by name."""
    return dialect.MAVLink_param_request_read_message(system, _AUTOPILOT, name.encode(), -1)


def parameter_set(system: int, name: str, value: float, kind: int) -> Message:
    """PARAM_SET; the value is encoded as the flavour wants it."""
    return dialect.MAVLink_param_set_message(system, _AUTOPILOT, name.encode(), value, kind)


class FenceItem(NamedTuple):
    """One MISSION_ITEM_INT: the command, a place in 1e-7 degree, and `param1`: corners of its ring, or radius in m."""

    command: int
    latitude: int
    longitude: int
    parameter: float


def fence_count(system: int, items: int) -> Message:
    """MISSION_COUNT of a fence that is to be uploaded."""
    return dialect.MAVLink_mission_count_message(system, _AUTOPILOT, items, FENCE)


def fence_item(system: int, number: int, frame: int, item: FenceItem) -> Message:
    """MISSION_ITEM_INT of a fence."""
    return dialect.MAVLink_mission_item_int_message(
        system, _AUTOPILOT, number, frame, item.command, 0, 1, item.parameter, 0, 0, 0, item.latitude, item.longitude,
        0, FENCE,
    )  # fmt: skip


def fence_list(system: int) -> Message:
    """MISSION_REQUEST_LIST: how many items has the fence?"""
    return dialect.MAVLink_mission_request_list_message(system, _AUTOPILOT, FENCE)


def rally_list(system: int) -> Message:
    """MISSION_REQUEST_LIST: how many rally points has it?"""
    return dialect.MAVLink_mission_request_list_message(system, _AUTOPILOT, RALLY)


def rally_received(system: int) -> Message:
    """MISSION_ACK that ends that question: their number is all that is wanted."""
    return dialect.MAVLink_mission_ack_message(system, _AUTOPILOT, dialect.MAV_MISSION_ACCEPTED, RALLY)


def fence_request(system: int, number: int) -> Message:
    """MISSION_REQUEST_INT: one item of the fence."""
    return dialect.MAVLink_mission_request_int_message(system, _AUTOPILOT, number, FENCE)


def fence_received(system: int) -> Message:
    """MISSION_ACK that ends a download."""
    return dialect.MAVLink_mission_ack_message(system, _AUTOPILOT, dialect.MAV_MISSION_ACCEPTED, FENCE)
