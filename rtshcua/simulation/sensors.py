"""What the vehicle believes of itself: the receiver's fix, the estimate of position, and the obstacle sensor."""

from random import Random

from rtshcua.simulation.kinematics import Body
from rtshcua.simulation.place import Point

BOOT_S = 1.0
"""After this many seconds there is a fix and a position, and the vehicle is ready to arm."""
RANGE_MIN_MM, RANGE_MAX_MM = 200, 40_000
_DRIFT = 0.2
"""How fast the estimate strays in each axis while there is no fix, m/s."""
_ESTIMATE_NOISE, _FIX_NOISE = 0.03, 0.3


class Sensors:
    """Sensors with noise from a seeded source. `coast_s`: how long the estimator goes on without a fix."""

    def __init__(self, chance: Random, noisy: bool, coast_s: float) -> None:
        self._chance = chance
        self._noisy = noisy
        self._coast_s = coast_s
        self._without_fix_s = 0.0
        self._jump = (0.0, 0.0)
        self._drift = 0.0
        self._last_fix: Point | None = None
        self.age_s = 0.0
        self._lost = False
        self.obstacle_mm: int | None = None

    def step(self, dt: float) -> None:
        """Lets `dt` seconds pass."""
        self.age_s += dt
        if self._lost:
            self._without_fix_s += dt
            self._drift += _DRIFT * dt
        else:
            self._without_fix_s = self._drift = 0.0

    def lose_fix(self) -> None:
        """The receiver loses its fix."""
        self._lost = True

    def find_fix(self) -> None:
        """The receiver has its fix again, and the estimate is right again."""
        self._lost = False

    def see(self, distance_mm: int | None) -> None:
        """Something is ahead at this distance, or nothing is."""
        self.obstacle_mm = distance_mm

    def jump(self, north_m: float, east_m: float) -> None:
        """From now on the receiver, and with it the estimate, is off by this much more."""
        self._jump = (self._jump[0] + north_m, self._jump[1] + east_m)

    @property
    def booted(self) -> bool:
        """Whether sensors and estimator have come up."""
        return self.age_s >= BOOT_S

    @property
    def has_fix(self) -> bool:
        """Whether the receiver has a fix now."""
        return self.booted and not self._lost

    @property
    def has_position(self) -> bool:
        """Whether the estimator still vouches for its position."""
        return self.booted and self._without_fix_s < self._coast_s

    @property
    def error(self) -> tuple[float, float]:
        """How far the estimate is off, north and east, noise apart. The vehicle steers by the estimate."""
        return self._jump[0] + self._drift, self._jump[1] + self._drift

    def estimate(self, body: Body) -> Point:
        """The position that GLOBAL_POSITION_INT reports."""
        north, east = self.error
        return Point(
            body.north + north + self._draw(_ESTIMATE_NOISE),
            body.east + east + self._draw(_ESTIMATE_NOISE),
            body.up + self._draw(_ESTIMATE_NOISE),
        )

    def fix(self, body: Body) -> Point:
        """The position that GPS_RAW_INT reports; the last one over again while there is no fix."""
        if self.has_fix or self._last_fix is None:
            self._last_fix = Point(
                body.north + self._jump[0] + self._draw(_FIX_NOISE),
                body.east + self._jump[1] + self._draw(_FIX_NOISE),
                body.up + self._draw(_FIX_NOISE),
            )
        return self._last_fix

    def _draw(self, spread: float) -> float:
        return self._chance.gauss(0, spread) if self._noisy else 0.0
