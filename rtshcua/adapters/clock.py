"""The machine's clocks as the runtime's `Clock` port, and one for a simulated vehicle that lives faster than life."""

import time
from collections.abc import Callable
from typing import Protocol

from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Now
from rtshcua.onboard.ports import Clock, ClockStepped
from rtshcua.wire.clock import DRIFT_US

#: How far UTC may be off in a simulation, in us: it has the time of the machine that it runs on.
UTC_ERROR_US = 100_000
#: Linux's monotonic clock stops in a suspend, and this one does not
_BOOTTIME: int | None = getattr(time, "CLOCK_BOOTTIME", None)


def monotonic_ns() -> int:
    """The machine's monotonic time, which goes on while that is suspended, where the system has such a clock: else the
    time of day, carried on by it, would stay behind, and an age too.
    """
    return time.clock_gettime_ns(_BOOTTIME) if _BOOTTIME is not None else time.monotonic_ns()


def _machine_us() -> tuple[int, int]:
    return monotonic_ns() // 1_000, time.time_ns() // 1_000


class LinkClock(Clock, Protocol):
    """The `Clock` port, with what a link needs of it besides."""

    def heard(self, boot_us: int) -> None:
        """A frame of the vehicle said how long it has been up, in us."""
        ...

    def tell(self, whom: Callable[[int], object]) -> None:
        """From now on tell, several times a second, how long the vehicle had been up, in us, when it was last heard: it
        waits for us. A clock that goes on by itself tells nothing.
        """
        ...

    def real_seconds(self, us: int) -> float:
        """How long `us` of this clock last on the machine's, for waiting."""
        ...

    def us_in(self, seconds: float) -> int:
        """How far this clock goes, at most, in that time of the machine's."""
        ...

    def bound_utc(self, error_us: int, ahead_us: int | None = None) -> None:
        """From now on UTC is true to `error_us`; with `ahead_us` it is so far ahead of monotonic time, from now on."""
        ...


class SystemClock:
    """Monotonic time and UTC of the machine, in us. UTC is read once and carried on: a clock step moves nothing.

    How far it may be off is not known until somebody says so (`utc.UtcWatch`), and grows from then on.
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
        """The vehicle's own time does not matter here."""

    def tell(self, whom: Callable[[int], object]) -> None:
        """Nor does whoever lives by it."""

    def real_seconds(self, us: int) -> float:
        """The same in seconds."""
        return us / 1_000_000

    def us_in(self, seconds: float) -> int:
        """The same in us."""
        return int(seconds * 1_000_000)


class StepWatch:
    """Tells when the machine's time of day was set: it went on otherwise than monotonic time. It looks once a second.

    Records carry on the time of day that they began with; that the machine has another one now is for them to say.
    """

    def __init__(self, machine_us: Callable[[], tuple[int, int]] = _machine_us, least_us: int = UTC_ERROR_US) -> None:
        """`machine_us` gives monotonic time and UTC; a difference below `least_us` is no news."""
        self._machine_us = machine_us
        self._least_us = least_us
        monotonic_us, utc_us = machine_us()
        self._ahead_us = utc_us - monotonic_us
        self._looked_us = monotonic_us

    def events(self, now: Now) -> list[ClockStepped]:
        """That it was set since the last call, if it was."""
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
    """Time as a simulated vehicle has it that lives `speed` times as fast; never for a real one.

    It runs on from the vehicle's boot time as frames bring it, at most `LEAD_US` ahead: when the vehicle's process or
    this one is held up for a moment, which at such a speed is a long time, the age of a signal does not jump. Only when
    nothing was heard for some time of the machine's does it run free, so that silence is still noticed: for at most
    `PATIENCE_NS`, and the slower it is the sooner, for what it stood still it makes up for in one step when something
    is heard again. Until the vehicle first tells its time, this is the machine's.
    """

    LEAD_US = 200_000
    TELL_US = 100_000
    PATIENCE_NS = 500_000_000  # from ten times as fast on
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
        """The present moment; never before the last."""
        silent_ns = self._machine_ns() - self._heard_ns
        if self._boot_us is None:
            run_us = silent_ns // 1_000
        else:
            free_us = int(max(0, silent_ns - self._patience_ns) * self._speed) // 1_000
            run_us = min(int(silent_ns * self._speed) // 1_000, self.LEAD_US) + free_us
        self._last_us = max(self._last_us, self._base_us + run_us)
        return Now(self._last_us, self._last_us + self._ahead_us, self._utc_error_us)

    def bound_utc(self, error_us: int, ahead_us: int | None = None) -> None:
        """See `LinkClock`; a simulated time of day grows no worse."""
        self._utc_error_us = error_us
        if ahead_us is not None:
            self._ahead_us = ahead_us

    def heard(self, boot_us: int) -> None:
        """Follow the vehicle's time. One that goes backwards (a new start) is set aside."""
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
