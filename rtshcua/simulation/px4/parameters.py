"""PX4's simulated parameters and flight characteristics."""

from math import radians, tan

from rtshcua.model.faults import FlightMode
from rtshcua.simulation.handling import Agility, Handling, Stopping
from rtshcua.simulation.kinematics import Approach
from rtshcua.simulation.parameters import INT32, AutopilotParameter

PARAMETERS = (
    AutopilotParameter("BAT1_CAPACITY", value=5000),
    AutopilotParameter("BAT1_N_CELLS", INT32, value=4),
    AutopilotParameter("BAT_CRIT_THR", value=0.07),
    AutopilotParameter("BAT_EMERGEN_THR", value=0.05),
    AutopilotParameter("BAT_LOW_THR", value=0.15),
    AutopilotParameter("COM_DISARM_LAND", attribute="landed_disarm_s"),
    AutopilotParameter("COM_DISARM_PRFLT", attribute="idle_disarm_s"),
    AutopilotParameter("COM_FAIL_ACT_T", value=5),
    AutopilotParameter("COM_LOW_BAT_ACT", INT32, value=3),
    AutopilotParameter("COM_RC_IN_MODE", INT32, value=4),
    AutopilotParameter("GF_ACTION", INT32, value=2),
    AutopilotParameter("GF_MAX_HOR_DIST"),
    AutopilotParameter("GF_MAX_VER_DIST"),
    AutopilotParameter("MAV_COMP_ID", INT32, value=1),
    AutopilotParameter("MAV_SIGN_CFG", INT32),
    AutopilotParameter("MAV_SYS_ID", INT32, value=1),
    AutopilotParameter("MAV_TYPE", INT32, value=2),
    AutopilotParameter("MIS_DIST_1WP", value=10_000),
    AutopilotParameter("MIS_TAKEOFF_ALT", attribute="takeoff_up"),
    AutopilotParameter("MPC_ACC_HOR", attribute="acceleration"),
    AutopilotParameter("MPC_LAND_ALT1", value=10),
    AutopilotParameter("MPC_LAND_SPEED", attribute="land_speed"),
    AutopilotParameter("MPC_TKO_SPEED", attribute="takeoff_climb"),
    AutopilotParameter("MPC_XY_CRUISE", attribute="cruise"),
    AutopilotParameter("MPC_Z_VEL_MAX_DN", attribute="descent"),
    AutopilotParameter("MPC_Z_VEL_MAX_UP", attribute="climb"),
    AutopilotParameter("NAV_ACC_RAD", attribute="acceptance_m"),
    AutopilotParameter("NAV_DLL_ACT", INT32),
    AutopilotParameter("NAV_MC_ALT_RAD", value=0.8),
    AutopilotParameter("NAV_RCL_ACT", INT32, value=2),
    AutopilotParameter("RTL_CONE_ANG", INT32, attribute="cone_deg"),
    AutopilotParameter("RTL_MIN_DIST", attribute="near_m"),
    AutopilotParameter("RTL_RETURN_ALT", attribute="return_up"),
    AutopilotParameter("RTL_TYPE", INT32),
    AutopilotParameter("SYS_AUTOSTART", INT32, value=4001),
)
"""Ordered by index."""


_MPC_ACC_HOR = 3.0
_SPREAD = 0.6
"""Seconds that `computeBrakingDistanceFromVelocity` adds for the jerk limit of 0.6 times MPC_JERK_AUTO."""


def _breaking_distance(speed: float) -> float:
    """Return the stopping distance that PX4 reports (`Navigator::calculate_breaking_stop`)."""
    return speed * (speed / (2 * _MPC_ACC_HOR) + _SPREAD)


_STOP = Stopping(
    Approach(braking=3.0, gain=0.75),
    hardest=3.6,
    ahead=lambda speed: speed * (0.207 * speed + 0.778),
    told=_breaking_distance,
)
"""Measured from 4.5 m/s: 7.7 m, below 0.4 m/s after 3.6 to 4.6 s. It overshoots the reported place."""
_OVERSHOOT_S = 0.18
"""Recorded: 0.57 m at 4.2 m/s to 1.38 m at 4.9 m/s, and 1.11 m at 6 m/s; nothing faster.

Faster speeds are derived from the cause: the trajectory of `PositionSmoothing` ends at the target, but the velocity
integrator (MPC_XY_VEL_I_ACC, 0.4) still compensates the drag of the simulator (SIH_KDV, 1 N s/m for 1 kg).
With the defaults of 1.16 the equations give 1.2 m at 5 m/s, 1.4 m at 6 m/s, 1.7 m at 8 m/s and 1.9 m at 10 m/s, where
the lean angle saturates. A vehicle with less drag overshoots less.
"""
_AGILITY = Agility(
    acceleration=2.5,
    approach=Approach(braking=0.75, gain=0.95),
    stop=_STOP,
    brake=_STOP,
    land=_STOP,
    climb_acceleration=1.5,
    climb_approach=Approach(braking=0.7, gain=0.6),
    takeoff_acceleration=0.8,
    takeoff_within=0.8,
    spool_s=1.5,
    ramp_s=2.2,
    land_detect_s=4.0,
    overshoot_s=_OVERSHOOT_S,
    home_within=2.0,
    land_braking=0.2,
)
"""Measured on recorded flights of PX4 v1.16."""


def _return_height(handling: Handling, away: float, _up: float) -> float:
    """Return the return height as `RTL::calculate_return_alt_from_cone_half_angle` and its caller (rtl.cpp, 1.16)."""
    if not handling.cone_deg:
        return handling.return_up
    if away <= handling.acceptance_m:
        return min(2 * away, handling.return_up)
    height = handling.return_up
    if away <= handling.near_m:
        height = min(height, away / tan(radians(min(max(handling.cone_deg, 1.0), 89.0))))
    return max(height, 2 * handling.acceptance_m)


HANDLING = Handling(
    agility=_AGILITY,
    return_height=_return_height,
    climb=3.0,
    takeoff_climb=1.5,
    land_speed=0.6,
    land_below=5.0,
    # after takeoff PX4 only warns of an attitude failure, unless CBRK_FLIGHTTERM is changed (failsafe.cpp)
    crash_disarm_s=None,
    after_takeoff=FlightMode.LOITER,
    after_landing=FlightMode.LOITER,
    lifts_to_targets=True,
    comes_back=True,
)
