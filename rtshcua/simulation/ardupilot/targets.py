"""POSITION_TARGET_GLOBAL_INT of ArduCopter: what `get_wp` of the mode gives, if it gives anything.

`ModeGuided::get_wp` has one only after a position target: not after entering the mode, nor in the takeoff.
`ModeRTL::get_wp` has one until the landing. Other modes have none.
"""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Message
from rtshcua.simulation.autopilot import Autopilot
from rtshcua.simulation.modes import Mode

_PLACE_ONLY = 0xFDF8
"""`type_mask`: only the place counts; the last byte's upper half is set as well (`send_position_target_global_int`)."""


def position_target(a: Autopilot) -> Message | None:
    """The target, with its altitude above the sea."""
    vehicle = a.vehicle
    target, mode = vehicle.destination, vehicle.mode
    has_one = vehicle.sent if mode in (Mode.GUIDED, Mode.MISSION) else mode is Mode.RETURN and not vehicle.descends
    if target is None or not has_one:
        return None
    latitude, longitude = a.home.globe(target.north, target.east)
    amsl = a.home.amsl_mm / 1000 + target.up
    return mavlink.MAVLink_position_target_global_int_message(
        a.boot_ms, mavlink.MAV_FRAME_GLOBAL, _PLACE_ONLY, latitude, longitude, amsl, *[0.0] * 8
    )
