"""How the vehicle moves: a point of limited speed and acceleration that tracks a target. Metres, seconds, radians."""

from dataclasses import dataclass
from math import atan2, cos, hypot, pi, sin, sqrt

GRAVITY = 9.80665
ACCELERATION = 4.0
"""What the motors can give sideways, m/s^2."""
BRAKING = 2.0
"""What braking in front of a target plans with: less than `ACCELERATION`, so that it never overshoots."""
CLIMB_ACCELERATION = 3.0
MAX_AIRSPEED = 18.0
"""More wind than this carries the vehicle away."""
MAX_FALL = 15.0
YAW_RATE = pi / 2

_GAIN = 1.2
"""Near the target, speed is this many times the distance, 1/s."""


def approach_speed(distance: float) -> float:
    """The greatest speed from which the vehicle still stops at `distance`: linear near the target, a root beyond."""
    linear = BRAKING / _GAIN**2
    if distance <= linear:
        return distance * _GAIN
    return sqrt(2 * BRAKING * (distance - linear / 2))


def stopping_distance(speed: float) -> float:
    """The inverse of `approach_speed`: how far ahead the place is where a vehicle of that speed can stop."""
    if speed <= BRAKING / _GAIN:
        return speed / _GAIN
    return speed * speed / (2 * BRAKING) + BRAKING / _GAIN**2 / 2


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
    roll: float = 0.0
    pitch: float = 0.0

    def track(
        self, dt: float, target: tuple[float, float], speed: float, climb: float, wind: tuple[float, float]
    ) -> None:
        """One step towards `target` (north, east) at up to `speed`, climbing at `climb` m/s (down is negative).

        `wind` is the velocity of the air. What of the wanted ground speed needs more air speed than the vehicle has,
        it does not get.
        """
        to_north, to_east = target[0] - self.north, target[1] - self.east
        distance = hypot(to_north, to_east)
        wanted = min(speed, approach_speed(distance))
        air_north, air_east = -wind[0], -wind[1]
        if distance > 0:
            air_north += to_north / distance * wanted
            air_east += to_east / distance * wanted
        airspeed = hypot(air_north, air_east)
        if airspeed > MAX_AIRSPEED:
            air_north *= MAX_AIRSPEED / airspeed
            air_east *= MAX_AIRSPEED / airspeed
        d_north, d_east = air_north + wind[0] - self.v_north, air_east + wind[1] - self.v_east
        change = hypot(d_north, d_east)
        if change > ACCELERATION * dt:
            d_north *= ACCELERATION * dt / change
            d_east *= ACCELERATION * dt / change
        d_up = max(-CLIMB_ACCELERATION * dt, min(CLIMB_ACCELERATION * dt, climb - self.v_up))
        self._move(dt, d_north, d_east, d_up)
        self._lean(dt, d_north / dt, d_east / dt)

    def fall(self, dt: float) -> None:
        """One step without thrust."""
        self._move(dt, 0.0, 0.0, max(-GRAVITY * dt, -MAX_FALL - self.v_up))

    def stop(self) -> None:
        """Standing on the ground."""
        self.up = self.v_north = self.v_east = self.v_up = self.roll = self.pitch = 0.0

    def _move(self, dt: float, d_north: float, d_east: float, d_up: float) -> None:
        # The mean of old and new velocity: exact while the acceleration is constant.
        self.north += (self.v_north + d_north / 2) * dt
        self.east += (self.v_east + d_east / 2) * dt
        self.up += (self.v_up + d_up / 2) * dt
        self.v_north += d_north
        self.v_east += d_east
        self.v_up += d_up

    def _lean(self, dt: float, a_north: float, a_east: float) -> None:
        """Attitude as the acceleration needs it; the nose turns to where the vehicle goes."""
        if hypot(self.v_north, self.v_east) > 1.0:
            turn = (atan2(self.v_east, self.v_north) - self.yaw + pi) % (2 * pi) - pi
            self.yaw = (self.yaw + max(-YAW_RATE * dt, min(YAW_RATE * dt, turn)) + pi) % (2 * pi) - pi
        forward = a_north * cos(self.yaw) + a_east * sin(self.yaw)
        right = a_east * cos(self.yaw) - a_north * sin(self.yaw)
        self.pitch, self.roll = -forward / GRAVITY, right / GRAVITY
