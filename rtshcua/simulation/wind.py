"""The wind: a mean that faults may step, and gusts about it, drawn from a seeded source."""

from dataclasses import dataclass
from math import atan2, cos, degrees, exp, hypot, radians, sin, sqrt
from random import Random

_GUST_SECONDS = 4.0
"""How long a gust keeps its direction (the correlation time of the process)."""


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
        self.set(wind)

    def set(self, wind: Wind) -> None:
        """Another mean wind from now on."""
        speed, towards = wind.speed_mm_s / 1000, radians(wind.from_deg + 180)
        self._mean = (speed * cos(towards), speed * sin(towards))
        self._gusts = wind.gust_mm_s / 1000
        self._sum()

    def step(self, dt: float) -> None:
        """Lets `dt` seconds pass: an Ornstein-Uhlenbeck process in each axis."""
        if not self._gusts:
            return
        keep = exp(-dt / _GUST_SECONDS)
        spread = self._gusts * sqrt(1 - keep * keep)
        self._gust_north = self._gust_north * keep + self._chance.gauss(0, spread)
        self._gust_east = self._gust_east * keep + self._chance.gauss(0, spread)
        self._sum()

    def _sum(self) -> None:
        self.north, self.east = self._mean[0] + self._gust_north, self._mean[1] + self._gust_east

    @property
    def speed(self) -> float:
        """m/s."""
        return hypot(self.north, self.east)

    @property
    def from_degrees(self) -> float:
        """Where it blows from, -180 to 180, as WIND.direction has it."""
        return degrees(atan2(-self.east, -self.north))
