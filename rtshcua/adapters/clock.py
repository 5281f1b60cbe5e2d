"""The machine's clocks as the runtime's `Clock` port, and a clock for a simulated vehicle that runs faster than real
time.
"""

import time
from collections.abc import Callable
from typing import Protocol

from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Now
from rtshcua.onboard.ports import Clock, ClockStepped
from rtshcua.wire.clock import DRIFT_US

#: The error of UTC in a simulation, in us: it uses the time of its machine.
UTC_ERROR_US = 100_000
#: Linux's monotonic clock stops in a suspend, and this one does not
_BOOTTIME: int | None = getattr(time, "CLOCK_BOOTTIME", None)


def monotonic_ns() -> int:
    """The machine's monotonic time, including suspended time where the system has such a clock. Otherwise the derived
    time of day and all ages would fall behind.
    """
    return time.clock_gettime_ns(_BOOTTIME) if _BOOTTIME is not None else time.monotonic_ns()


def _machine_us() -> tuple[int, int]:
    return monotonic_ns() // 1_000, time.time_ns() // 1_000


class LinkClock(Clock, Protocol):
    """The `Clock` port with the functions that a link needs."""

    def heard(self, boot_us: int) -> None:
        """Take in the vehicle's time since boot, in us."""
        ...

    def tell(self, whom: Callable[[int], object]) -> None:
        """Report several times a second the vehicle's last known time since boot, in us, to a simulation that waits for
        us. A clock of real time reports nothing.
        """
        ...

    def real_seconds(self, us: int) -> float:
        """The duration of `us` of this clock in real time, for waiting."""
        ...

    def us_in(self, seconds: float) -> int:
        """How far this clock goes, at most, in this real time."""
        ...

    def bound_utc(self, error_us: int, ahead_us: int | None = None) -> None:
        """Set the error bound of UTC; with `ahead_us` also its offset from monotonic time."""
        ...


class SystemClock:
    """Monotonic time and UTC of the machine, in us. UTC is read once and then derived: setting the clock changes
    nothing. Its error is unknown until it is set (`utc.UtcWatch`), and grows from then on.
    """

    def __init__(self, utc_error_us: int = UTC_UNKNOWN_US) -> None:
        self._utc_error_us = utc_error_us
        self._bounded_us = monotonic_ns() // 1_000
        self._ahead_us = time.time_ns() // 1_000 - self._bounded_us

    def now(self) -> Now:
        """The present moment."""
        monotonic_us = monotonic_ns() // 1_000
        grown_us = (monotonic_us - self._bounded_us) * DRIFT_US // 1_000_000
        error_us = min(self._utc_error_us + grown_us, UTC_UNKNOWN_US)
        return Now(monotonic_us, monotonic_us + self._ahead_us, error_us)

    def bound_utc(self, error_us: int, ahead_us: int | None = None) -> None:
        """See `LinkClock`."""
        self._utc_error_us, self._bounded_us = error_us, monotonic_ns() // 1_000
        if ahead_us is not None:
            self._ahead_us = ahead_us

    def heard(self, boot_us: int) -> None:
        """Nothing: the vehicle's time does not matter here."""

    def tell(self, whom: Callable[[int], object]) -> None:
        """Nothing: no simulation waits for this clock."""

    def real_seconds(self, us: int) -> float:
        """The same in seconds."""
        return us / 1_000_000

    def us_in(self, seconds: float) -> int:
        """The same in us."""
        return int(seconds * 1_000_000)


class StepWatch:
    """Detects that the machine's time of day was set: it differs from monotonic time. It checks once a second. Records
    keep the time of day that they began with, and report such a change.
    """

    def __init__(self, machine_us: Callable[[], tuple[int, int]] = _machine_us, least_us: int = UTC_ERROR_US) -> None:
        """`machine_us` returns monotonic time and UTC; differences below `least_us` are ignored."""
        self._machine_us = machine_us
        self._least_us = least_us
        monotonic_us, utc_us = machine_us()
        self._ahead_us = utc_us - monotonic_us
        self._looked_us = monotonic_us

    def events(self, now: Now) -> list[ClockStepped]:
        """The change since the last call, if any."""
        monotonic_us, utc_us = self._machine_us()
        if monotonic_us - self._looked_us < 1_000_000:
            return []
        self._looked_us = monotonic_us
        by_us = utc_us - monotonic_us - self._ahead_us
        if abs(by_us) < self._least_us:
            return []
        self._ahead_us += by_us
        return [ClockStepped(now.monotonic_us, by_us)]


class PacedClock:
    """The time of a simulated vehicle that runs `speed` times faster; never for a real one.

    It follows the vehicle's boot time from its frames, at most `LEAD_US` ahead: if the vehicle's process or this one is
    held up for a moment, which is long at such a speed, the ages of signals do not jump. Without frames for some real
    time it runs freely, so that silence is still detected: after at most `PATIENCE_NS`, and sooner at lower speeds,
    because the time that it stood still is added in one step with the next frame. Before the first frame it is the
    machine's time.
    """

    LEAD_US = 200_000
    TELL_US = 100_000
    PATIENCE_NS = 500_000_000  # from a speed of ten on
    _PATIENCE_FROM = 10

    def __init__(
        self, speed: float, utc_error_us: int = UTC_ERROR_US, machine_ns: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self._speed = speed
        self._patience_ns = int(self.PATIENCE_NS * min(1.0, speed / self._PATIENCE_FROM) ** 2)
        self._utc_error_us = utc_error_us
        self._machine_ns = machine_ns
        self._heard_ns = machine_ns()
        self._base_us = self._last_us = self._heard_ns // 1_000
        self._boot_us: int | None = None
        self._ahead_us = time.time_ns() // 1_000 - self._base_us
        self._tell: Callable[[int], object] = int
        self._told_us = -self.TELL_US

    def now(self) -> Now:
        """The present time; never before the last one."""
        silent_ns = self._machine_ns() - self._heard_ns
        if self._boot_us is None:
            run_us = silent_ns // 1_000
        else:
            free_us = int(max(0, silent_ns - self._patience_ns) * self._speed) // 1_000
            run_us = min(int(silent_ns * self._speed) // 1_000, self.LEAD_US) + free_us
        self._last_us = max(self._last_us, self._base_us + run_us)
        return Now(self._last_us, self._last_us + self._ahead_us, self._utc_error_us)

    def bound_utc(self, error_us: int, ahead_us: int | None = None) -> None:
        """See `LinkClock`; the error of a simulated time of day does not grow."""
        self._utc_error_us = error_us
        if ahead_us is not None:
            self._ahead_us = ahead_us

    def heard(self, boot_us: int) -> None:
        """Follow the vehicle's time. A time that goes back (a restart) is ignored."""
        if self._boot_us is None:
            self._base_us = self.now().monotonic_us
        elif boot_us > self._boot_us:
            self._base_us = max(self._base_us + boot_us - self._boot_us, self._last_us - self.LEAD_US)
        else:
            return
        self._boot_us, self._heard_ns = boot_us, self._machine_ns()
        if boot_us - self._told_us >= self.TELL_US:
            self._told_us = boot_us
            self._tell(boot_us)

    def tell(self, whom: Callable[[int], object]) -> None:
        """See `LinkClock`."""
        self._tell = whom

    def real_seconds(self, us: int) -> float:
        """The same on the machine's clock."""
        return us / 1_000_000 / self._speed

    def us_in(self, seconds: float) -> int:
        """The same on this one."""
        return int(seconds * 1_000_000 * self._speed)
