"""A simulated gimbal: its motors turn a camera towards a commanded direction or place, within limits and at a limited
rate. Angles in radians; pitch is positive upwards, yaw clockwise from north or from the nose.
"""

from math import asin, atan2, cos, hypot, isfinite, pi, radians, sin
from typing import Final, NamedTuple

from rtshcua.simulation.kinematics import Body, within
from rtshcua.simulation.place import Point

PITCH: Final = (radians(-120), radians(45))
"""The range of the pitch axis; ArduCopter accepts -120 degrees (recorded)."""
YAW: Final = radians(180)
RATE: Final = radians(60)
"""The greatest speed of an axis, rad/s."""

Quaternion = tuple[float, float, float, float]
"""w, x, y, z: from the camera's frame (forward, right, down) to north, east, down."""


class Angles(NamedTuple):
    """An attitude from north, east, down: roll, pitch and yaw."""

    roll: float
    pitch: float
    yaw: float

    @property
    def quaternion(self) -> Quaternion:
        """The same as a rotation: yaw, then pitch, then roll."""
        (r, p, y) = self.roll / 2, self.pitch / 2, self.yaw / 2
        return (
            cos(r) * cos(p) * cos(y) + sin(r) * sin(p) * sin(y),
            sin(r) * cos(p) * cos(y) - cos(r) * sin(p) * sin(y),
            cos(r) * sin(p) * cos(y) + sin(r) * cos(p) * sin(y),
            cos(r) * cos(p) * sin(y) - sin(r) * sin(p) * cos(y),
        )


def product(one: Quaternion, other: Quaternion) -> Quaternion:
    """Return the rotation `other`, then `one`."""
    (a, b, c, d), (e, f, g, h) = one, other
    return (
        a * e - b * f - c * g - d * h,
        a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    )


def angles(of: Quaternion) -> Angles:
    """Return the angles of a rotation. Straight up or down roll is 0, because it cannot be told from yaw."""
    w, x, y, z = of
    pitch = asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    if abs(abs(pitch) - pi / 2) < 1e-4:
        return Angles(0.0, pitch, wrapped(2 * atan2(z, w)))
    return Angles(
        atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), pitch, atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    )


def wrapped(angle: float) -> float:
    """Return an angle from -pi to pi."""
    return (angle + pi) % (2 * pi) - pi


class SimulatedGimbal:
    """Two axes, pitch and yaw, that keep the horizon level. It begins level, along the nose."""

    def __init__(self) -> None:
        self.pitch = self.yaw = 0.0
        """Where it points: pitch from the horizon, yaw from the nose."""
        self.locked = False
        """Whether the commanded yaw is from north (GIMBAL_MANAGER_FLAGS_YAW_LOCK), and not from the nose."""
        self.stuck = False
        """Whether its motors do not move."""
        self.in_control = (0, 0)
        """The system and component in primary control; 0, 0 for none."""
        self._wanted = (0.0, 0.0)
        self._rates = (0.0, 0.0)
        self._place: Point | None = None

    def point(self, pitch: float, yaw: float, pitch_rate: float, yaw_rate: float, *, locked: bool) -> None:
        """Turn to angles, or turn at rates; a value that is not finite is not commanded. Angles outside of the range
        are limited to it.
        """
        self._place, self.locked = None, locked
        self._wanted = (
            max(PITCH[0], min(PITCH[1], pitch)) if isfinite(pitch) else self._wanted[0],
            wrapped(yaw) if isfinite(yaw) else self._wanted[1],
        )
        self._rates = (
            pitch_rate if isfinite(pitch_rate) and not isfinite(pitch) else 0.0,
            yaw_rate if isfinite(yaw_rate) and not isfinite(yaw) else 0.0,
        )

    def look_at(self, place: Point | None) -> None:
        """Keep pointing at a place, or end that."""
        self._place, self._rates = place, (0.0, 0.0)

    def step(self, dt: float, body: Body) -> None:
        """Advance by `dt` seconds."""
        if self._place is not None:
            north, east = self._place.north - body.north, self._place.east - body.east
            self._wanted = atan2(self._place.up - body.up, hypot(north, east)), atan2(east, north)
            self.locked = True
        pitch, yaw = self._wanted[0] + self._rates[0] * dt, self._wanted[1] + self._rates[1] * dt
        self._wanted = max(PITCH[0], min(PITCH[1], pitch)), wrapped(yaw)
        if not self.stuck:
            goal = wrapped(self._wanted[1] - body.yaw) if self.locked else self._wanted[1]
            self.pitch += within(self._wanted[0] - self.pitch, RATE * dt)
            self.yaw = wrapped(self.yaw + within(wrapped(goal - self.yaw), RATE * dt))

    def attitude(self, body: Body) -> Quaternion:
        """Return the attitude of what it carries."""
        return Angles(0.0, self.pitch, wrapped(body.yaw + self.yaw)).quaternion

    @property
    def attitude_from_nose(self) -> Quaternion:
        """The same with the yaw from the nose."""
        return Angles(0.0, self.pitch, self.yaw).quaternion
