"""Local time, windows of its day or week, and the existence of zones, on a clock with a bounded error.

A moment `t` with error `e` is somewhere in `t - e`..`t + e`. A window or an interval holds when all of that range
is inside it, fails when all of it is outside, and is unknown otherwise. A zone exists in windows of the local day
or week, in an interval of UTC, or in both (Kleene's `and`); outside of them the zone contains nothing.

The vehicle needs no time zone database: a policy carries the moments at which the offset from UTC changes.
"""

from bisect import bisect_right
from collections.abc import Iterator
from itertools import pairwise
from typing import TypeAlias

from rtshcua.decision.values import AND, FALSE, TRUE, UNKNOWN, Span, Truth
from rtshcua.model.flat.limits import DAY, WEEK
from rtshcua.model.flat.policy import VehicleLimits
from rtshcua.model.flat.zone import Zone

#: 1970 began on a Thursday; weeks begin with Monday
_MONDAY = 3 * DAY


class LocalTime:
    """Local time: UTC and an offset that is constant or changes at given moments.

    With `offsets` (see `VehicleLimits`) local time is unknown before the first of the moments and from the last
    one on.
    """

    __slots__ = ("_moments", "_offsets", "fixed")

    def __init__(self, offset_us: int, offsets: tuple[int, ...] = ()) -> None:
        self.fixed = not offsets
        self._moments = offsets[::2]
        self._offsets = offsets[1::2] or (offset_us,)

    def offset(self, moment: int) -> int:
        """The offset from UTC at a moment; outside the known range, that of the nearest known moment."""
        at = bisect_right(self._moments, moment) - 1
        return self._offsets[min(max(at, 0), len(self._offsets) - 1)]

    def known(self) -> Span | None:
        """The range of moments at which local time is known; None if always."""
        return None if self.fixed else (self._moments[0], self._moments[-1])

    def stretches(self, low: int, high: int) -> Iterator[tuple[int, int, int]]:
        """The parts of `low`..`high` with one offset each: the first moment, the first moment after it, and the
        offset.
        """
        if self.fixed:
            yield low, high + 1, self._offsets[0]
            return
        moments = self._moments
        for at in range(max(bisect_right(moments, low) - 1, 0), len(self._offsets)):
            start, end = max(low, moments[at]), min(high + 1, moments[at + 1])
            if start >= end:
                return
            yield start, end, self._offsets[at]

    def changes(self) -> tuple[tuple[int, int, int], ...]:
        """The moments at which the offset changes, with the offset before and after."""
        return tuple(zip(self._moments[1:-1], self._offsets, self._offsets[1:], strict=False))

    def steady(self) -> int:
        """The beginning of a UTC week that starts the longest period of constant offset."""
        if self.fixed:
            return 0
        start, _ = max(pairwise(self._moments), key=lambda part: part[1] - part[0])
        return -(-start // WEEK) * WEEK

    def next(self, daytime: int, moment: int) -> int | None:
        """The first moment at or after a given one that has a given local time of day; None if there is no such
        moment in the known range.
        """
        for start, end, offset in self.stretches(moment, moment + 2 * DAY):
            found = start + (daytime - start - offset) % DAY
            if found < end:
                return found
        return None


def time_of_week(local: int) -> int:
    """The position of a local time within its week."""
    return (local + _MONDAY) % WEEK


def local_time(vehicle: VehicleLimits) -> LocalTime:
    """The local time of a vehicle."""
    return LocalTime(vehicle.utc_offset_us, vehicle.offsets)


class Daytime:
    """The window from `start` to `end`, both included, in us since local midnight; over midnight when `start > end`."""

    __slots__ = ("_length", "_offset", "_start")
    period = DAY

    def __init__(self, start: int, end: int, utc_offset_us: int) -> None:
        self._start, self._offset = start, utc_offset_us
        last = min(end, DAY - 1)
        self._length = last - start + 1 if start <= last else DAY - start + last + 1

    def truth(self, utc: tuple[Span, ...], error: Span) -> Truth:
        """Whether all moments of some intervals of UTC, each known within an error in `error`, are in the window."""
        length, (least, most), truth = self._length, error, 0
        if length >= DAY:
            return TRUE
        for low, high in utc:
            # distance from the start of the window to the interval, and the interval's length
            at, width = (low + self._offset - self._start) % DAY, high - low
            if _meets(least, length - 2 * least, at, width):
                truth |= TRUE
                if width == 0 and least == most and len(utc) == 1:
                    break  # a single moment has a single truth
            if _meets(length + least, DAY - length - 2 * least, at, width):
                truth |= FALSE
            if most and (_meets(-most, 2 * most, at, width) or _meets(length - most, 2 * most, at, width)):
                truth |= UNKNOWN
        return truth

    def changes(self, low: int, high: int) -> Iterator[int]:
        """The moments after `low` and up to `high` at which the window begins, or has just ended."""
        for edge in (self._start, self._start + self._length):
            yield from range(low + 1 + (edge - self._offset - low - 1) % DAY, high + 1, DAY)


def _meets(start: int, length: int, at: int, width: int) -> bool:
    """Whether an arc of `length` from `start` of the day overlaps `at`..`at + width`."""
    return length > 0 and ((at - start) % DAY < length or (start - at) % DAY <= width)


class Windows:
    """Windows of the local day (`period` is DAY) or week (WEEK), ascending; each from one offset within it to before
    another. They hold whenever local time is in one of them, also in both occurrences of an hour that the clock
    repeats, and never in an hour that it skips. They are unknown where local time is.
    """

    __slots__ = ("_everything", "_local", "_parts", "period")

    def __init__(self, windows: tuple[int, ...], period: int, local: LocalTime) -> None:
        self._local, self.period = local, period
        self._parts = tuple(zip(windows[::2], windows[1::2], strict=True))
        self._everything = windows == (0, period)

    def truth(self, utc: tuple[Span, ...], error: Span) -> Truth:
        """Whether all moments of some intervals of UTC, each known within an error in `error`, are in a window."""
        (least, most), truth = error, 0
        any_truth = TRUE | FALSE | (UNKNOWN if most else 0)
        for low, high in utc:
            first = low - most
            for start, end, value in self._stretches(first, high + most):
                if max(low, start + least) <= min(high, end - 1 - least):
                    truth |= value
                if start > first and max(low, start - most) <= min(high, start + most - 1):
                    truth |= UNKNOWN
                if truth & any_truth == any_truth:
                    break  # the result is settled, except where local time is unknown
            if not self._known(low - most, high + most):
                truth |= UNKNOWN
        return truth

    def changes(self, low: int, high: int) -> Iterator[int]:
        """The moments after `low` and up to `high` at which a window begins or has just ended, or local time becomes
        unknown.
        """
        return (start for start, _, _ in self._stretches(low, high) if start > low)

    def _known(self, low: int, high: int) -> bool:
        known = self._local.known()
        return known is None or (known[0] <= low and high < known[1])

    def _stretches(self, low: int, high: int) -> Iterator[tuple[int, int, Truth]]:
        """`low`..`high` in maximal parts of one truth: the first moment, the first moment after it, and the truth."""
        at, last = low, high + 1
        known = self._local.known()
        if known is not None:
            if at < min(known[0], last):
                yield at, min(known[0], last), UNKNOWN
            at, last = min(max(at, known[0]), last), min(last, known[1])
        begun: Span | None = None  # a window that may continue in the next part
        for start, end in self._inside(at, last - 1):
            if begun is not None and begun[1] == start:
                begun = begun[0], end
                continue
            if begun is not None:
                yield *begun, TRUE
                at = begun[1]
            if at < start:
                yield at, start, FALSE
            begun = start, end
        if begun is not None:
            yield *begun, TRUE
            at = begun[1]
        if at < last:
            yield at, last, FALSE
        if max(low, last) <= high:
            yield max(low, last), high + 1, UNKNOWN

    def _inside(self, low: int, high: int) -> Iterator[Span]:
        """The moments inside windows, each part given by its first moment and the first moment after it."""
        for first, last, offset in self._local.stretches(low, high):
            if self._everything:
                yield first, last
                continue
            shift, period = offset + _MONDAY, self.period
            for number in range((first + shift) // period, (last - 1 + shift) // period + 1):
                for start, end in self._parts:
                    begin, over = max(first, number * period + start - shift), min(last, number * period + end - shift)
                    if begin < over:
                        yield begin, over


Window: TypeAlias = Daytime | Windows


def daily(start: int, end: int, local: LocalTime) -> Window:
    """The window from `start` to `end`, both included, in us since local midnight; across midnight when `start >
    end`.
    """
    if local.fixed:
        return Daytime(start, end, local.offset(0))
    after = min(end + 1, DAY)
    windows = (start, after) if start < after else (0, after, start, DAY) if after < start else (0, DAY)
    return Windows(windows, DAY, local)


def weekly(windows: tuple[int, ...], local: LocalTime) -> Window:
    """Windows of the local week, in the form of `Zone.weekly`."""
    return Windows(windows, WEEK, local)


class DateRange:
    """The moments from `start` to `end`, both included, UTC in us."""

    __slots__ = ("_end", "_start")

    def __init__(self, start: int, end: int) -> None:
        self._start, self._end = start, end

    def truth(self, utc: tuple[Span, ...], error: Span) -> Truth:
        """Whether all moments of some intervals, each known within an error in `error`, are in the interval."""
        start, end, (least, most), truth = self._start, self._end, error, 0
        for low, high in utc:
            if max(low, start + least) <= min(high, end - least):
                truth |= TRUE
            if low < start - least or high > end + least:
                truth |= FALSE
            if most and (start - most <= high and low < start + most):
                truth |= UNKNOWN
            if most and (end - most < high and low <= end + most):
                truth |= UNKNOWN
        return truth


class Times:
    """All conditions on when a zone exists."""

    __slots__ = ("_parts",)

    def __init__(self, zone: Zone, local: LocalTime) -> None:
        self._parts = (*windows_of(zone, local), *(DateRange(*dates) for dates in (zone.dates,) if dates))

    def truth(self, utc: tuple[Span, ...], error: Span, through: int) -> Truth:
        """The possible truths of "the zone exists" at some moment from one of `utc` to `through` us after it."""
        if through:
            utc = tuple((low, high + through) for low, high in utc)
        truth = TRUE
        for part in self._parts:
            truth = AND[truth][part.truth(utc, error)]
        return truth


def timed(zone: Zone) -> bool:
    """Whether a zone exists at some times only."""
    return bool(zone.daily or zone.weekly or zone.dates)


def windows_of(zone: Zone, local: LocalTime) -> tuple[Window, ...]:
    """The windows of the day or the week in which a zone exists."""
    if zone.daily:
        return (daily(zone.daily[0], zone.daily[1], local),)
    return (weekly(zone.weekly, local),) if zone.weekly else ()
