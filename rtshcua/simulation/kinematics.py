"""The vehicle's motion: a body that leans to accelerate, in moving air. Metres, seconds, radians.

The body plans its speed so that it can stop at the target, leans towards the wanted velocity within limits of turn
rate and lean angle, and learns from its drift how far to lean against the wind.
"""

from dataclasses import dataclass, field
from math import atan, atan2, copysign, cos, hypot, pi, sin, sqrt, tan

GRAVITY = 9.80665
MAX_AIRSPEED = 18.0
"""Stronger wind than this carries the vehicle away, even at the greatest lean."""
MAX_LEAN = 35 * pi / 180
_MOST = GRAVITY * tan(MAX_LEAN)
_ROTOR_DRAG = 0.15
"""Rotor drag: deceleration per airspeed, 1/s."""
_BODY_DRAG = (_MOST / MAX_AIRSPEED - _ROTOR_DRAG) / MAX_AIRSPEED
"""Body drag: deceleration per squared airspeed, 1/m."""
JERK = 12.0
"""The rate of change of acceleration, m/s^3, limited by turning the body."""
_CLIMB_JERK = 12.0
_LEARN_S = 1.0
"""Time constant of learning the wind's effect."""
_FOLLOW = 2.0
"""Wanted acceleration per missing speed, 1/s."""
MAX_FALL = 15.0
YAW_RATE = pi / 2
TUMBLE_RATE, TIPPED = pi, 80 * pi / 180
"""How fast a falling vehicle tips over, and how far: it ends on its side."""


