"""Flight characteristics of a flavour: fixed ones (`Agility`) and those that parameters change (`Handling`)."""

from collections.abc import Callable
from dataclasses import dataclass
from math import hypot

from rtshcua.model.faults import FlightMode
from rtshcua.simulation.kinematics import Approach, Body


@dataclass(frozen=True, slots=True)
class Stopping:
    """A manoeuvre that stops the vehicle from any ground speed (m/s)."""

    approach: Approach
    hardest: float
    """The greatest acceleration, in m/s^2."""
    ahead: Callable[[float], float]
    """The stopping distance."""
    told: Callable[[float], float]
    """The stopping distance that the vehicle reports."""

    def place(self, body: Body) -> tuple[float, float]:
        """Return the stopping point, in metres north and east of home."""
        return _in_front(body, self.ahead)

    def told_place(self, body: Body) -> tuple[float, float]:
        """Return the stopping point that the vehicle reports."""
        return _in_front(body, self.told)


def _in_front(body: Body, distance: Callable[[float], float]) -> tuple[float, float]:
    speed = hypot(body.v_north, body.v_east)
    if speed == 0:
        return body.north, body.east
    time = distance(speed) / speed
    return body.north + body.v_north * time, body.east + body.v_east * time


@dataclass(frozen=True, slots=True)
class Agility:
    """Fixed characteristics. Accelerations in m/s^2, times in seconds."""

    acceleration: float
    approach: Approach
    """The speed profile before a target."""
    stop: Stopping
    """How it stops to hold a place."""
    brake: Stopping
    """How it stops in BRAKE."""
    land: Stopping
    """How it stops to land."""
    climb_acceleration: float
    climb_approach: Approach
    """The speed profile before a target height."""
    takeoff_acceleration: float
    takeoff_within: float
    """A takeoff ends within this distance of its height, in metres."""
    spool_s: float
    """The time after arming before it can lift off."""
    ramp_s: float
    """From the end of that time, or from the command, to lift-off."""
    land_detect_s: float
    """How long it stands before it detects the landing."""
    land_braking: float
    """The deceleration before the last part of a landing."""
    overshoot_s: float = 0.0
    """Overshoot past a target, in metres per m/s of speed."""
    home_within: float = 0.5
    """A return has reached home within this distance, in metres."""
    return_wait_s: float = 0.0
    """How long it hovers over home before it descends."""


@dataclass(slots=True)
class Handling:
    """Characteristics that parameters change. Speeds in m/s, heights in metres above home, times in seconds."""

    agility: Agility
    climb: float
    takeoff_climb: float
    land_speed: float
    """The rate of descent below `land_below`."""
    land_below: float
    cruise: float = 5.0
    max_speed: float = 12.0
    descent: float = 1.5
    return_height: Callable[["Handling", float, float], float] = lambda handling, _away, _up: handling.return_up
    """The height of a return by its distance from home and its height at the start, before the fence's limit."""
    return_up: float = 30.0
    """The height of the way home, unless it begins near home."""
    near_m: float = 10.0
    """PX4 (RTL_MIN_DIST): within this distance the way home is flown inside the cone."""
    cone_deg: float = 45.0
    """PX4 (RTL_CONE_ANG): half the opening angle of the cone, whose tip is at home; 0: no cone."""
    acceptance_m: float = 2.0
    """PX4 (NAV_ACC_RAD): the acceptance radius of a place."""
    cone_slope: float = 3.0
    """ArduCopter (RTL_CONE_SLOPE): the greatest climb in metres per metre of distance; 0: no limit."""
    climb_least: float = 0.0
    """ArduCopter (RTL_CLIMB_MIN): the least climb before the way home."""
    return_speed: float = 0.0
    """The speed of the way home; 0: the usual speed."""
    acceleration: float = 3.0
    """The greatest acceleration towards a target, m/s^2."""
    takeoff_up: float = 2.5
    """The default takeoff height."""
    idle_disarm_s: float = 10.0
    landed_disarm_s: float = 2.0
    """From the detected landing to disarming."""
    after_takeoff: FlightMode | None = None
    after_landing: FlightMode | None = None
    forgets_speed: bool = False
    """Whether a mode change resets the speed to cruise speed."""
    forgets_at_first_target: bool = False
    """Whether the first target in GUIDED does the same, as recorded."""
    lifts_to_targets: bool = False
    """Whether a target makes an armed vehicle on the ground lift off."""
    crash_disarm_s: float | None = None
    """From a crash to disarming; None: never."""
    comes_back: bool = False
    """Whether it flies back to where a return (place) or a hold (height) was commanded."""
