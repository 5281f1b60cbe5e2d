"""Parameters that make an autopilot act by itself in flight, prevent arming, or limit where and how fast it flies:
their meaning in words, the values that a mission needs, and how to change them. Sources: the parameter references of
PX4 1.16 (docs.px4.io) and ArduCopter 4.7 (ardupilot.org/copter); ArduCopter's speeds are WPNAV_* in cm/s before 4.7 and
WP_* in m/s from then on.
"""

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from rtshcua.adapters.vehicle import returns
from rtshcua.adapters.vehicle.bounds import FlightReach
from rtshcua.adapters.vehicle.returns import Need
from rtshcua.model.flat.limits import MAX_SPEED
from rtshcua.model.flat.policy import Policy, VehicleLimits


class VehicleSetting(NamedTuple):
    """A parameter, its subject, its values in words, and warnings about some of them. `better` is a value to set in
    place of those.

    For a number, `mm` is the size of its unit in mm, mm/s or ms, and `needs` the range that a policy and the reach of a
    mission need; None where nothing is needed. Where it is 0, `otherwise` names the parameter that counts in its place.
    `limit` is the rule of a choice with which a run refuses values other than 0.
    """

    parameter: str
    about: str
    words: Mapping[float, str] = {}
    warns: Mapping[float, str] = {}
    better: float | None = None
    mm: int = 0
    needs: Callable[[Policy, FlightReach], Need | None] = lambda _policy, _reach: None
    otherwise: str = ""
    limit: returns.ReturnLimit | None = None
    battery: bool = False  # about a low battery

    @property
    def label(self) -> str:
        """Its subject, without the meaning of 0."""
        return self.about.partition(" (0: ")[0]

    @property
    def at_zero(self) -> str:
        """The meaning of 0, if it is not a number; else empty."""
        return self.about.partition(" (0: ")[2].removesuffix(")")

    @property
    def unit(self) -> str:
        """The unit of its number, as text."""
        if not self.mm or "slope" in self.about:
            return ""
        return " s" if "empty" in self.about else " m/s" if "speed" in self.about else " m"


def _speed(policy: Policy, _: FlightReach) -> Need | None:
    vehicle = policy.vehicle
    return Need(vehicle.speeds.cruise if vehicle.speeds else None, vehicle.speed) if vehicle.speed else None


def _speed_and_return(policy: Policy, _: FlightReach) -> Need | None:
    vehicle = policy.vehicle
    least = max(vehicle.speeds.cruise, vehicle.speeds.homeward) if vehicle.speeds else None
    return Need(least, vehicle.speed) if vehicle.speed else None


def _climb(policy: Policy, _: FlightReach) -> Need | None:
    vehicle = policy.vehicle
    return Need(vehicle.speeds.climb if vehicle.speeds else None, vehicle.climb) if vehicle.climb else None


def _descent(policy: Policy, _: FlightReach) -> Need | None:
    vehicle = policy.vehicle
    return Need(vehicle.speeds.descent if vehicle.speeds else None, vehicle.climb) if vehicle.climb else None


def _takeoff(policy: Policy, _: FlightReach) -> Need | None:
    return Need(policy.vehicle.speeds.climb) if policy.vehicle.speeds else None


def _homeward(policy: Policy, _: FlightReach) -> Need | None:
    return Need(policy.vehicle.speeds.homeward) if policy.vehicle.speeds else None


def _landing(policy: Policy, _: FlightReach) -> Need | None:
    return Need(policy.vehicle.speeds.landing) if policy.vehicle.speeds else None


def _slow_below(policy: Policy, _: FlightReach) -> Need | None:
    return Need(most=policy.vehicle.speeds.landing_below) if policy.vehicle.speeds else None