@dataclass(frozen=True, slots=True)
class Approach:
    """The speed profile before a place: square root of the distance (constant deceleration), linear near the place.

    `braking` in m/s^2; near the place the speed is `gain` (1/s) times the distance.
    """

    braking: float
    gain: float
    linear: float = field(init=False, repr=False, compare=False)
    """The distance below which it is linear, in m."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "linear", self.braking / self.gain**2)

    def speed(self, distance: float) -> float:
        """Return the greatest speed from which the vehicle stops within `distance`."""
        linear = self.linear
        return distance * self.gain if distance <= linear else sqrt(2 * self.braking * (distance - linear / 2))

    def distance(self, speed: float) -> float:
        """Return the stopping distance from `speed`; the inverse of `speed`."""
        if speed <= self.braking / self.gain:
            return speed / self.gain
        return speed * speed / (2 * self.braking) + self.linear / 2


@dataclass(slots=True)
class Body:
    """Position in metres from home, velocity over ground in m/s, and attitude."""

    north: float = 0.0
    east: float = 0.0
    up: float = 0.0
    v_north: float = 0.0
    v_east: float = 0.0
    v_up: float = 0.0
    yaw: float = 0.0
    _roll: float = 0.0
    _pitch: float = 0.0
    _leans_at: float | None = None
    """The yaw of the last step in flight if roll and pitch are not computed yet, otherwise None."""
    a_up: float = 0.0
    """The current upward acceleration."""
    lean_north: float = 0.0
    lean_east: float = 0.0
    """The acceleration from leaning."""
    _trim_north: float = 0.0
    _trim_east: float = 0.0
    """The part of it that compensates the wind."""

    def track(
        self,
        dt: float,
        want: tuple[float, float],
        most: float,
        climb: float,
        climb_most: float,
        wind: tuple[float, float],
    ) -> None:
        """Advance one step towards the ground velocity `want` (north, east), accelerating by at most `most`.

        `climb` is the wanted upward speed, reached with at most `climb_most`; `wind` is the velocity of the air.
        """
        want_north, want_east = want
        ask_north = (want_north - self.v_north) * _FOLLOW
        ask_east = (want_east - self.v_east) * _FOLLOW
        much = hypot(ask_north, ask_east)
        if much > most:
            ask_north *= most / much
            ask_east *= most / much
        self._fly(dt, ask_north + self._trim_north, ask_east + self._trim_east, climb, climb_most, wind)

    def drift(self, dt: float, climb: float, climb_most: float, wind: tuple[float, float]) -> None:
        """Advance one step held level: without a position the vehicle drifts with the air."""
        self._fly(dt, 0.0, 0.0, climb, climb_most, wind)

    def thrust(self) -> float:
        """Return the thrust relative to the weight."""
        return sqrt((GRAVITY + self.a_up) ** 2 + self.lean_north**2 + self.lean_east**2) / GRAVITY

    @property
    def roll(self) -> float:
        """The roll angle, positive to the right."""
        self._work_out_attitude()
        return self._roll

    @property
    def pitch(self) -> float:
        """The pitch angle, positive nose up."""
        self._work_out_attitude()
        return self._pitch

    def _work_out_attitude(self) -> None:
        """Compute roll and pitch of the last step in flight: only on demand, or before they change otherwise."""
        yaw = self._leans_at
        if yaw is not None:
            north, east = cos(yaw), sin(yaw)
            self._pitch = -atan((self.lean_north * north + self.lean_east * east) / GRAVITY)
            self._roll = atan((self.lean_east * north - self.lean_north * east) / GRAVITY)
            self._leans_at = None

    def fall(self, dt: float) -> None:
        """Advance one step without thrust: the body falls and tips over."""
        roll = self.roll
        self._roll = roll + copysign(min(TUMBLE_RATE * dt, max(0.0, TIPPED - abs(roll))), roll)
        v_up = self.v_up
        self.a_up = a_up = max(-GRAVITY, (-MAX_FALL - v_up) / dt)
        self.north += self.v_north * dt
        self.east += self.v_east * dt
        self.up += (v_up + a_up * dt / 2) * dt
        self.v_up = v_up + a_up * dt

    def crash(self) -> None:
        """Stop at an obstacle."""
        self._work_out_attitude()
        self.v_north = self.v_east = self.lean_north = self.lean_east = 0.0

    def stop(self, upright: bool = True) -> None:
        """Come to rest on the ground, upright or as it fell."""
        self.up = self.v_north = self.v_east = self.v_up = self.a_up = 0.0
        self._work_out_attitude()
        if upright:
            self._roll = self._pitch = 0.0
        self.lean_north = self.lean_east = self._trim_north = self._trim_east = 0.0

    def turn(self, dt: float, yaw: float) -> None:
        """Turn the nose towards `yaw` at the yaw rate."""
        away = (yaw - self.yaw + pi) % (2 * pi) - pi
        self.yaw = (self.yaw + within(away, YAW_RATE * dt) + pi) % (2 * pi) - pi

    def _fly(
        self, dt: float, ask_north: float, ask_east: float, climb: float, climb_most: float, wind: tuple[float, float]
    ) -> None:
        much = hypot(ask_north, ask_east)
        if much > _MOST:
            ask_north *= _MOST / much
            ask_east *= _MOST / much
        lean_north, lean_east = self.lean_north, self.lean_east
        change_north, change_east = ask_north - lean_north, ask_east - lean_east
        change, jerk = hypot(change_north, change_east), JERK * dt
        if change > jerk:
            change_north *= jerk / change
            change_east *= jerk / change
        self.lean_north = lean_north = lean_north + change_north
        self.lean_east = lean_east = lean_east + change_east
        v_north, v_east = self.v_north, self.v_east
        air_north, air_east = wind[0] - v_north, wind[1] - v_east
        drag = _ROTOR_DRAG + _BODY_DRAG * hypot(air_north, air_east)
        drag_north, drag_east = drag * air_north, drag * air_east
        learn = dt / _LEARN_S
        self._trim_north += (-drag_north - self._trim_north) * learn
        self._trim_east += (-drag_east - self._trim_east) * learn
        d_north, d_east = (lean_north + drag_north) * dt, (lean_east + drag_east) * dt
        # The mean of the old and the new velocity is exact for constant acceleration.
        self.north += (v_north + d_north / 2) * dt
        self.east += (v_east + d_east / 2) * dt
        self.v_north, self.v_east = v_north + d_north, v_east + d_east
        self._leans_at = self.yaw
        a_up, v_up = self.a_up, self.v_up
        change = within((climb - v_up) * 2 * _FOLLOW, climb_most) - a_up
        self.a_up = a_up = a_up + within(change, _CLIMB_JERK * dt)
        self.up += (v_up + a_up * dt / 2) * dt
        self.v_up = v_up + a_up * dt


def within(value: float, most: float) -> float:
    """Clamp a value to -`most` .. `most`; takes half the time of `max` and `min`."""
    if value > most:
        return most
    if value < -most:
        return -most
    return value


def heading(north: float, east: float) -> float:
    """Return the direction of a velocity, as a yaw."""
    return atan2(east, north)
