"""The greatest duration of each manoeuvre and the charge that it takes, computed from the vehicle's declared speeds.

An autopilot flies a leg from rest to rest. With v its speed over ground and a its acceleration, a leg of length d
takes d / v + v / a, or 2 * sqrt(d / a) where the leg is too short to reach the speed (d < v*v / a). A change of
height on a leg is counted as if it were flown after the leg. Against a head wind w the speed over ground is the
requested speed, limited to what the air speed leaves, `air` - w. The charge follows from the time: `flight_us` is
how long a full battery lasts, whatever the vehicle flies.

The constants are delays measured in recorded flights (PX4 1.16, ArduCopter 4.7: docs/flying/speeds.md).
"""

from math import isqrt

from rtshcua.model.flat.limits import FULL
from rtshcua.model.flat.policy import Speeds, VehicleLimits

SECOND = 1_000_000  # us
MINUTE = 60 * SECOND
#: upper bound of the measured drain per minute, 1/10000: a full charge in a second
MOST_DRAIN = 60 * FULL
#: from a command to the motion that it requests
BEGINS = SECOND
#: from arming to leaving the ground: the motors run up
LIFTS = 5 * SECOND
#: from arriving to standing still, and to going on
SETTLES = 4 * SECOND
#: what a return hovers over home before it descends (ArduCopter's RTL_LOIT_TIME)
OVER_HOME = 5 * SECOND
#: from touching the ground to motors that stopped
LANDED = 8 * SECOND


def slower(one: int, other: int) -> int:
    """The slower of two requested speeds, mm/s; 0 means no request."""
    return min(one or other, other or one)


def over_ground(speeds: Speeds, asked: int, wind: int | None = None) -> int:
    """The speed over ground that is certain when `asked` is flown, against the declared wind or another, mm/s."""
    return max(1, min(asked, speeds.air - (speeds.wind if wind is None else wind)))


def leg_us(speeds: Speeds, distance: int, speed: int) -> int:
    """A leg of this length at a speed over ground, from rest to rest; rounded up."""
    if distance * speeds.acceleration < speed * speed:
        return isqrt(4 * distance * SECOND * SECOND // speeds.acceleration) + 1
    return _over(distance * SECOND, speed) + _over(speed * SECOND, speeds.acceleration)


def rising_us(speeds: Speeds, height: int) -> int:
    """The duration of a climb by this height; 0 for no climb."""
    return leg_us(speeds, height, speeds.climb) if height > 0 else 0


def sinking_us(speeds: Speeds, height: int) -> int:
    """The duration of a descent by this height in the air; 0 for no descent."""
    return leg_us(speeds, height, speeds.descent) if height > 0 else 0


def landing_us(speeds: Speeds, height: int) -> int:
    """The duration of a landing from a height, until the motors have stopped."""
    slow = min(max(height, 0), speeds.landing_below)
    return sinking_us(speeds, height - slow) + _over(slow * SECOND, speeds.landing) + LANDED


def home_us(vehicle: VehicleLimits, speeds: Speeds, distance: int, heights: tuple[int, int], asked: int = 0) -> int:
    """The duration of a return and landing, from anywhere within a distance of home and between two heights.

    An autopilot may keep a speed that this step or an earlier one requested (PX4: DO_CHANGE_SPEED outlives the
    mode): `asked` is the slowest of these, 0 if none did.
    """
    low, high = heights
    up = rising_us(speeds, vehicle.return_altitude - low)
    speed = over_ground(speeds, min(asked or speeds.homeward, speeds.homeward))
    way = leg_us(speeds, distance + vehicle.home_within, speed)
    return BEGINS + up + way + SETTLES + OVER_HOME + landing_us(speeds, max(high, vehicle.return_altitude))


def charge(speeds: Speeds, time_us: int) -> int:
    """The charge that a flight of this duration takes, 1/10000, rounded up."""
    return _over(time_us * FULL, speeds.flight_us)


def drained(time_us: int, drain: int) -> int:
    """The charge that a flight of this duration takes at `drain` per minute, 1/10000, rounded up."""
    return _over(time_us * drain, MINUTE)


def _over(amount: int, by: int) -> int:
    return -(-amount // by)
