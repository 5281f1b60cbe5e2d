"""How far UTC may be off, and who says so.

In this order: the kernel, if it is synchronised (NTP, PTP); the vehicle's SYSTEM_TIME, which it has from its satellite
receiver; a bound that the operator states. Else it is not known, and whatever asks for the time of day is unknown:
freshness, approvals, the hours of zones. What is assumed of a clock that nobody keeps right decides nothing. Where the
boundary is a process of its own, it alone knows the time of day, and this follows it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from rtshcua.adapters.clock import UTC_ERROR_US, LinkClock
from rtshcua.adapters.vehicle.source_time import SourceTime
from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Now
from rtshcua.onboard.enforcement.isolated import OwnTime
from rtshcua.wire.clock import AUTOPILOT_US, DRIFT_US, STAMP_US, ClockSource

#: the effect that says in the log where the bound came from
CLOCK: Final = "clock"
_SIMULATED: Final = "simulated"


@dataclass(frozen=True, slots=True)
class UtcBound:
    """Where the bound comes from (`kernel`, `vehicle`, `operator`, `simulated`, `unknown`), and what it was, in us."""

    source: str
    error_us: int

    def told(self) -> str:
        """As the log has it."""
        if self.source == "unknown":
            return "unknown: nothing tells how far UTC may be off"
        return f"{self.source}: UTC is true to {self.error_us} us"


def kernel_error_us() -> int | None:
    """What the kernel says UTC is off by at most, in us; None where it is not synchronised, or does not say.

    `adjtimex(2)` with no mode set changes nothing: STA_UNSYNC in `status`, the state TIME_ERROR, and `maxerror`.
    """
    try:
        import ctypes  # noqa: PLC0415  only where it is asked, which no other command does

        class Timex(ctypes.Structure):
            """`struct timex`, up to `status`, and room for the rest."""

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
    except (ImportError, OSError, AttributeError):  # another system than Linux
        return None
    return synchronised_us(state, timex.status, timex.maxerror)


_STA_UNSYNC: Final = 0x40
_TIME_ERROR: Final = 5


def synchronised_us(state: int, status: int, maxerror: int) -> int | None:
    """The bound of an answer of `adjtimex`; None where the clock is not synchronised."""
    wrong = state < 0 or state == _TIME_ERROR or status & _STA_UNSYNC
    return None if wrong or maxerror < 0 else maxerror


def vehicle_counts(*, apart: bool, keyed: bool) -> bool:
    """Whether a run takes the vehicle's own time. A boundary `apart`, in a process of its own, believes it over a link
    with a key alone: anybody could say it on another (ADR 78).
    """
    return keyed or not apart


@dataclass(frozen=True, slots=True)
class TimeSources:
    """What a run would take the time of day from: what this machine's is off by at most, in us, None where the kernel
    does not say; whether the vehicle's own would count; what the operator stated; whether a boundary that listens
    decides, in whose command line that stands.
    """

    machine_us: int | None
    vehicle: bool = True
    stated_us: int | None = None
    listens: bool = False


def certain_from_us(moment_us: int, now: Now) -> int:
    """From which monotonic time on it is certain that `moment_us` (UTC) has come, in us; now, where it is certain, has
    certainly not come, or nobody knows the time of day: no waiting changes that.
    """
    wait_us = moment_us + now.utc_error_us - now.utc_us
    may_have_come = now.utc_error_us < UTC_UNKNOWN_US and moment_us <= now.utc_us + now.utc_error_us
    if wait_us <= 0 or not may_have_come:
        return now.monotonic_us
    return now.monotonic_us + wait_us * 1_000_000 // (1_000_000 - DRIFT_US) + 1  # the error grows meanwhile


class UtcWatch:
    """Bounds a clock's UTC by the best that is known, once; `bound` is what it has come to so far.

    `stated_us` is what the operator says, None for nothing. While only that is known, or nothing, `look` takes the
    vehicle's own time where it comes; until `settle` says that no more is waited for. `vehicle`: whether that counts,
    as `vehicle_counts` has it of what is rehearsed here and decided apart.
    """

    def __init__(
        self, clock: LinkClock, stated_us: int | None = None, kernel_us: Callable[[], int | None] | None = None, *,
        vehicle: bool = True,
    ) -> None:  # fmt: skip
        self._clock = clock
        self._stated_us = stated_us
        #: whether the vehicle's own time would be taken at all
        self.vehicle_counts = vehicle
        self._own: Callable[[bool], OwnTime | None] | None = None
        kernel = (kernel_us or kernel_error_us)()
        self.bound = UtcBound("unknown", UTC_UNKNOWN_US)
        if kernel is not None:
            self._take("kernel", kernel)

    @classmethod
    def simulated(cls, clock: LinkClock) -> "UtcWatch":
        """Of a vehicle that this machine simulates: it has this machine's time of day."""
        watch = cls(clock, kernel_us=lambda: None)
        watch._take(_SIMULATED, UTC_ERROR_US)
        return watch

    def follow(self, own: Callable[[bool], OwnTime | None]) -> None:
        """From now on the time of day is that of a boundary that decides by a clock of its own, and by no other; it is
        asked whether no more is waited for. One that has no clock of its own changes nothing.
        """
        said = own(False)
        if said is None or said.source is ClockSource.SHARED:
            return
        self._own = own
        if self.bound.source != _SIMULATED:
            self._clock.bound_utc(UTC_UNKNOWN_US)
            self.bound = UtcBound("unknown", UTC_UNKNOWN_US)
            self._follow(said)
        elif (said := own(True)) is not None and said.source is not ClockSource.UNKNOWN:  # as the boundary was told
            self._take(_SIMULATED, said.now.utc_error_us, said.now.utc_us - said.now.monotonic_us)

    def question(self) -> int:
        """The number that the boundary wants back from the vehicle, before it takes its time; 0 for none."""
        said = None if self._own is None or not self.waits else self._own(False)
        return 0 if said is None else said.number

    def _follow(self, said: OwnTime | None) -> bool:
        if said is None or said.source is ClockSource.UNKNOWN:
            return False
        self._take(said.source.name.lower(), said.now.utc_error_us, said.now.utc_us - said.now.monotonic_us)
        return True

    @property
    def waits(self) -> bool:
        """Whether the vehicle's time would still be taken."""
        return self.bound.source == "unknown"

    @property
    def vehicle_may_tell(self) -> bool:
        """Whether the vehicle is to be asked for its time: a boundary of its own takes it in answer to a number alone,
        which it draws where the link has a key. One that has just taken it asks no more, and we have yet to follow it.
        """
        if not (self.waits and self.vehicle_counts):
            return False
        said = None if self._own is None else self._own(False)
        return self._own is None or (said is not None and (said.number != 0 or said.source is not ClockSource.UNKNOWN))

    def look(self, told: SourceTime, flavour: str, now_us: int) -> bool:
        """Take the vehicle's own time, if it is needed and told. Whether it was taken."""
        if self._own is not None:
            return self.waits and self._follow(self._own(False))
        utc = told.utc(now_us) if self.waits and self.vehicle_counts else None
        if utc is None:
            return False
        ahead_us, open_us = utc
        self._take("vehicle", AUTOPILOT_US[flavour] + open_us + STAMP_US, ahead_us)
        return True

    def settle(self) -> None:
        """The vehicle's time was waited for long enough: what the operator states holds, if it was stated."""
        if self._own is not None:
            if self.waits:
                self._follow(self._own(True))  # as the boundary itself was told, if it was
        elif self.waits and self._stated_us is not None:
            self._take("operator", self._stated_us)

    def _take(self, source: str, error_us: int, ahead_us: int | None = None) -> None:
        self._clock.bound_utc(error_us, ahead_us)
        self.bound = UtcBound(source, error_us)
