"""Where a boundary has the time of day from, and what of another's word it bears out; its statements say both."""

from enum import IntEnum
from typing import Final

from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Now

#: how far a time of day that is named may be from the boundary's own, beyond the errors of both, in us
APART_US: Final = 2_000_000
#: how much more UTC may be off after each second, in us: the kernel takes no clock for worse (500 ppm, MAXFREQ)
DRIFT_US: Final = 500


class Source(IntEnum):
    """Where a boundary has the time of day from."""

    UNKNOWN = 0
    KERNEL = 1
    VEHICLE = 2
    OPERATOR = 3
    SHARED = 4  # the caller's: it runs in the same process, or time is simulated


def bears_out(own: Now, named: Now) -> bool:
    """Whether a time of day that is named may be decided by: each moment that the boundary takes for possible lies
    within its error, but for `APART_US`. Where the boundary knows none, none may be claimed.
    """
    if own.utc_error_us >= UTC_UNKNOWN_US:
        # an error so large, around such a time, has every year from 1970 to 2112 in it
        return named.utc_error_us >= UTC_UNKNOWN_US >= named.utc_us
    return abs(named.utc_us - own.utc_us) + own.utc_error_us <= named.utc_error_us + APART_US
