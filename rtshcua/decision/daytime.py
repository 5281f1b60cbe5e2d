"""Windows of the local time of day, on a clock whose error is bounded.

A moment `t` with error `e` is somewhere in `t - e`..`t + e`: the window holds when all of that is inside it, fails when
all of it is outside, and is unknown otherwise.
"""

from rtshcua.decision.truth import FALSE, TRUE, UNKNOWN, Truth
from rtshcua.decision.values import Span
from rtshcua.model.flat.limits import DAY


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
