"""Windows of the local time of day, and when a zone exists, on a clock whose error is bounded.

A moment `t` with error `e` is somewhere in `t - e`..`t + e`: a window or an interval holds when all of that is inside
it, fails when all of it is outside, and is unknown otherwise. A zone exists in a window of the local day, an interval
of UTC, or both (Kleene's `and`); outside of them nothing is inside it.
"""

from rtshcua.decision.values import AND, FALSE, TRUE, UNKNOWN, Span, Truth
from rtshcua.model.flat.limits import DAY
from rtshcua.model.flat.zone import Zone


class Daytime:
    """The window from `start` to `end`, both included, in us since local midnight; over midnight when `start > end`."""

    __slots__ = ("_length", "_offset", "_start")

    def __init__(self, start: int, end: int, utc_offset_us: int) -> None:
        self._start, self._offset = start, utc_offset_us
        last = min(end, DAY - 1)
        self._length = last - start + 1 if start <= last else DAY - start + last + 1

    def truth(self, utc: tuple[Span, ...], error: Span) -> Truth:
        """Whether the moments of some intervals of UTC, each known to within an error in `error`, are in the window."""
        length, (least, most), truth = self._length, error, 0
        if length >= DAY:
            return TRUE
        for low, high in utc:
            # how far after the start of the window the interval begins, and how long it is
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


def _meets(start: int, length: int, at: int, width: int) -> bool:
    """Whether the arc of `length` moments from `start` of the day shares one with `at`..`at + width`."""
    return length > 0 and ((at - start) % DAY < length or (start - at) % DAY <= width)


class Dates:
    """The moments from `start` to `end`, both included, UTC in us."""

    __slots__ = ("_end", "_start")

    def __init__(self, start: int, end: int) -> None:
        self._start, self._end = start, end

    def truth(self, utc: tuple[Span, ...], error: Span) -> Truth:
        """Whether the moments of some intervals, each known to within an error in `error`, are in the interval."""
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
    """All that says when a zone exists."""

    __slots__ = ("_parts",)

    def __init__(self, zone: Zone, utc_offset_us: int) -> None:
        parts: list[Daytime | Dates] = []
        if zone.daily:
            parts.append(Daytime(zone.daily[0], zone.daily[1], utc_offset_us))
        if zone.dates:
            parts.append(Dates(zone.dates[0], zone.dates[1]))
        self._parts = tuple(parts)

    def truth(self, utc: tuple[Span, ...], error: Span, through: int) -> Truth:
        """What may be true of the zone's existing at some moment from one of `utc` to `through` us after it."""
        if through:
            utc = tuple((low, high + through) for low, high in utc)
        truth = TRUE
        for part in self._parts:
            truth = AND[truth][part.truth(utc, error)]
        return truth
