"""From places to velocities: what the autopilot asks of the body. Metres, seconds, radians."""

from dataclasses import dataclass, field
from math import atan2, copysign, cos, hypot, inf, sin, sqrt

from rtshcua.simulation.handling import Agility, Handling
from rtshcua.simulation.kinematics import Approach, Body
from rtshcua.simulation.place import Point

LEAD_S = 0.4
"""How much earlier it begins to slow down than the plan says: what leaning back takes."""
SPARE = 1.4
"""How much harder than planned it may brake, to keep to the plan."""
ARRIVED_M, ARRIVED_M_S = 0.5, 0.4
"""Nearer and slower than this, it is there."""
_NEAR_M = 0.1
"""So near the target, speed towards it means nothing."""
_LEVEL_M = 2.0
"""So near, the way up or down is not tied to the way ahead any more."""
_PULL = 0.5
"""On a circle, speed towards it for each metre off it, 1/s."""


def towards(body: Body, north: float, east: float, speed: float, approach: Approach) -> tuple[float, float]:
    """The velocity to fly to a place (north, east), at up to `speed`, so that it stops there."""
    north -= body.north
    east -= body.east
    distance = hypot(north, east)
    if distance == 0:
        return 0.0, 0.0
    # Where it will be by the time that it has turned over, so that it does not slow down too late.
    closing = (north * body.v_north + east * body.v_east) / distance if distance > _NEAR_M else 0.0
    left = distance - closing * LEAD_S
    stops = approach.speed(left) if left > 0 else 0.0
    if stops < speed:
        speed = stops
    return north / distance * speed, east / distance * speed


_LEAST_PAST_M = 0.25
"""What it flies past a target less than this is not told from none."""
_TURNED_M_S, _TURNED_M = 0.15, 0.15
"""So slow behind the target, or so near the furthest place, it comes back."""


_BACK_M_S, _BACK_M = 0.5, 2.5
"""How fast it comes back, and from how far at most: the recorded ones took four to nine seconds."""


@dataclass(frozen=True, slots=True)
class Overshoot:
    """How far, in metres, and in which direction it flies past a target before it comes back to it."""

    north: float
    east: float
    far: float = field(init=False, repr=False, compare=False)
    """How far that is, whatever the direction."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "far", hypot(self.north, self.east))

    def is_over(self, body: Body, north: float, east: float) -> bool:
        """Whether it has flown past the target (north, east) and comes back."""
        to_north, to_east, far = self.north, self.east, self.far
        along = ((body.north - north) * to_north + (body.east - east) * to_east) / far
        if along <= 0:
            return False
        speed = (body.v_north * to_north + body.v_east * to_east) / far
        return speed < _TURNED_M_S or far - along < _TURNED_M


def speed_back(body: Body, north: float, east: float) -> float:
    """How fast it comes back to a target that it flew past; from further away, as fast as to any."""
    return _BACK_M_S if hypot(north - body.north, east - body.east) < _BACK_M else inf


def past(here: Point, target: Point, speed: float, agility: Agility) -> Overshoot | None:
    """How it will fly past a target on its way from here at up to `speed`; None if it will not."""
    north, east = target.north - here.north, target.east - here.east
    away = hypot(north, east)
    far = agility.overshoot_s * min(speed, agility.approach.speed(away / 2))
    return Overshoot(north / away * far, east / away * far) if far >= _LEAST_PAST_M else None


def hardest(agility: Agility) -> float:
    """The most that it may accelerate on its way to a target, in m/s^2."""
    return max(agility.acceleration, agility.approach.braking * SPARE)


def is_above(body: Body, north: float, east: float, within: float) -> bool:
    """Whether it is over a place: so near, and standing unless that leaves room to stop."""
    if hypot(north - body.north, east - body.east) >= within:
        return False
    return within > ARRIVED_M or hypot(body.v_north, body.v_east) < ARRIVED_M_S


def around(body: Body, north: float, east: float, radius: float, speed: float) -> tuple[float, float]:
    """The velocity to circle a place at `radius`, clockwise seen from above if that is positive."""
    north, east = body.north - north, body.east - east
    angle = atan2(east, north)
    off = max(-speed, min(speed, (abs(radius) - hypot(north, east)) * _PULL))
    along = copysign(sqrt(speed * speed - off * off), radius)
    return off * cos(angle) - along * sin(angle), off * sin(angle) + along * cos(angle)


def climb_rate(up: float, target: float, handling: Handling, taking_off: bool) -> float:
    """The rate of climb to reach a height and stop there."""
    away = target - up
    fastest = handling.climb if away > 0 else handling.descent
    if taking_off:
        fastest = min(fastest, handling.takeoff_climb)
    stops = handling.agility.climb_approach.speed(abs(away))
    if stops < fastest:
        fastest = stops
    return copysign(fastest, away)


def steepest(body: Body, north: float, east: float, up: float) -> float:
    """The most that it climbs or sinks on its way to a place: the way is straight, as recorded from both."""
    north, east = north - body.north, east - body.east
    away = hypot(north, east)
    if away < _LEVEL_M:
        return inf
    closing = (north * body.v_north + east * body.v_east) / away
    if closing < _NEAR_M:
        closing = _NEAR_M
    return closing * abs(up - body.up) / away


def landing_rate(body: Body, handling: Handling) -> float:
    """The rate of climb, below nothing, of a landing: slow enough where the last part begins."""
    above = max(0.0, body.up + body.v_up * LEAD_S - handling.land_below)
    return -min(handling.descent, sqrt(handling.land_speed**2 + 2 * handling.agility.land_braking * above))
