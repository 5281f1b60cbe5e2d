"""The error bound of UTC and its source. In this order: the kernel, if it is synchronised (NTP, PTP); the vehicle's
SYSTEM_TIME, from its satellite receiver; a bound stated by the operator. Otherwise it is unknown, and so is everything
that depends on the time of day: freshness, approvals, the hours of zones. Nothing is decided by a clock that is only
assumed to be right.

A boundary in a separate process is the only source of the time of day, and this module follows it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from rtshcua.adapters.clock import UTC_ERROR_US, LinkClock
from rtshcua.adapters.vehicle.source_time import SourceTime
from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Now
from rtshcua.onboard.enforcement.isolated import OwnTime
from rtshcua.wire.clock import AUTOPILOT_US, DRIFT_US, STAMP_US, ClockSource

#: the effect that records the source of the bound
CLOCK: Final = "clock"
_SIMULATED: Final = "simulated"


@dataclass(frozen=True, slots=True)
class UtcBound:
    """The source of the bound (`kernel`, `vehicle`, `operator`, `simulated`, `unknown`), and the bound in us."""

    source: str
    error_us: int

    def told(self) -> str:
        """The text in the log."""
        if self.source == "unknown":
            return "unknown: nothing tells how far UTC may be off"
        return f"{self.source}: UTC is true to {self.error_us} us"


def kernel_error_us() -> int | None:
    """The kernel's bound on the error of UTC, in us; None if it is not synchronised or unknown. `adjtimex(2)` without a
    mode changes nothing: STA_UNSYNC in `status`, the state TIME_ERROR, and `maxerror`.
    """
    try:
        import ctypes  # noqa: PLC0415  only where it is asked, which no other command does

        class Timex(ctypes.Structure):
            """`struct timex` up to `status`, and space for the rest."""

            _fields_ = (
                ("modes", ctypes.c_uint),
                ("offset", ctypes.c_long),
                ("freq", ctypes.c_long),
                ("maxerror", ctypes.c_long),
                ("esterror", ctypes.c_long),
                ("status", ctypes.c_int),
                ("rest", ctypes.c_byte * 512),
            )

        timex = Timex()
        state = ctypes.CDLL(None).adjtimex(ctypes.byref(timex))
    except (ImportError, OSError, AttributeError):  # not Linux
        return None
    return synchronised_us(state, timex.status, timex.maxerror)


_STA_UNSYNC: Final = 0x40
_TIME_ERROR: Final = 5


def synchronised_us(state: int, status: int, maxerror: int) -> int | None:
    """The bound in an answer of `adjtimex`; None where the clock is not synchronised."""
    wrong = state < 0 or state == _TIME_ERROR or status & _STA_UNSYNC
    return None if wrong or maxerror < 0 else maxerror


def vehicle_counts(*, apart: bool, keyed: bool) -> bool:
    """Whether a run uses the vehicle's time. A boundary `apart`, in a separate process, accepts it only over a link
    with a key: otherwise anybody could forge it (ADR 78).
    """
    return keyed or not apart


@dataclass(frozen=True, slots=True)
class TimeSources:
    """The sources of a run's time of day: the kernel's error bound in us, None if unknown; whether the vehicle's time
    would count; the operator's bound; whether a listening boundary decides, which has that bound in its command line.
    """

    machine_us: int | None
    vehicle: bool = True
    stated_us: int | None = None
    listens: bool = False


def certain_from_us(moment_us: int, now: Now) -> int:
    """The monotonic time from which it is certain that `moment_us` (UTC) has passed, in us; now, where it is certain
    already, certainly in the future, or the time of day is unknown, because waiting changes nothing.
    """
    wait_us = moment_us + now.utc_error_us - now.utc_us
    may_have_come = now.utc_error_us < UTC_UNKNOWN_US and moment_us <= now.utc_us + now.utc_error_us
    if wait_us <= 0 or not may_have_come:
        return now.monotonic_us
    return now.monotonic_us + wait_us * 1_000_000 // (1_000_000 - DRIFT_US) + 1  # the error grows meanwhile


class UtcWatch:
    """Sets the best known bound of a clock's UTC, once; `bound` is the present one.

    `stated_us` is the operator's bound, None for none. While only that is known, or nothing, `look` uses the vehicle's
    time when it comes, until `settle` ends the waiting. `vehicle`: whether that time counts, by `vehicle_counts`, for a
    rehearsal whose decisions are made in another process.
    """

    def __init__(
        self, clock: LinkClock, stated_us: int | None = None, kernel_us: Callable[[], int | None] | None = None, *,
        vehicle: bool = True,
    ) -> None:  # fmt: skip
        self._clock = clock
        self._stated_us = stated_us
        #: whether the vehicle's time would be used at all
        self.vehicle_counts = vehicle
        self._own: Callable[[bool], OwnTime | None] | None = None
        kernel = (kernel_us or kernel_error_us)()
        self.bound = UtcBound("unknown", UTC_UNKNOWN_US)
        if kernel is not None:
            self._take("kernel", kernel)

    @classmethod
    def simulated(cls, clock: LinkClock) -> "UtcWatch":
        """For a vehicle that this machine simulates: it has this machine's time of day."""
        watch = cls(clock, kernel_us=lambda: None)
        watch._take(_SIMULATED, UTC_ERROR_US)
        return watch

    def follow(self, own: Callable[[bool], OwnTime | None]) -> None:
        """Follow the time of day of a boundary that decides by its own clock; it gets whether waiting has ended. A
        boundary without its own clock changes nothing.
        """
        said = own(False)
        if said is None or said.source is ClockSource.SHARED:
            return
        self._own = own
        if self.bound.source != _SIMULATED:
            self._clock.bound_utc(UTC_UNKNOWN_US)
            self.bound = UtcBound("unknown", UTC_UNKNOWN_US)
            self._follow(said)
        elif (said := own(True)) is not None and said.source is not ClockSource.UNKNOWN:  # the boundary's statement
            self._take(_SIMULATED, said.now.utc_error_us, said.now.utc_us - said.now.monotonic_us)

    def question(self) -> int:
        """The number that the boundary wants back from the vehicle before it accepts its time; 0 for none."""
        said = None if self._own is None or not self.waits else self._own(False)
        return 0 if said is None else said.number

    def _follow(self, said: OwnTime | None) -> bool:
        if said is None or said.source is ClockSource.UNKNOWN:
            return False
        self._take(said.source.name.lower(), said.now.utc_error_us, said.now.utc_us - said.now.monotonic_us)
        return True

    @property
    def waits(self) -> bool:
        """Whether the vehicle's time would still be used."""
        return self.bound.source == "unknown"

    @property
    def vehicle_may_tell(self) -> bool:
        """Whether to ask the vehicle for its time: a separate boundary accepts it only in an answer to its number,
        which it draws on a link with a key. After it has accepted the time it asks no more, until this object follows
        it.
        """
        if not (self.waits and self.vehicle_counts):
            return False
        said = None if self._own is None else self._own(False)
        return self._own is None or (said is not None and (said.number != 0 or said.source is not ClockSource.UNKNOWN))

    def look(self, told: SourceTime, flavour: str, now_us: int) -> bool:
        """Use the vehicle's time, if it is needed and known; return whether it was used."""
        if self._own is not None:
            return self.waits and self._follow(self._own(False))
        utc = told.utc(now_us) if self.waits and self.vehicle_counts else None
        if utc is None:
            return False
        ahead_us, open_us = utc
        self._take("vehicle", AUTOPILOT_US[flavour] + open_us + STAMP_US, ahead_us)
        return True

    def settle(self) -> None:
        """End the waiting for the vehicle's time: the operator's bound holds, if stated."""
        if self._own is not None:
            if self.waits:
                self._follow(self._own(True))  # the boundary's own statement, if any
        elif self.waits and self._stated_us is not None:
            self._take("operator", self._stated_us)

    def _take(self, source: str, error_us: int, ahead_us: int | None = None) -> None:
        self._clock.bound_utc(error_us, ahead_us)
        self.bound = UtcBound(source, error_us)
