"""How a flavour's vehicle flies: what parameters may change, and what they may not."""

from collections.abc import Callable
from dataclasses import dataclass
from math import hypot

from rtshcua.model.faults import FlightMode
from rtshcua.simulation.kinematics import Approach, Body


@dataclass(frozen=True, slots=True)
class Stopping:
    """How it stops, from any ground speed (m/s)."""

    approach: Approach
    hardest: float
    """The most that it accelerates meanwhile, in m/s^2."""
    ahead: Callable[[float], float]
    """How far ahead it comes to stand."""
    told: Callable[[float], float]
    """How far ahead it says that it will."""

    def place(self, body: Body) -> tuple[float, float]:
        """Where it comes to stand, in metres north and east of home."""
        return _in_front(body, self.ahead)

    def told_place(self, body: Body) -> tuple[float, float]:
        """The target that it reports."""
        return _in_front(body, self.told)


def _in_front(body: Body, distance: Callable[[float], float]) -> tuple[float, float]:
    speed = hypot(body.v_north, body.v_east)
    if speed == 0:
        return body.north, body.east
    time = distance(speed) / speed
    return body.north + body.v_north * time, body.east + body.v_east * time


@dataclass(frozen=True, slots=True)
class Agility:
    """How hard the autopilot flies its vehicle. Accelerations in m/s^2, times in seconds."""

    acceleration: float
    approach: Approach
    """How it slows down in front of a target."""
    stop: Stopping
    """How it stops when told to stay."""
    brake: Stopping
    """The same in BRAKE."""
    land: Stopping
    """The same when told to land."""
    climb_acceleration: float
    climb_approach: Approach
    """How it slows down in front of a height."""
    takeoff_acceleration: float
    takeoff_within: float
    """So near its height, in metres, a takeoff is over."""
    spool_s: float
    """How long after arming it does not lift off, whatever it is told."""
    ramp_s: float
    """From there, or from the command, to lifting off."""
    land_detect_s: float
    """How long it stands before it knows that it has landed."""
    land_braking: float
    """How it slows down above the height where the last part of a landing begins."""
    overshoot_s: float = 0.0
    """How far it flies past a target before it comes back, by the speed that it flew there with."""
    home_within: float = 0.5
    """So near home, in metres, a return has come home."""
    return_wait_s: float = 0.0
    """How long it hovers over home before it descends."""


@dataclass(slots=True)
class Handling:
    """How it flies; parameters may change it. Speeds in m/s, heights in metres above home, times in seconds."""

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
    """How high above home a return flies that begins so far from home, and so high, where the fence lets it."""
    return_up: float = 30.0
    """The height of the way home, but for one that begins near home."""
    near_m: float = 10.0
    """PX4 (RTL_MIN_DIST): from no further away than this the way home is flown inside of the cone."""
    cone_deg: float = 45.0
    """PX4 (RTL_CONE_ANG): half the angle at the tip of that cone, which stands on it over home; 0: there is none."""
    acceptance_m: float = 2.0
    """PX4 (NAV_ACC_RAD): nearer than this, it counts as there."""
    cone_slope: float = 3.0
    """ArduCopter (RTL_CONE_SLOPE): how many metres higher the way home may be for each metre to fly; 0: any."""
    climb_least: float = 0.0
    """ArduCopter (RTL_CLIMB_MIN): how much higher than before the way home is at least."""
    return_speed: float = 0.0
    """The speed of the way home; 0: as it flies else."""
    acceleration: float = 3.0
    """The most that it gains and loses of its speed in a second, m/s, where it flies to a target."""
    takeoff_up: float = 2.5
    """The height of a takeoff that names none."""
    idle_disarm_s: float = 10.0
    landed_disarm_s: float = 2.0
    """From knowing that it has landed."""
    after_takeoff: FlightMode | None = None
    after_landing: FlightMode | None = None
    forgets_speed: bool = False
    """Whether another mode flies at the cruise speed again."""
    forgets_at_first_target: bool = False
    """Whether so does the first target in GUIDED: a speed that was set before it is lost, as recorded."""
    lifts_to_targets: bool = False
    """Whether a target makes it lift off when it stands armed."""
    crash_disarm_s: float | None = None
    """How long it lies after a crash until it disarms; never if None."""
    comes_back: bool = False
    """Whether it comes back to where it was when it was told to return (the place), or to hold (the height)."""
