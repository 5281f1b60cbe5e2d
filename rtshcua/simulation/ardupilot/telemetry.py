"""ArduCopter's streams: by default only HEARTBEAT and TIMESYNC."""

from collections.abc import Mapping
from math import atan2, degrees, hypot

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Message, maker
from rtshcua.model.faults import FlightMode
from rtshcua.simulation.ardupilot.payload_commands import PAYLOAD_BUILDERS
from rtshcua.simulation.autopilot import Autopilot, Builder
from rtshcua.simulation.telemetry import COMMON, GOOD_FLAGS, LOST_FLAGS, autopilot_version, extended_sys_state

_PLACE_ONLY = 0xFDF8
"""`type_mask`: only the place is valid; the upper bits are set too (`send_position_target_global_int`)."""

_POSITION_TARGET_GLOBAL_INT = maker(mavlink.MAVLink_position_target_global_int_message)
_EKF_STATUS_REPORT = maker(mavlink.MAVLink_ekf_status_report_message)
_WIND = maker(mavlink.MAVLink_wind_message)
_TIMESYNC = maker(mavlink.MAVLink_timesync_message)


def _position_target(a: Autopilot) -> Message | None:
    """POSITION_TARGET_GLOBAL_INT: the result of the mode's `get_wp`, if any; altitude above the sea.

    `ModeGuided::get_wp` has a target only after a position target, not after the mode change or in the takeoff.
    `ModeRTL::get_wp` has a target until the landing. Other modes have none.
    """
    vehicle = a.vehicle
    target, mode = vehicle.destination, vehicle.mode
    has_one = (
        vehicle.sent
        if mode in (FlightMode.GUIDED, FlightMode.MISSION)
        else mode is FlightMode.RETURN and not vehicle.descends
    )
    if target is None or not has_one:
        return None
    latitude, longitude = a.home.globe(target.north, target.east)
    amsl = a.home.amsl_mm / 1000 + target.up
    return _POSITION_TARGET_GLOBAL_INT(
        a.boot_ms, mavlink.MAV_FRAME_GLOBAL, _PLACE_ONLY, latitude, longitude, amsl, *[0.0] * 8
    )


_FIRST_FLAGS = 0x0A7
"""Recorded flags: attitude and height valid, vehicle assumed at rest."""
_GLITCHING = 1 << 15
"""EKF_GPS_GLITCHING of ArduPilot's EKF_STATUS_FLAGS; not in the pymavlink dialect."""


_REJECTED = 1.2
"""A variance above 1 means that the measurement is rejected; FS_EKF_THRESH is 0.8."""


def _ekf_status_report(a: Autopilot) -> Message | None:
    sensors = a.sensors
    if not sensors.answers:
        return None
    if not sensors.has_attitude:
        flags = 0 if sensors.initialised else mavlink.EKF_UNINITIALIZED
    elif not sensors.locates:
        flags = _FIRST_FLAGS
    else:
        flags = GOOD_FLAGS if sensors.has_position else LOST_FLAGS
    if sensors.unhealthy:
        flags = 0  # each flag depends on `filterHealthy` (AP_NavEKF3_Outputs.cpp, `updateFilterStatus`)
    if sensors.glitching:
        flags |= _GLITCHING
    velocity, place = (_REJECTED, _REJECTED) if sensors.unhealthy else (0.008, 0.005)
    return _EKF_STATUS_REPORT(flags, velocity, place, 0.001, 0.006, 0.0)


def _wind(a: Autopilot) -> Message | None:
    if not a.sensors.locates:
        return None
    wind = a.wind
    if wind is None:  # as recorded: without an estimate a copter reports wind of 0 from the south
        return _WIND(-180.0, 0.0, 0.0)
    north, east = wind  # the last estimate of a flight stays
    return _WIND(degrees(atan2(-east, -north)), hypot(north, east), 0.0)


def _timesync(a: Autopilot) -> Message:
    """TIMESYNC request; the system id is added to the time to recognise the answer."""
    return _TIMESYNC(0, a.now_us * 1000 + a.system)


BUILDERS: Mapping[int, Builder] = COMMON | {
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: extended_sys_state(mavlink.MAV_VTOL_STATE_MC),
    mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: _ekf_status_report,
    mavlink.MAVLINK_MSG_ID_WIND: _wind,
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: autopilot_version(mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT, 0, 0),
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: _position_target,
    mavlink.MAVLINK_MSG_ID_TIMESYNC: _timesync,
    **PAYLOAD_BUILDERS,
}

DEFAULT: Mapping[int, int] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1_000_000,
    mavlink.MAVLINK_MSG_ID_TIMESYNC: 10_000_000,
}
"""The intervals, in microseconds, of the streams that run from boot."""

_GROUPS: dict[int, tuple[int, ...]] = {
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: (
        mavlink.MAVLINK_MSG_ID_SYS_STATUS,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
    ),
    mavlink.MAV_DATA_STREAM_POSITION: (mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,),
    mavlink.MAV_DATA_STREAM_EXTRA1: (mavlink.MAVLINK_MSG_ID_ATTITUDE,),
    mavlink.MAV_DATA_STREAM_EXTRA2: (mavlink.MAVLINK_MSG_ID_VFR_HUD,),
    mavlink.MAV_DATA_STREAM_EXTRA3: (
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
        mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
        mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR,
        mavlink.MAVLINK_MSG_ID_WIND,
    ),
}
GROUPS: Mapping[int, tuple[int, ...]] = _GROUPS | {
    mavlink.MAV_DATA_STREAM_ALL: tuple(number for group in _GROUPS.values() for number in group)
}
"""The messages of each group of REQUEST_DATA_STREAM. As on ArduCopter, no group has EXTENDED_SYS_STATE."""
