"""POSITION_TARGET_GLOBAL_INT of PX4: the position setpoint, whenever there is one and it steers by position."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Message
from rtshcua.simulation.autopilot import Autopilot
from rtshcua.simulation.modes import Mode

_NAVIGATED = frozenset({Mode.TAKEOFF, Mode.LOITER, Mode.MISSION, Mode.RETURN, Mode.LAND})
"""The modes in which the navigator sets one; a pilot's modes, OFFBOARD and circling have none."""


def position_target(a: Autopilot) -> Message | None:
    """As recorded from v1.16: altitude above the sea, and 0 in Land; all fields of the mask are valid."""
    vehicle = a.vehicle
    target = vehicle.destination
    if target is None or vehicle.mode not in _NAVIGATED or not vehicle.armed:
        return None
    latitude, longitude = a.home.globe(target.north, target.east)
    amsl = 0.0 if vehicle.mode is Mode.LAND else a.home.amsl_mm / 1000 + target.up
    body = vehicle.body
    return mavlink.MAVLink_position_target_global_int_message(
        a.boot_ms,
        mavlink.MAV_FRAME_GLOBAL_INT,
        0,
        latitude,
        longitude,
        amsl,
        body.v_north,
        body.v_east,
        -body.v_up,
        0.0,
        0.0,
        0.0,
        body.yaw,
        0.0,
    )
