"""What stands in the world, and what the vehicle's sensors see of it. Metres, radians."""

from dataclasses import dataclass
from math import asin, atan2, cos, hypot, pi, radians, sin, sqrt

from rtshcua.simulation.kinematics import Body

RANGE_MIN_M, RANGE_MAX_M = 0.2, 40.0
SECTORS = 72
"""OBSTACLE_DISTANCE looks all around, in sectors of 5 degrees."""
_BEAM = radians(2.5)
"""Half of what the sensor that looks ahead sees at once, and of a sector."""


@dataclass(frozen=True, slots=True)
class Pillar:
    """A tree, a mast, a house: round, from the ground up. The place is that of its middle."""

    north: float
    east: float
    radius: float
    height: float

    def seen_from(self, body: Body, bearing: float) -> float | None:
        """How far away it is at this bearing from north; None if it is not there, or the vehicle is above it."""
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
        """Whether the vehicle is where this is."""
        return body.up < self.height and hypot(self.north - body.north, self.east - body.east) < self.radius


class Surroundings:
    """All that stands around, and what is said to be ahead though it stands nowhere."""

    def __init__(self) -> None:
        self.pillars: list[Pillar] = []
        self._ahead: float | None = None

    def see(self, distance_m: float | None) -> None:
        """Something stays ahead at this distance, wherever the vehicle goes; or does no more."""
        self._ahead = distance_m

    def ahead(self, body: Body) -> float | None:
        """How far it is to what is ahead, within the range of the sensor."""
        return self._nearest(body, body.yaw, self._ahead)

    def around(self, body: Body) -> list[float | None]:
        """The same for each sector, the first ahead, then clockwise."""
        step = 2 * pi / SECTORS
        return [self._nearest(body, body.yaw + n * step, self._ahead if n == 0 else None) for n in range(SECTORS)]

    def is_hit(self, body: Body) -> bool:
        """Whether the vehicle has flown into something."""
        return bool(self.pillars) and any(pillar.is_hit(body) for pillar in self.pillars)

    def _nearest(self, body: Body, bearing: float, least: float | None) -> float | None:
        for pillar in self.pillars:
            seen = pillar.seen_from(body, bearing)
            if seen is not None and (least is None or seen < least):
                least = seen
        return None if least is None or least > RANGE_MAX_M else max(least, RANGE_MIN_M)
