"""ArduCopter's simulated parameters and flight characteristics."""

from rtshcua.simulation.handling import Agility, Handling, Stopping
from rtshcua.simulation.kinematics import Approach
from rtshcua.simulation.parameters import INT8, INT16, INT32, AutopilotParameter

PARAMETERS = (
    AutopilotParameter("ARMING_CHECK", INT32, value=1),
    AutopilotParameter("BATT_CAPACITY", INT32, value=5000),
    AutopilotParameter("BATT_CRT_VOLT"),
    AutopilotParameter("BATT_FS_CRT_ACT", INT8),
    AutopilotParameter("BATT_FS_LOW_ACT", INT8),
    AutopilotParameter("BATT_LOW_VOLT", value=10.5),
    AutopilotParameter("BATT_MONITOR", INT8, value=4),
    AutopilotParameter("DISARM_DELAY", INT8, attribute="idle_disarm_s"),
    AutopilotParameter("FENCE_ACTION", INT8, value=1),
    AutopilotParameter("FENCE_ALT_MAX", value=100),
    AutopilotParameter("FENCE_ALT_MIN", value=-10),
    AutopilotParameter("FENCE_ENABLE", INT8),
    AutopilotParameter("FENCE_MARGIN", value=2),
    AutopilotParameter("FENCE_RADIUS", value=300),
    AutopilotParameter("FENCE_TOTAL", INT8),
    AutopilotParameter("FENCE_TYPE", INT8, value=7),
    AutopilotParameter("FRAME_CLASS", INT8, value=1),
    AutopilotParameter("FS_EKF_ACTION", INT8, value=1),
    AutopilotParameter("FS_GCS_ENABLE", INT8),
    AutopilotParameter("FS_THR_ENABLE", INT8),
    AutopilotParameter("LAND_ALT_LOW", INT16, attribute="land_below", scale=100),
    AutopilotParameter("LAND_SPEED", INT16, attribute="land_speed", scale=100),
    AutopilotParameter("MIS_RESTART", INT8),
    AutopilotParameter("MIS_TOTAL", INT16, value=1),
    AutopilotParameter("RALLY_TOTAL", INT8),
    AutopilotParameter("RTL_ALT", INT32, attribute="return_up", scale=100),
    AutopilotParameter("RTL_ALT_TYPE", INT8),
    AutopilotParameter("RTL_CLIMB_MIN", INT16, attribute="climb_least", scale=100),
    AutopilotParameter("RTL_CONE_SLOPE", attribute="cone_slope"),
    AutopilotParameter("RTL_SPEED", INT16, attribute="return_speed", scale=100),
    AutopilotParameter("SYSID_MYGCS", INT16, value=255),
    AutopilotParameter("SYSID_THISMAV", INT16, value=1),
    AutopilotParameter("WPNAV_ACCEL", attribute="acceleration", scale=100),
    AutopilotParameter("WPNAV_RADIUS", value=200),
    AutopilotParameter("WPNAV_SPEED", attribute="cruise", scale=100),
    AutopilotParameter("WPNAV_SPEED_DN", attribute="descent", scale=100),
    AutopilotParameter("WPNAV_SPEED_UP", attribute="climb", scale=100),
)
"""Ordered by index."""


def _loiter(speed: float) -> float:
    return speed * (speed / 9.2 + 0.65)


def _brake(speed: float) -> float:
    return speed * (0.0487 * speed + 1.555)


_LOITER = Stopping(Approach(braking=5.5, gain=2.6), hardest=6.5, ahead=_loiter, told=_loiter)
"""Measured from 10.1 m/s: 18 m, below 0.4 m/s after 3.0 s."""
_BRAKE = Stopping(Approach(braking=3.0, gain=0.75), hardest=3.6, ahead=_brake, told=_brake)
"""Measured from 10.1 m/s: 20.7 m, below 0.4 m/s after 4.6 s; recorded from 4.0 m/s: 7 m, 3.5 s."""


def _land(speed: float) -> float:
    return speed * (0.1 * speed + 2.3)


_LAND = Stopping(Approach(braking=2.2, gain=0.8), hardest=3.0, ahead=_land, told=_land)
"""Recorded from 6.9 m/s: 21 m, 4.3 s."""
_AGILITY = Agility(
    acceleration=2.5,
    approach=Approach(braking=1.25, gain=1.0),
    stop=_LOITER,
    brake=_BRAKE,
    land=_LAND,
    climb_acceleration=1.1,
    climb_approach=Approach(braking=0.55, gain=1.0),
    takeoff_acceleration=1.2,
    takeoff_within=0.1,
    spool_s=2.2,
    ramp_s=1.3,
    land_detect_s=1.8,
    overshoot_s=0.09,
    land_braking=0.55,
    return_wait_s=5.0,
)
"""Measured on recorded flights of ArduCopter 4.7."""


_FLATTEST = 0.5
"""RTL_MIN_CONE_SLOPE: a flatter cone is ignored."""


def _return_height(handling: Handling, away: float, up: float) -> float:
    """Return the return height as `ModeRTL::compute_return_target` (mode_rtl.cpp), without terrain or rally points."""
    least = max(0.3, up + handling.climb_least)
    height = max(handling.return_up, least)
    if handling.cone_slope >= _FLATTEST:
        height = min(height, max(away * handling.cone_slope, least))
    return height


HANDLING = Handling(
    agility=_AGILITY,
    return_height=_return_height,
    climb=2.5,
    takeoff_climb=2.5,
    land_speed=0.5,
    land_below=10.0,
    landed_disarm_s=0.3,
    acceleration=2.5,
    forgets_speed=True,
    forgets_at_first_target=True,  # `pos_control_start` of mode_guided.cpp resets to WPNAV_SPEED
    crash_disarm_s=2.0,  # CRASH_CHECK_TRIGGER_SEC of crash_check.cpp
)
