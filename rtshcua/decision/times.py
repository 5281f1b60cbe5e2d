"""When a zone exists: a window of the local day, an interval of UTC, or both. Outside of them nothing is inside it.

A moment `t` with a clock's error `e` is somewhere in `t - e`..`t + e`. Each of the two is true when all of that is in
it, false when none is, unknown otherwise; the zone exists when both are true (Kleene's `and`).
"""

from rtshcua.decision.daytime import Daytime
from rtshcua.decision.truth import AND, FALSE, TRUE, UNKNOWN, Truth
from rtshcua.decision.values import Span
from rtshcua.model.flat.zone import Zone


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
