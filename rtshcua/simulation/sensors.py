"""What the vehicle believes of itself: the receiver's fix, and the estimate of position. What is ahead: `ranging`."""

from random import Random

from rtshcua.simulation.boot import BootPlan
from rtshcua.simulation.kinematics import Body
from rtshcua.simulation.place import Point

_DRIFT = 0.2
"""How fast the estimate strays in each axis while there is no good fix, m/s."""
_ESTIMATE_NOISE, _FIX_NOISE = 0.03, 0.3


class Sensors:
    """Sensors with noise from a seeded source.

    `coast_s`: how long the estimator goes on without a fix that it believes. `pace`: how much faster than `plan` they
    come up.
    """

    def __init__(self, chance: Random, noisy: bool, coast_s: float, plan: BootPlan, pace: float) -> None:
        self._chance = chance
        self._noisy = noisy
        self._coast_s = coast_s
        self._without_fix_s = 0.0
        self._jump = (0.0, 0.0)
        self._glitch = (0.0, 0.0)
        self._drift = 0.0
        self._last_fix: Point | None = None
        self._plan = plan
        self._pace = pace
        self.age_s = 0.0
        """Seconds since the start, as the plan counts them."""
        self._lost = False

    def step(self, dt: float) -> None:
        """Lets `dt` seconds pass."""
        self.age_s += dt * self._pace
        if self._lost or self.glitching:
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

    def jump(self, north_m: float, east_m: float) -> None:
        """From now on the receiver, and with it the estimate, is off by this much more."""
        self._jump = (self._jump[0] + north_m, self._jump[1] + east_m)

    def glitch(self, north_m: float, east_m: float) -> None:
        """From now on the receiver alone is off by this: the estimator does not believe it. 0, 0: right again."""
        self._glitch = (north_m, east_m)

    # ---------------------------------------------------------------------------------------------- coming up

    @property
    def answers(self) -> bool:
        """Whether there is telemetry of sensors at all."""
        return self.age_s >= self._plan.answers_s

    @property
    def booting(self) -> int | None:
        """HEARTBEAT.system_status while it comes up."""
        return self._plan.booting if self.age_s < self._plan.standby_s else None

    @property
    def initialised(self) -> bool:
        """Whether the estimator runs."""
        return self.age_s >= self._plan.initialised_s

    @property
    def has_attitude(self) -> bool:
        """Whether the estimator knows attitude and height, if not yet where it is."""
        return self.age_s >= self._plan.attitude_s

    @property
    def receives(self) -> bool:
        """Whether the receiver was found."""
        return self.age_s >= self._plan.receiver_s

    @property
    def has_origin(self) -> bool:
        """Whether there is a home."""
        return self.age_s >= self._plan.origin_s

    @property
    def consistent(self) -> bool:
        """Whether the checks of the sensors against each other pass."""
        return self.age_s >= self._plan.checks_s

    @property
    def tells_position(self) -> bool:
        """Whether GLOBAL_POSITION_INT is sent, whatever it is worth."""
        return self.answers if self._plan.tells_early else self.locates

    @property
    def locates(self) -> bool:
        """Whether the estimator has come up far enough to vouch for a position."""
        return self.age_s >= self._plan.position_s

    # ------------------------------------------------------------------------------------------------ position

    @property
    def has_fix(self) -> bool:
        """Whether the receiver has a fix now."""
        return self.receives and not self._lost

    @property
    def glitching(self) -> bool:
        """Whether the estimator does not believe the receiver."""
        return self._glitch != (0.0, 0.0)

    @property
    def has_position(self) -> bool:
        """Whether the estimator vouches for its position."""
        return self._without_fix_s < self._coast_s and self.locates

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
                body.north + self._jump[0] + self._glitch[0] + self._draw(_FIX_NOISE),
                body.east + self._jump[1] + self._glitch[1] + self._draw(_FIX_NOISE),
                body.up + self._draw(_FIX_NOISE),
            )
        return self._last_fix

    def _draw(self, spread: float) -> float:
        return self._chance.gauss(0, spread) if self._noisy else 0.0
