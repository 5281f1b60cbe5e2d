"""The surroundings: wind, obstacles, and the range finders' view of them. Metres, radians.

The wind is a mean, which faults may change, with gusts from a seeded source.
"""

from dataclasses import dataclass
from math import asin, atan2, cos, exp, hypot, pi, radians, sin, sqrt
from random import Random

from rtshcua.simulation.kinematics import Body

_GUST_SECONDS = 4.0
"""The correlation time of gusts."""


@dataclass(frozen=True, slots=True)
class Wind:
    """Speed in mm/s, the direction that it blows **from** in degrees, and the standard deviation of gusts in mm/s."""

    speed_mm_s: int = 0
    from_deg: int = 0
    gust_mm_s: int = 0


class Air:
    """The moving air: `north` and `east` are its velocity, m/s."""

    def __init__(self, wind: Wind, chance: Random) -> None:
        self._chance = chance
        self._gust_north = self._gust_east = 0.0
        self._dt = 0.0  # the last step; the factors below are for this step
        self._keep, self._spread = 1.0, 0.0  # decay, and spread for 1 m/s of gusts
        self.set(wind)

    def set(self, wind: Wind) -> None:
        """Change the mean wind."""
        speed, towards = wind.speed_mm_s / 1000, radians(wind.from_deg + 180)
        self._mean = (speed * cos(towards), speed * sin(towards))
        self.gusts = wind.gust_mm_s / 1000
        """The standard deviation of gusts; 0: steady wind."""
        self._sum()

    def step(self, dt: float) -> None:
        """Advance by `dt` seconds: an Ornstein-Uhlenbeck process in each axis."""
        if not self.gusts:
            return
        if dt != self._dt:
            self._dt, self._keep = dt, exp(-dt / _GUST_SECONDS)
            self._spread = sqrt(1 - self._keep * self._keep)
        keep, spread, gauss = self._keep, self.gusts * self._spread, self._chance.gauss
        self._gust_north = self._gust_north * keep + gauss(0, spread)
        self._gust_east = self._gust_east * keep + gauss(0, spread)
        self._sum()

    def _sum(self) -> None:
        self.north, self.east = self._mean[0] + self._gust_north, self._mean[1] + self._gust_east


RANGE_MIN_M, RANGE_MAX_M = 0.2, 40.0
SECTORS = 72
"""The sectors of OBSTACLE_DISTANCE, 5 degrees each."""
_BEAM = radians(2.5)
"""Half the beam width of the forward range finder, and of a sector."""


@dataclass(eq=False, slots=True)
class Cylinder:
    """A cylindrical obstacle from the ground up, such as a tree, a mast or a moving crane. The place is its centre."""

    north: float
    east: float
    radius: float
    height: float
    v_north: float = 0.0
    v_east: float = 0.0

    def seen_from(self, body: Body, bearing: float) -> float | None:
        """Return its distance at this bearing from north; None if it is elsewhere or below the vehicle."""
        if body.up > self.height:
            return None
        north, east = self.north - body.north, self.east - body.east
        away = hypot(north, east)
        if away <= self.radius:
            return 0.0
        off = abs((atan2(east, north) - bearing + pi) % (2 * pi) - pi)
        off = max(0.0, off - _BEAM)
        if off > asin(self.radius / away):
            return None
        return away * cos(off) - sqrt(max(0.0, self.radius**2 - (away * sin(off)) ** 2))

    def is_hit(self, body: Body) -> bool:
        """Return whether the vehicle is inside it."""
        return body.up < self.height and hypot(self.north - body.north, self.east - body.east) < self.radius

    def distance(self, body: Body) -> float:
        """Return its distance from the vehicle; 0 inside."""
        across = hypot(self.north - body.north, self.east - body.east) - self.radius
        return hypot(max(0.0, across), max(0.0, body.up - self.height))


class Surroundings:
    """All obstacles, and a simulated range finder reading without an obstacle."""

    def __init__(self) -> None:
        self.pillars: list[Cylinder] = []
        self.moving = False
        """Whether any obstacle moves."""
        self._ahead: float | None = None

    def put(self, pillar: Cylinder) -> None:
        """Add an obstacle."""
        self.pillars.append(pillar)
        self.moving = self.moving or (pillar.v_north, pillar.v_east) != (0.0, 0.0)

    def take(self, pillar: Cylinder) -> None:
        """Remove an obstacle."""
        self.pillars.remove(pillar)

    def step(self, dt: float) -> None:
        """Move the obstacles by `dt` seconds."""
        for pillar in self.pillars:
            pillar.north += pillar.v_north * dt
            pillar.east += pillar.v_east * dt

    def distance(self, body: Body) -> float | None:
        """Return the distance of the nearest obstacle; None if there is none."""
        return min((pillar.distance(body) for pillar in self.pillars), default=None)

    def see(self, distance_m: float | None) -> None:
        """Set a constant reading ahead at this distance, or None to end it."""
        self._ahead = distance_m

    def ahead(self, body: Body) -> float | None:
        """Return the distance ahead, within the sensor's range; None if nothing is in range."""
        return self._nearest(body, body.yaw, self._ahead)

    def around(self, body: Body) -> list[float | None]:
        """Return the distance in each sector, from ahead clockwise."""
        step = 2 * pi / SECTORS
        return [self._nearest(body, body.yaw + n * step, self._ahead if n == 0 else None) for n in range(SECTORS)]

    def is_hit(self, body: Body) -> bool:
        """Return whether the vehicle is inside an obstacle."""
        return bool(self.pillars) and any(pillar.is_hit(body) for pillar in self.pillars)

    def _nearest(self, body: Body, bearing: float, least: float | None) -> float | None:
        for pillar in self.pillars:
            seen = pillar.seen_from(body, bearing)
            if seen is not None and (least is None or seen < least):
                least = seen
        return None if least is None or least > RANGE_MAX_M else max(least, RANGE_MIN_M)
