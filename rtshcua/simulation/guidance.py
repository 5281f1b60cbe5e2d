"""Guidance: the velocities that lead to a place. Metres, seconds, radians."""

from dataclasses import dataclass, field
from math import atan2, copysign, cos, hypot, inf, sin, sqrt

from rtshcua.simulation.handling import Agility, Handling
from rtshcua.simulation.kinematics import Approach, Body
from rtshcua.simulation.place import Point

LEAD_S = 0.4
"""How much earlier than planned it begins to brake: the time of leaning back."""
SPARE = 1.4
"""Factor by which it may brake harder than planned, to keep to the plan."""
ARRIVED_M, ARRIVED_M_S = 0.5, 0.4
"""The vehicle has arrived when it is nearer and slower than this."""
_NEAR_M = 0.1
"""Below this distance the closing speed is not defined."""
_LEVEL_M = 2.0
"""Below this distance the vertical path is independent of the horizontal one."""
_PULL = 0.5
"""On a circle: radial speed per metre of radial error, 1/s."""


def towards(body: Body, north: float, east: float, speed: float, approach: Approach) -> tuple[float, float]:
    """Return the velocity to fly to a place (north, east) at up to `speed` and stop there."""
    north -= body.north
    east -= body.east
    distance = hypot(north, east)
    if distance == 0:
        return 0.0, 0.0
    # Plan from where it will be once it has leaned back, so that it does not brake too late.
    closing = (north * body.v_north + east * body.v_east) / distance if distance > _NEAR_M else 0.0
    left = distance - closing * LEAD_S
    stops = approach.speed(left) if left > 0 else 0.0
    if stops < speed:
        speed = stops
    return north / distance * speed, east / distance * speed


_LEAST_PAST_M = 0.25
"""A shorter overshoot counts as none."""
_TURNED_M_S, _TURNED_M = 0.15, 0.15
"""Below this speed, or this near the furthest point, it turns back."""


_BACK_M_S, _BACK_M = 0.5, 2.5
"""Speed and greatest distance of the way back: the recorded ones took four to nine seconds."""


@dataclass(frozen=True, slots=True)
class Overshoot:
    """How far past a target it flies, in metres north and east, before it turns back."""

    north: float
    east: float
    far: float = field(init=False, repr=False, compare=False)
    """The length of the overshoot."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "far", hypot(self.north, self.east))

    def is_over(self, body: Body, north: float, east: float) -> bool:
        """Return whether it has flown past the target (north, east) and turns back."""
        to_north, to_east, far = self.north, self.east, self.far
        along = ((body.north - north) * to_north + (body.east - east) * to_east) / far
        if along <= 0:
            return False
        speed = (body.v_north * to_north + body.v_east * to_east) / far
        return speed < _TURNED_M_S or far - along < _TURNED_M


def speed_back(body: Body, north: float, east: float) -> float:
    """Return the speed limit of the way back to a target; unlimited from further away."""
    return _BACK_M_S if hypot(north - body.north, east - body.east) < _BACK_M else inf


def past(here: Point, target: Point, speed: float, agility: Agility) -> Overshoot | None:
    """Return the overshoot of a flight from here to a target at up to `speed`; None if there is none."""
    north, east = target.north - here.north, target.east - here.east
    away = hypot(north, east)
    far = agility.overshoot_s * min(speed, agility.approach.speed(away / 2))
    return Overshoot(north / away * far, east / away * far) if far >= _LEAST_PAST_M else None


def hardest(agility: Agility) -> float:
    """Return the greatest acceleration on the way to a target, in m/s^2."""
    return max(agility.acceleration, agility.approach.braking * SPARE)


def is_above(body: Body, north: float, east: float, within: float) -> bool:
    """Return whether the vehicle is less than `within` metres from a place, measured horizontally. If `within` is at
    most `ARRIVED_M`, it must also move slower than `ARRIVED_M_S`.
    """
    if hypot(north - body.north, east - body.east) >= within:
        return False
    return within > ARRIVED_M or hypot(body.v_north, body.v_east) < ARRIVED_M_S


def around(body: Body, north: float, east: float, radius: float, speed: float) -> tuple[float, float]:
    """Return the velocity to circle a place at `radius`, clockwise seen from above if positive."""
    north, east = body.north - north, body.east - east
    angle = atan2(east, north)
    off = max(-speed, min(speed, (abs(radius) - hypot(north, east)) * _PULL))
    along = copysign(sqrt(speed * speed - off * off), radius)
    return off * cos(angle) - along * sin(angle), off * sin(angle) + along * cos(angle)


def climb_rate(up: float, target: float, handling: Handling, taking_off: bool) -> float:
    """Return the climb rate to reach a height and stop there."""
    away = target - up
    fastest = handling.climb if away > 0 else handling.descent
    if taking_off:
        fastest = min(fastest, handling.takeoff_climb)
    stops = handling.agility.climb_approach.speed(abs(away))
    if stops < fastest:
        fastest = stops
    return copysign(fastest, away)


def steepest(body: Body, north: float, east: float, up: float) -> float:
    """Return the greatest climb or descent rate on a straight path to a place, as recorded from both autopilots."""
    north, east = north - body.north, east - body.east
    away = hypot(north, east)
    if away < _LEVEL_M:
        return inf
    closing = (north * body.v_north + east * body.v_east) / away
    if closing < _NEAR_M:
        closing = _NEAR_M
    return closing * abs(up - body.up) / away


def landing_rate(body: Body, handling: Handling) -> float:
    """Return the (negative) climb rate of a landing, slow enough at the start of the last part."""
    above = max(0.0, body.up + body.v_up * LEAD_S - handling.land_below)
    return -min(handling.descent, sqrt(handling.land_speed**2 + 2 * handling.agility.land_braking * above))