def _gains(slows: int) -> Callable[[Policy, FlightReach], Need | None]:
    """The acceleration that it needs to reach the declared speed on a whole leg, if it slows down by at most `slows`
    mm/s in a second before a target, as recorded.
    """

    def needs(policy: Policy, _: FlightReach) -> Need | None:
        if policy.vehicle.speeds is None:
            return None
        kept = policy.vehicle.speeds.acceleration
        if kept <= slows:
            return Need(kept)
        # speeding up to v and slowing down again takes v / gains / 2 + v / slows / 2 longer than the way at v, and may
        # take v / kept; where slowing down alone takes more, no value is enough
        return Need(-(-kept * slows // (2 * slows - kept)) if kept < 2 * slows else MAX_SPEED)

    return needs


def _returns(policy: Policy, _: FlightReach) -> Need | None:
    height = policy.vehicle.return_altitude
    return Need(height, height) if height else None


def _lasts(policy: Policy, _: FlightReach) -> Need | None:
    """The flight time with a full battery, in ms."""
    vehicle = policy.vehicle
    return Need(-(-(vehicle.endurance_us if vehicle.speeds is None else vehicle.speeds.flight_us) // 1_000))


def _of(needs: Callable[[VehicleLimits], Need | None]) -> Callable[[Policy, FlightReach], Need | None]:
    return lambda policy, _: needs(policy.vehicle)


def _far(policy: Policy, reach: FlightReach) -> Need | None:
    return Need(least=reach.farthest + policy.vehicle.position_error) if reach.farthest else None


def _high(policy: Policy, reach: FlightReach) -> Need | None:
    return Need(least=reach.highest + policy.vehicle.position_error) if reach.highest else None


def _low(policy: Policy, reach: FlightReach) -> Need | None:
    return None if reach.lowest is None else Need(most=reach.lowest - policy.vehicle.position_error)


_FENCES: Final[Mapping[float, str]] = {
    float(bits): " and ".join(
        name for bit, name in ((1, "ceiling"), (2, "circle"), (4, "areas"), (8, "floor")) if bits & bit
    )
    or "none"
    for bits in range(16)
}


_LOST: Final[Mapping[float, str]] = {0: "nothing", 1: "hold", 2: "return", 3: "land", 5: "terminate", 6: "lockdown"}
_MOTORS_OFF: Final = "the motors stop in the air"

SETTINGS: Final[Mapping[str, tuple[VehicleSetting, ...]]] = {
    "px4": (
        VehicleSetting("NAV_DLL_ACT", "when the ground station is lost", _LOST, {5: _MOTORS_OFF, 6: _MOTORS_OFF}),
        VehicleSetting("NAV_RCL_ACT", "when the remote control is lost", _LOST, {5: _MOTORS_OFF, 6: _MOTORS_OFF}),
        VehicleSetting(
            "COM_LOW_BAT_ACT", "when the battery is low", {0: "warns only", 2: "land", 3: "return, then land"},
            {0: "the autopilot does not react to an empty battery"}, 3, battery=True,
        ),
        VehicleSetting(
            "GF_ACTION", "at the fence",
            {0: "nothing", 1: "warns only", 2: "hold", 3: "return", 4: "terminate", 5: "land"},
            {0: "the fence gives no second protection", 1: "the fence gives no second protection", 4: _MOTORS_OFF},
            2,
        ),
        VehicleSetting("GF_MAX_HOR_DIST", "radius of its own fence around home (0: no limit)", mm=1_000, needs=_far),
        VehicleSetting("GF_MAX_VER_DIST", "height of its own fence above home (0: no limit)", mm=1_000, needs=_high),
        VehicleSetting("RTL_RETURN_ALT", "height of a return", mm=1_000, needs=_returns),
        VehicleSetting("RTL_CONE_ANG", "half angle (degrees) of the cone around home with low returns (0: none)"),
        VehicleSetting("RTL_MIN_DIST", "distance from home at which a return may be low", mm=1_000,
            needs=_of(returns.near)),
        VehicleSetting("NAV_MC_ALT_RAD", "error at which a height counts as reached", mm=1_000,
            needs=_of(returns.corner)),
        VehicleSetting("RTL_TYPE", "where a return goes", returns.RETURNS_TO, limit=returns.RTL_TYPE),
        VehicleSetting("MPC_XY_CRUISE", "horizontal speed where a step names none", mm=1_000, needs=_speed_and_return),
        VehicleSetting("MPC_XY_VEL_MAX", "maximum horizontal speed", mm=1_000),
        VehicleSetting("MPC_Z_VEL_MAX_UP", "maximum climb speed", mm=1_000, needs=_climb),
        VehicleSetting("MPC_Z_VEL_MAX_DN", "maximum descent speed", mm=1_000, needs=_descent),
        VehicleSetting("MPC_TKO_SPEED", "climb speed at takeoff", mm=1_000, needs=_takeoff),
        VehicleSetting("MPC_LAND_SPEED", "descent speed at the end of a landing", mm=1_000, needs=_landing),
        VehicleSetting("MPC_LAND_ALT1", "height above home below which a landing is slow", mm=1_000, needs=_slow_below),
        VehicleSetting("MPC_ACC_HOR", "horizontal speed gained in a second", mm=1_000, needs=_gains(750)),
        VehicleSetting(
            "CP_DIST", "distance kept by collision prevention, in position flight (below 0: off)", mm=1_000,
        ),
        VehicleSetting("EKF2_NOAID_TOUT", "dead reckoning, in us, after which the position counts as lost"),
        VehicleSetting("COM_POS_FS_EPH", "horizontal error, in m, at which the position counts as lost"),
        VehicleSetting(
            "COM_RC_OVERRIDE", "sticks take over",
            {0: "never", 1: "in automatic modes", 2: "in offboard", 3: "in automatic modes and offboard"},
            {0: "the pilot's sticks do not end it: use the switch", 2: "the pilot's sticks do not end Hold"}, 1,
        ),
        VehicleSetting(
            "COM_OBL_RC_ACT", "when offboard control is lost",
            {0: "position", 1: "altitude", 2: "stabilised", 3: "return", 4: "land", 5: "hold", 6: "terminate"},
            {6: _MOTORS_OFF},
        ),
        VehicleSetting("COM_DISARM_PRFLT", "seconds until it disarms on the ground", {}, {}),
        VehicleSetting(  # only PX4's simulators have it (docs.px4.io/v1.16/en/simulation/failsafes); 60 by default
            "SIM_BAT_DRAIN", "time until a full simulated battery is empty (0: never)", mm=1_000, needs=_lasts,
        ),
    ),
    "ardupilot": (
        VehicleSetting(
            "FS_GCS_ENABLE", "when the ground station is lost",
            {0: "nothing", 1: "return", 2: "go on if in a mission", 3: "SmartRTL or return", 4: "SmartRTL or land",
             5: "land"},
            {},
        ),
        VehicleSetting(
            "FS_THR_ENABLE", "when the remote control is lost",
            {0: "nothing", 1: "return", 2: "go on if in a mission", 3: "land", 4: "SmartRTL or return",
             5: "SmartRTL or land"},
            {},
        ),
        VehicleSetting(
            "BATT_FS_LOW_ACT", "when the battery is low",
            {0: "warns only", 1: "land", 2: "return", 3: "SmartRTL or return", 4: "SmartRTL or land", 5: "terminate"},
            {0: "the autopilot does not react to an empty battery", 5: _MOTORS_OFF}, 2,
            battery=True,
        ),
        VehicleSetting(
            "BATT_FS_CRT_ACT", "when the battery is critical",
            {0: "warns only", 1: "land", 2: "return", 3: "SmartRTL or return", 4: "SmartRTL or land", 5: "terminate"},
            {5: _MOTORS_OFF}, 1,
        ),
        VehicleSetting(
            "FS_DR_ENABLE", "when it flies by dead reckoning",
            {0: "nothing", 1: "land", 2: "return", 3: "SmartRTL or return", 4: "SmartRTL or land"},
            {0: "the autopilot flies on without a position"}, 1,
        ),
        VehicleSetting(
            "FS_EKF_ACTION", "when the estimator fails",
            {0: "reports only", 1: "land", 2: "altitude hold", 3: "land, even in a manual mode"},
            {0: "the autopilot flies on without knowing where it is"}, 1,
        ),
        VehicleSetting(
            "FENCE_ENABLE", "fence", {0: "off", 1: "on"}, {0: "the fence is off until a flight switches it on"}
        ),
        VehicleSetting(
            "FENCE_AUTOENABLE", "fence switched on automatically",
            {0: "no", 1: "at takeoff", 2: "at takeoff, without the floor when landing", 3: "when armed"},
        ),
        VehicleSetting("FENCE_TYPE", "areas of the fence once it is on", _FENCES),
        VehicleSetting("FENCE_RADIUS", "radius of its circular fence around home", mm=1_000, needs=_far),
        VehicleSetting("FENCE_ALT_MAX", "ceiling of its fence above home", mm=1_000, needs=_high),
        VehicleSetting("FENCE_ALT_MIN", "floor of its fence above home", mm=1_000, needs=_low),
        VehicleSetting("FENCE_MARGIN", "margin kept to the fence", mm=1_000),
        VehicleSetting("RTL_ALT", "height of a return", mm=10, needs=_returns),
        VehicleSetting("RTL_ALT_M", "height of a return", mm=1_000, needs=_returns),
        VehicleSetting(
            "RTL_CONE_SLOPE", "slope of the cone in which a return is low near home (0: none)", mm=1_000,
            needs=_of(returns.slope),
        ),
        VehicleSetting("RTL_CLIMB_MIN", "least climb at the start of a return", mm=10, needs=_of(returns.climb)),
        VehicleSetting("RTL_CLIMB_MIN_M", "least climb at the start of a return", mm=1_000, needs=_of(returns.climb)),
        VehicleSetting("RTL_ALT_TYPE", "height of a return counts from", returns.HEIGHTS_FROM,
            limit=returns.RTL_ALT_TYPE),
        VehicleSetting("RALLY_TOTAL", "rally points, to which a return may go", limit=returns.RALLY_TOTAL),
        VehicleSetting("WPNAV_RADIUS", "distance from a waypoint at which it turns", mm=10, needs=_of(returns.corner)),
        VehicleSetting("WP_RADIUS_M", "distance from a waypoint at which it turns", mm=1_000,
            needs=_of(returns.corner)),
        VehicleSetting(
            "AVOID_ENABLE", "avoids, in LOITER and GUIDED velocity flight",
            {0: "nothing", 1: "fences", 2: "obstacles", 3: "fences and obstacles", 4: "beacon fences",
             7: "fences, obstacles and beacon fences"},
        ),
        VehicleSetting("WPNAV_SPEED", "horizontal speed where a step names none", mm=10, needs=_speed),
        VehicleSetting("WPNAV_SPEED_UP", "climb speed", mm=10, needs=_climb),
        VehicleSetting("WPNAV_SPEED_DN", "descent speed", mm=10, needs=_descent),
        VehicleSetting("WPNAV_ACCEL", "horizontal speed gained in a second", mm=10, needs=_gains(1_250)),
        VehicleSetting(
            "RTL_SPEED", "horizontal speed of a return (0: as elsewhere)", mm=10, needs=_homeward,
            otherwise="WPNAV_SPEED",
        ),
        VehicleSetting("LAND_SPEED", "descent speed at the end of a landing", mm=10, needs=_landing),
        VehicleSetting("LAND_ALT_LOW", "height above home below which a landing is slow", mm=10, needs=_slow_below),
        VehicleSetting("WP_SPD", "horizontal speed where a step names none", mm=1_000, needs=_speed),
        VehicleSetting("WP_SPD_UP", "climb speed", mm=1_000, needs=_climb),
        VehicleSetting("WP_SPD_DN", "descent speed", mm=1_000, needs=_descent),
        VehicleSetting("WP_ACC", "horizontal speed gained in a second", mm=1_000, needs=_gains(1_250)),
        VehicleSetting(
            "RTL_SPEED_MS", "horizontal speed of a return (0: as elsewhere)", mm=1_000, needs=_homeward,
            otherwise="WP_SPD",
        ),
        VehicleSetting("LAND_SPD_MS", "descent speed at the end of a landing", mm=1_000, needs=_landing),
        VehicleSetting("LAND_ALT_LOW_M", "height above home below which a landing is slow", mm=1_000,
            needs=_slow_below),
        VehicleSetting(
            "FENCE_ACTION", "at the fence",
            {0: "reports only", 1: "return or land", 2: "land", 3: "SmartRTL, return or land", 4: "brake or land",
             5: "SmartRTL or land"},
            {0: "the fence gives no second protection"}, 1,
        ),
        VehicleSetting("ARMING_CHECK", "checks before arming", {0: "none", 1: "all"},
            {0: "the autopilot arms in spite of any fault"}, 1),
        VehicleSetting("ARMING_SKIPCHK", "checks left out before arming", {0: "none"}, {}),
        VehicleSetting("DISARM_DELAY", "seconds until it disarms on the ground", {}, {}),
    ),
}  # fmt: skip
