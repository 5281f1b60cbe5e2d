"""PX4's streams: all run by default, at tens of hertz in total."""

from collections.abc import Mapping
from math import nan

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Message, maker
from rtshcua.model.faults import FlightMode
from rtshcua.simulation.autopilot import Autopilot, Builder
from rtshcua.simulation.telemetry import (
    COMMON,
    CURRENT_MODE,
    LOST_FLAGS,
    autopilot_version,
    current_mode,
    extended_sys_state,
)

_POSITION_TARGET_GLOBAL_INT = maker(mavlink.MAVLink_position_target_global_int_message)
_ESTIMATOR_STATUS = maker(mavlink.MAVLink_estimator_status_message)
_WIND_COV = maker(mavlink.MAVLink_wind_cov_message)
_TIMESYNC = maker(mavlink.MAVLink_timesync_message)

_NAVIGATED = frozenset({FlightMode.TAKEOFF, FlightMode.LOITER, FlightMode.MISSION, FlightMode.RETURN, FlightMode.LAND})
"""The modes in which the navigator sets a target; manual modes, OFFBOARD and orbits have none."""


def _position_target(a: Autopilot) -> Message | None:
    """POSITION_TARGET_GLOBAL_INT: the position setpoint, if there is one.

    As recorded from v1.16: altitude above the sea, and 0 in Land; all fields of the mask are valid.
    """
    vehicle, (mode, _, target) = a.vehicle, a.shown
    if target is None or mode not in _NAVIGATED or not vehicle.armed:
        return None
    latitude, longitude = a.home.globe(target.north, target.east)
    amsl = 0.0 if mode is FlightMode.LAND else a.home.amsl_mm / 1000 + target.up
    body = vehicle.body
    velocity = (body.v_north, body.v_east, -body.v_up)
    return _POSITION_TARGET_GLOBAL_INT(
        a.boot_ms, mavlink.MAV_FRAME_GLOBAL_INT, 0, latitude, longitude, amsl, *velocity, 0.0, 0.0, 0.0, body.yaw, 0.0
    )


_BOOT_FLAGS, _FIRST_FLAGS, _GOOD_FLAGS = 0x480, 0x0E5, 0x3FF
"""Flags recorded from PX4 v1.16: at first, with a valid attitude, and healthy on the ground."""


_REJECTED, _ASTRAY_M = 1.6, 12.0
"""A test ratio above 1 means that the measurement is rejected; and `pos_horiz_accuracy` in that case."""


def _estimator_status(a: Autopilot) -> Message | None:
    sensors = a.sensors
    if not sensors.initialised:
        return None
    if not sensors.has_attitude:
        flags = _BOOT_FLAGS
    elif not sensors.locates:
        flags = _FIRST_FLAGS
    else:
        flags = _GOOD_FLAGS if sensors.has_position else LOST_FLAGS
        if a.vehicle.armed:
            flags &= ~mavlink.ESTIMATOR_CONST_POS_MODE
    if sensors.unhealthy:
        flags = flags & LOST_FLAGS | mavlink.ESTIMATOR_ACCEL_ERROR
    if sensors.glitching:
        flags |= mavlink.ESTIMATOR_GPS_GLITCH
    velocity, place, off_m = (_REJECTED, _REJECTED, _ASTRAY_M) if sensors.unhealthy else (0.06, 0.04, 0.3)
    return _ESTIMATOR_STATUS(a.now_us, flags, velocity, place, 0.03, 0.06, 0.005, nan, off_m, 0.3)


def _wind_cov(a: Autopilot) -> Message | None:
    """WIND_COV, if the wind is estimated: in the air and with drag fusion (EKF2_DRAG_CTRL) only."""
    wind = a.wind
    if wind is None or not a.vehicle.in_air:
        return None
    return _WIND_COV(a.now_us, *wind, 0.0, 0.1, 0.0, a.home.amsl_mm / 1000 + a.vehicle.body.up, 0.5, 0.5)


def _timesync(a: Autopilot) -> Message:
    """TIMESYNC request."""
    return _TIMESYNC(0, a.now_us * 1000)


BUILDERS: Mapping[int, Builder] = COMMON | {
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: extended_sys_state(mavlink.MAV_VTOL_STATE_UNDEFINED),
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: _estimator_status,
    mavlink.MAVLINK_MSG_ID_WIND_COV: _wind_cov,
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: autopilot_version(
        mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE, 0xFF, 1
    ),
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: _position_target,
    mavlink.MAVLINK_MSG_ID_TIMESYNC: _timesync,
    CURRENT_MODE: current_mode,
}

CONSTANT = frozenset({mavlink.MAVLINK_MSG_ID_HEARTBEAT})
"""HEARTBEAT stays at 1 Hz (measured: a request gets result 4)."""
ONLY_STREAMED = frozenset({CURRENT_MODE, mavlink.MAVLINK_MSG_ID_TIMESYNC})
LEAST_US: Mapping[int, int] = {CURRENT_MODE: 550_000}
"""Measured: requested at 10 Hz, it comes at 1.8 Hz."""

DEFAULT: Mapping[int, int] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1_000_000,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1_000_000,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 100_000,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 200_000,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 200_000,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: 250_000,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 200_000,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: 500_000,
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 500_000,
    mavlink.MAVLINK_MSG_ID_WIND_COV: 500_000,
    mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: 100_000,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: 2_000_000,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 1_000_000,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: 100_000,
    mavlink.MAVLINK_MSG_ID_TIMESYNC: 100_000,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 1_000_000,
}
"""The intervals, in microseconds, of the streams that run from boot."""
