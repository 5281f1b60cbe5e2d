"""The source of the boundary's time of day, and the check of a time claimed by the runtime. Statements contain both."""

from enum import IntEnum
from typing import Final

from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Now

#: the greatest difference between a claimed time of day and the boundary's own, beyond the errors of both, in us
APART_US: Final = 2_000_000
#: the growth of the error of UTC per second, in us: the kernel assumes no worse clock (500 ppm, MAXFREQ)
DRIFT_US: Final = 500
#: the greatest error of the UTC of an autopilot with GPS, in us. PX4 corrects its clock when it is off by more than
#: 5 s, because a correction stops everything else for a moment (`SET_CLOCK_DRIFT_TIME_S`, src/drivers/gps/gps.cpp).
#: ArduPilot sets its clock from the receiver while it is disarmed, and leaves it alone while it is armed (AP_RTC.cpp,
#: `set_utc_usec`): the error is some ms at arming, plus the crystal's drift since
AUTOPILOT_US: Final = {"px4": 6_000_000, "ardupilot": 1_000_000}
#: SYSTEM_TIME has a resolution of 1 ms
STAMP_US: Final = 1_000
#: a known time since the epoch is above this (2001); a smaller value counts from the vehicle's boot
UNIX_US: Final = 10**15


class ClockSource(IntEnum):
    """The source of the boundary's time of day."""

    UNKNOWN = 0
    KERNEL = 1
    VEHICLE = 2
    OPERATOR = 3
    SHARED = 4  # the caller's clock: the same process, or simulated time


def bears_out(own: Now, named: Now) -> bool:
    """Whether a claimed time of day may be used in a decision: its error interval contains each moment that the
    boundary considers possible, within `APART_US`. If the boundary does not know the time, a claim is refused.
    """
    if own.utc_error_us >= UTC_UNKNOWN_US:
        # an error that is so large covers every year from 1970 to 2112
        return named.utc_error_us >= UTC_UNKNOWN_US >= named.utc_us
    return abs(named.utc_us - own.utc_us) + own.utc_error_us <= named.utc_error_us + APART_US
