"""Where a boundary has the time of day from, and what of another's word it bears out; its statements say both."""

from enum import IntEnum
from typing import Final

from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Now

#: how far a time of day that is named may be from the boundary's own, beyond the errors of both, in us
APART_US: Final = 2_000_000
#: how much more UTC may be off after each second, in us: the kernel takes no clock for worse (500 ppm, MAXFREQ)
DRIFT_US: Final = 500
#: how far the UTC of an autopilot with GPS may be off, in us. PX4 sets its clock when it is off by more than 5 s, for
#: that stops all else for a moment (`SET_CLOCK_DRIFT_TIME_S`, src/drivers/gps/gps.cpp). ArduPilot sets its own by the
#: receiver while it is disarmed, and leaves it alone while it is armed (AP_RTC.cpp, `set_utc_usec`): some ms at arming,
#: and a crystal's drift since
AUTOPILOT_US: Final = {"px4": 6_000_000, "ardupilot": 1_000_000}
#: SYSTEM_TIME says when it was made in whole ms
STAMP_US: Final = 1_000
#: a time since the epoch that a vehicle knows is above this (2001); what is below counts from its boot
UNIX_US: Final = 10**15


class ClockSource(IntEnum):
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
