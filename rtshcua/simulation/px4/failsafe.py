"""PX4's failsafes."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.simulation.failsafe import FailsafeRules

_CRITICAL = mavlink.MAV_SEVERITY_CRITICAL

RULES = FailsafeRules(
    position=((_CRITICAL, "Failsafe: no global position, landing blindly\t"),),
    position_after_s=0.0,
    land_pause_s=0.0,
    position_back=None,
    level=(_CRITICAL, "Emergency battery level, landing immediately\t"),
    low_voltage=None,
    low_action=None,
    low_text="",
)
