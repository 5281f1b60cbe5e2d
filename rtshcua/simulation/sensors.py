"""The vehicle's sensors: the receiver's fix, the position estimate, and their boot sequence.

Range finders are in `surroundings`.
"""

from dataclasses import dataclass
from math import sqrt
from random import Random

from rtshcua.simulation.kinematics import Body
from rtshcua.simulation.place import Point

FAST_S = 1.0
"""The duration of a fast boot."""


@dataclass(frozen=True, slots=True)
class BootPlan:
    """The recorded times of the boot sequence, in seconds from the start. A text is (time, severity, text), where
    `{amsl}` stands for the height of home.
    """

    answers_s: float
    """SYS_STATUS begins, and a position, possibly of zeros."""
    standby_s: float
    """The heartbeat's status leaves `booting`."""
    booting: int
    """HEARTBEAT.system_status (MAV_STATE) until then."""
    initialised_s: float
    attitude_s: float
    receiver_s: float
    """The receiver has a fix."""
    origin_s: float
    """Home is set, and with it the height above home."""
    checks_s: float
    """Consistency checks pass: modes that need no position can be armed in."""
    position_s: float
    """The position estimate is valid."""
    tells_early: bool
    """Whether GLOBAL_POSITION_INT is sent before that: zeros, then the receiver's position."""
    texts: tuple[tuple[float, int, str], ...] = ()

    @property
    def all_s(self) -> float:
        """The total duration."""
        return max(
            self.answers_s, self.standby_s, self.initialised_s, self.attitude_s, self.receiver_s, self.origin_s,
            self.checks_s, self.position_s, *(at_s for at_s, _, _ in self.texts),
        )  # fmt: skip


_DRIFT = 0.2
"""Drift of the estimate per axis without a good fix, m/s."""
_ESTIMATE_NOISE, _FIX_NOISE = 0.03, 0.3

LATE_S = 0.1
"""The delay of a realistic estimate. Chosen: the recordings do not contain the true position."""
FIX_LATE_S = 0.16
"""The delay of the receiver's fix: ArduCopter's was 58 to 64 ms behind the estimate on all three recorded flights."""
WANDER_M, WANDER_S, WANDER_STEP_S = 0.7, 60.0, 1.0
"""Receiver error per axis (standard deviation; 1 m in the plane), its correlation time, and the step."""


class Sensors:
    """Sensors with noise from a seeded source.

    `coast_s`: how long the estimate stays valid without a trusted fix. `pace`: speed of the boot relative to `plan`.
    `late`: whether the estimate lags behind the truth; `strays`: whether the receiver's error wanders.
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
        self._turns_s = 0.0  # until the next direction of wandering
        self._chance = chance
        self._noisy = noisy
        self._coast_s = coast_s
        self._without_fix_s = 0.0
        self._jump = (0.0, 0.0)
        self.glitch = (0.0, 0.0)
        """Receiver error, metres north and east, that the estimator rejects."""
        self.stray = (0.0, 0.0)
        """Receiver drift, m/s north and east, slow enough for the estimator to follow."""
        self.unhealthy = False
        """Whether the estimator reports itself unhealthy; it continues to estimate."""
        self._drift = 0.0
        self.error = (0.0, 0.0)
        """Error of the estimate, north and east, without noise. The vehicle steers by the estimate."""
        self._last_fix: Point | None = None
        self._plan = plan
        self._pace = pace
        self.age_s = 0.0
        """Seconds since the start, in the plan's time, until the boot is complete."""
        self.lost = False
        """Whether the receiver has lost its fix; the estimate is correct again after it recovers."""
        self._come_up()

    def step(self, dt: float) -> None:
        """Advance by `dt` seconds."""
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
        """Advance an Ornstein-Uhlenbeck process in each axis, in steps of a second and linear between."""
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
        """Let the velocity estimate follow the true velocity, with its delay."""
        part = dt / LATE_S
        north, east, up = self._velocity
        self._velocity = (
            north + (body.v_north - north) * part, east + (body.v_east - east) * part, up + (body.v_up - up) * part
        )  # fmt: skip

    def restart(self) -> None:
        """Restart sensors and estimator. Faults of the receiver persist."""
        self.age_s = self._without_fix_s = self._drift = 0.0
        self._sum()
        self._come_up()

    def _come_up(self) -> None:
        plan, age_s = self._plan, self.age_s
        self._is_up = age_s >= plan.all_s
        self.answers = age_s >= plan.answers_s
        """Whether sensor telemetry is sent."""
        self.booting = plan.booting if age_s < plan.standby_s else None
        """HEARTBEAT.system_status while booting."""
        self.initialised = age_s >= plan.initialised_s
        """Whether the estimator runs."""
        self.has_attitude = age_s >= plan.attitude_s
        """Whether attitude and height are estimated."""
        self.receives = age_s >= plan.receiver_s
        """Whether the receiver was found."""
        self.has_origin = age_s >= plan.origin_s
        """Whether home is set."""
        self.consistent = age_s >= plan.checks_s
        """Whether the consistency checks of the sensors pass."""
        self.locates = age_s >= plan.position_s
        """Whether the boot has reached a valid position."""
        self.estimates = self._without_fix_s < self._coast_s and self.locates
        """Whether there is a position estimate, healthy or not."""
        self.tells_position = self.answers if plan.tells_early else self.locates
        """Whether GLOBAL_POSITION_INT is sent, valid or not."""

    def jump(self, north_m: float, east_m: float) -> None:
        """Add a lasting error to the receiver and the estimate."""
        self._jump = (self._jump[0] + north_m, self._jump[1] + east_m)
        self._sum()

    # ------------------------------------------------------------------------------------------------ position

    @property
    def has_fix(self) -> bool:
        """Whether the receiver has a fix."""
        return self.receives and not self.lost

    @property
    def glitching(self) -> bool:
        """Whether the estimator rejects the receiver's position."""
        return self.glitch != (0.0, 0.0)

    @property
    def has_position(self) -> bool:
        """Whether the position estimate is valid."""
        return self.estimates and not self.unhealthy

    def _sum(self) -> None:
        (north, east), (wander_north, wander_east), drift = self._jump, self._wander, self._drift
        self.error = north + drift + wander_north, east + drift + wander_east
        self.estimates = self._without_fix_s < self._coast_s and self.locates

    def velocity(self, body: Body) -> tuple[float, float, float]:
        """Return the velocity that GLOBAL_POSITION_INT reports: north, east and up."""
        return self._velocity if self.late else (body.v_north, body.v_east, body.v_up)

    def estimate(self, body: Body) -> Point:
        """Return the position that GLOBAL_POSITION_INT reports."""
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
        """Return the position that GPS_RAW_INT reports; the last one while there is no fix."""
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
