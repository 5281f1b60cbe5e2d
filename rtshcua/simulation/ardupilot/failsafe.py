"""ArduCopter's failsafes: the texts and the times as recorded."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.simulation.failsafe import FailsafeRules

_CRITICAL = mavlink.MAV_SEVERITY_CRITICAL

RULES = FailsafeRules(
    position=((_CRITICAL, "EKF variance"), (_CRITICAL, "EKF Failsafe: changed to LAND Mode")),
    position_after_s=0.9,
    land_pause_s=4.0,
    position_back=(_CRITICAL, "EKF Failsafe Cleared"),
    level=(_CRITICAL, "Battery Failsafe"),
    low_voltage="BATT_LOW_VOLT",
    low_action="BATT_FS_LOW_ACT",
    low_text="Battery Failsafe",
)
