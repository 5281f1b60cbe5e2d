"""What the vehicle believes of itself: the receiver's fix, and the estimate of position; and how both come up.

What is ahead: `surroundings`.
"""

from dataclasses import dataclass
from math import sqrt
from random import Random

from rtshcua.simulation.kinematics import Body
from rtshcua.simulation.place import Point

FAST_S = 1.0
"""All that a fast boot takes."""


@dataclass(frozen=True, slots=True)
class BootPlan:
    """When what is there, in seconds from the start, as recorded. A text is (time, severity, text), and `{amsl}` in it
    home's height.
    """

    answers_s: float
    """Sensors answer: SYS_STATUS, and a position if only of zeros."""
    standby_s: float
    """The heartbeat leaves `booting`."""
    booting: int
    """HEARTBEAT.system_status (MAV_STATE) up to then."""
    initialised_s: float
    attitude_s: float
    receiver_s: float
    """The receiver has a fix."""
    origin_s: float
    """There is a home, and with it a height above it."""
    checks_s: float
    """Nothing is inconsistent any more: without a position, the modes that need none can be armed in."""
    position_s: float
    """The estimator vouches for its position."""
    tells_early: bool
    """Whether GLOBAL_POSITION_INT comes before that: zeros, then what the receiver says."""
    texts: tuple[tuple[float, int, str], ...] = ()

    @property
    def all_s(self) -> float:
        """How long all of it takes."""
        return max(
            self.answers_s, self.standby_s, self.initialised_s, self.attitude_s, self.receiver_s, self.origin_s,
            self.checks_s, self.position_s, *(at_s for at_s, _, _ in self.texts),
        )  # fmt: skip


_DRIFT = 0.2
"""How fast the estimate strays in each axis while there is no good fix, m/s."""
_ESTIMATE_NOISE, _FIX_NOISE = 0.03, 0.3

LATE_S = 0.1
"""How late position and velocity of a real estimate are. Chosen: the recordings do not hold what really was."""
FIX_LATE_S = 0.16
"""The same of the receiver's fix: ArduCopter's was 58 to 64 ms behind the estimate on all three recorded flights."""
WANDER_M, WANDER_S, WANDER_STEP_S = 0.7, 60.0, 1.0
"""How far a receiver strays in each axis (1 m in the plane; standard deviation), and how long an error lasts."""


