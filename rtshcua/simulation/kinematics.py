"""How the vehicle moves: a body that leans to accelerate, in moving air, and tracks a target. Metres, seconds, radians.

It plans its speed so that it can stop at the target, leans towards the speed it wants, no faster than it can turn and
no further than it may lean, and learns from where it drifts how much it must lean against the wind.
"""

from dataclasses import dataclass, field
from math import atan, atan2, copysign, cos, hypot, pi, sin, sqrt, tan

GRAVITY = 9.80665
MAX_AIRSPEED = 18.0
"""More wind than this carries the vehicle away: then it leans as far as it may, and that is not enough."""
MAX_LEAN = 35 * pi / 180
_MOST = GRAVITY * tan(MAX_LEAN)
_ROTOR_DRAG = 0.15
"""Deceleration of still air by the speed through it, 1/s: what the blades meet."""
_BODY_DRAG = (_MOST / MAX_AIRSPEED - _ROTOR_DRAG) / MAX_AIRSPEED
"""The same by its square, 1/m: what the body meets."""
JERK = 12.0
"""How fast acceleration changes, m/s^3: what turning the body takes."""
_CLIMB_JERK = 12.0
_LEARN_S = 1.0
"""How long it takes to learn what the wind does."""
_FOLLOW = 2.0
"""Acceleration asked for by speed that is missing, 1/s."""
MAX_FALL = 15.0
YAW_RATE = pi / 2
TUMBLE_RATE, TIPPED = pi, 80 * pi / 180
"""How fast what falls tips over, and how far: it comes to lie on its side."""


@dataclass(frozen=True, slots=True)
class Approach:
    """How speed is planned in front of a place: a root of the distance, as for an even deceleration; linear near it.

    `braking` in m/s^2; near the place speed is `gain` (1/s) times the distance.
    """

    braking: float
    gain: float
    linear: float = field(init=False, repr=False, compare=False)
    """From this distance on, in m, it is linear."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "linear", self.braking / self.gain**2)

    def speed(self, distance: float) -> float:
        """The greatest speed from which the vehicle still stops at `distance`."""
        linear = self.linear
        return distance * self.gain if distance <= linear else sqrt(2 * self.braking * (distance - linear / 2))

    def distance(self, speed: float) -> float:
        """The inverse of `speed`: how far ahead the place is where a vehicle of that speed can stop."""
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
    """The yaw of the last step that it flew, while roll and pitch were not worked out since; else None."""
    a_up: float = 0.0
    """The present acceleration upwards."""
    lean_north: float = 0.0
    lean_east: float = 0.0
    """The acceleration that leaning gives."""
    _trim_north: float = 0.0
    _trim_east: float = 0.0
    """The part of it that is to hold against the wind."""

    def track(
        self,
        dt: float,
        want: tuple[float, float],
        most: float,
        climb: float,
        climb_most: float,
        wind: tuple[float, float],
    ) -> None:
        """One step towards the ground velocity `want` (north, east), accelerating by at most `most`.

        `climb` is the wanted speed upwards, reached by at most `climb_most`; `wind` is the velocity of the air.
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
        """One step held level: without a position the vehicle goes where the air goes."""
        self._fly(dt, 0.0, 0.0, climb, climb_most, wind)

    def thrust(self) -> float:
        """What the motors carry, the weight being 1."""
        return sqrt((GRAVITY + self.a_up) ** 2 + self.lean_north**2 + self.lean_east**2) / GRAVITY

    @property
    def roll(self) -> float:
        """How far it leans to its right."""
        self._work_out_attitude()
        return self._roll

    @property
    def pitch(self) -> float:
        """How far its nose is up."""
        self._work_out_attitude()
        return self._pitch

    def _work_out_attitude(self) -> None:
        """Of the last step that it flew: only when it is asked for, or before something else changes it."""
        yaw = self._leans_at
        if yaw is not None:
            north, east = cos(yaw), sin(yaw)
            self._pitch = -atan((self.lean_north * north + self.lean_east * east) / GRAVITY)
            self._roll = atan((self.lean_east * north - self.lean_north * east) / GRAVITY)
            self._leans_at = None

    def fall(self, dt: float) -> None:
        """One step without thrust; it tips over."""
        roll = self.roll
        self._roll = roll + copysign(min(TUMBLE_RATE * dt, max(0.0, TIPPED - abs(roll))), roll)
        v_up = self.v_up
        self.a_up = a_up = max(-GRAVITY, (-MAX_FALL - v_up) / dt)
        self.north += self.v_north * dt
        self.east += self.v_east * dt
        self.up += (v_up + a_up * dt / 2) * dt
        self.v_up = v_up + a_up * dt

    def crash(self) -> None:
        """What it flew into stops it."""
        self._work_out_attitude()
        self.v_north = self.v_east = self.lean_north = self.lean_east = 0.0

    def stop(self, upright: bool = True) -> None:
        """Standing on the ground, or lying there as it came down."""
        self.up = self.v_north = self.v_east = self.v_up = self.a_up = 0.0
        self._work_out_attitude()
        if upright:
            self._roll = self._pitch = 0.0
        self.lean_north = self.lean_east = self._trim_north = self._trim_east = 0.0

    def turn(self, dt: float, yaw: float) -> None:
        """Turns the nose towards `yaw`, as fast as it goes."""
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
        # The mean of old and new velocity: exact while the acceleration is constant.
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
    """A value, or what is nearest to it from -`most` to `most`: in half the time of `max` and `min`."""
    if value > most:
        return most
    if value < -most:
        return -most
    return value


def heading(north: float, east: float) -> float:
    """The direction of a velocity, as a yaw."""
    return atan2(east, north)