class Sensors:
    """Sensors with noise from a seeded source.

    `coast_s`: how long the estimator goes on without a fix that it believes. `pace`: how much faster than `plan` they
    come up. `late`: whether what is believed lags behind what is; `strays`: whether the receiver wanders.
    """

    def __init__(
        self, chance: Random, noisy: bool, coast_s: float, plan: BootPlan, pace: float,
        late: bool = False, strays: bool = False,
    ) -> None:  # fmt: skip
        self.late = late
        self._strays = strays
        self._velocity = (0.0, 0.0, 0.0)
        self._wander = (0.0, 0.0)
        self._wandering = (0.0, 0.0)
        self._turns_s = 0.0  # until it wanders elsewhere
        self._chance = chance
        self._noisy = noisy
        self._coast_s = coast_s
        self._without_fix_s = 0.0
        self._jump = (0.0, 0.0)
        self.glitch = (0.0, 0.0)
        """How far the receiver alone is off, metres north and east: the estimator does not believe it."""
        self.stray = (0.0, 0.0)
        """How fast the receiver strays, m/s north and east: slowly enough to be believed."""
        self.unhealthy = False
        """Whether the estimator says that it cannot be trusted, and goes on estimating."""
        self._drift = 0.0
        self.error = (0.0, 0.0)
        """How far the estimate is off, north and east, noise apart. The vehicle steers by the estimate."""
        self._last_fix: Point | None = None
        self._plan = plan
        self._pace = pace
        self.age_s = 0.0
        """Seconds since the start, as the plan counts them, until all is up."""
        self.lost = False
        """Whether the receiver has lost its fix; when it has found it again the estimate is right again."""
        self._come_up()

    def step(self, dt: float) -> None:
        """Lets `dt` seconds pass."""
        if not self._is_up:
            self.age_s += dt * self._pace
            self._come_up()
        if self.lost or self.glitch != (0.0, 0.0):
            self._without_fix_s += dt
            self._drift += _DRIFT * dt
            self._sum()
        else:
            if self._without_fix_s:
                self._without_fix_s = self._drift = 0.0
                self._sum()
            if self._strays:
                self._stray(dt)
        if self.stray != (0.0, 0.0) and not self.lost:
            self.jump(self.stray[0] * dt, self.stray[1] * dt)

    def _stray(self, dt: float) -> None:
        """An Ornstein-Uhlenbeck process in each axis, in steps of a second and straight between."""
        self._turns_s -= dt
        if self._turns_s <= 0:
            self._turns_s += WANDER_STEP_S
            back, spread = 1 / WANDER_S, WANDER_M * sqrt(2 * WANDER_STEP_S / WANDER_S) / WANDER_STEP_S
            north, east = self._wander
            self._wandering = (
                -north * back + self._chance.gauss(0, spread), -east * back + self._chance.gauss(0, spread)
            )  # fmt: skip
        self._wander = (self._wander[0] + self._wandering[0] * dt, self._wander[1] + self._wandering[1] * dt)
        self._sum()

    def follow(self, dt: float, body: Body) -> None:
        """Lets the estimate of the velocity follow, as late as it is."""
        part = dt / LATE_S
        north, east, up = self._velocity
        self._velocity = (
            north + (body.v_north - north) * part, east + (body.v_east - east) * part, up + (body.v_up - up) * part
        )  # fmt: skip

    def restart(self) -> None:
        """The autopilot starts again: sensors and estimator come up anew. What is wrong with the receiver stays."""
        self.age_s = self._without_fix_s = self._drift = 0.0
        self._sum()
        self._come_up()

    def _come_up(self) -> None:
        plan, age_s = self._plan, self.age_s
        self._is_up = age_s >= plan.all_s
        self.answers = age_s >= plan.answers_s
        """Whether there is telemetry of sensors at all."""
        self.booting = plan.booting if age_s < plan.standby_s else None
        """HEARTBEAT.system_status while it comes up."""
        self.initialised = age_s >= plan.initialised_s
        """Whether the estimator runs."""
        self.has_attitude = age_s >= plan.attitude_s
        """Whether the estimator knows attitude and height, if not yet where it is."""
        self.receives = age_s >= plan.receiver_s
        """Whether the receiver was found."""
        self.has_origin = age_s >= plan.origin_s
        """Whether there is a home."""
        self.consistent = age_s >= plan.checks_s
        """Whether the checks of the sensors against each other pass."""
        self.locates = age_s >= plan.position_s
        """Whether the estimator has come up far enough to vouch for a position."""
        self.estimates = self._without_fix_s < self._coast_s and self.locates
        """Whether the estimator has a position, whatever it says of it."""
        self.tells_position = self.answers if plan.tells_early else self.locates
        """Whether GLOBAL_POSITION_INT is sent, whatever it is worth."""

    def jump(self, north_m: float, east_m: float) -> None:
        """From now on the receiver, and with it the estimate, is off by this much more."""
        self._jump = (self._jump[0] + north_m, self._jump[1] + east_m)
        self._sum()

    # ------------------------------------------------------------------------------------------------ position

    @property
    def has_fix(self) -> bool:
        """Whether the receiver has a fix now."""
        return self.receives and not self.lost

    @property
    def glitching(self) -> bool:
        """Whether the estimator does not believe the receiver."""
        return self.glitch != (0.0, 0.0)

    @property
    def has_position(self) -> bool:
        """Whether the estimator vouches for its position."""
        return self.estimates and not self.unhealthy

    def _sum(self) -> None:
        (north, east), (wander_north, wander_east), drift = self._jump, self._wander, self._drift
        self.error = north + drift + wander_north, east + drift + wander_east
        self.estimates = self._without_fix_s < self._coast_s and self.locates

    def velocity(self, body: Body) -> tuple[float, float, float]:
        """The velocity that GLOBAL_POSITION_INT reports: north, east and up."""
        return self._velocity if self.late else (body.v_north, body.v_east, body.v_up)

    def estimate(self, body: Body) -> Point:
        """The position that GLOBAL_POSITION_INT reports."""
        north, east = self.error
        up = body.up
        if self.late:
            north, east, up = (
                north - self._velocity[0] * LATE_S, east - self._velocity[1] * LATE_S, up - self._velocity[2] * LATE_S
            )  # fmt: skip
        return Point(
            body.north + north + self._draw(_ESTIMATE_NOISE),
            body.east + east + self._draw(_ESTIMATE_NOISE),
            up + self._draw(_ESTIMATE_NOISE),
        )

    def fix(self, body: Body) -> Point:
        """The position that GPS_RAW_INT reports; the last one over again while there is no fix."""
        if self.has_fix or self._last_fix is None:
            late_s = FIX_LATE_S if self.late else 0.0
            north, east, up = self._velocity
            self._last_fix = Point(
                body.north - north * late_s + self._jump[0] + self._wander[0] + self.glitch[0] + self._draw(_FIX_NOISE),
                body.east - east * late_s + self._jump[1] + self._wander[1] + self.glitch[1] + self._draw(_FIX_NOISE),
                body.up - up * late_s + self._draw(_FIX_NOISE),
            )
        return self._last_fix

    def _draw(self, spread: float) -> float:
        return self._chance.gauss(0, spread) if self._noisy else 0.0
