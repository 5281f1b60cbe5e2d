"""How long a vehicle takes at most for what it flies, and what that takes of its charge, by the speeds it declares.

An autopilot flies a leg from rest to rest: with v its speed over ground and a its acceleration, a leg of length d takes
d / v + v / a, or 2 * sqrt(d / a) where it is so short that it never comes to speed (d < v*v / a). Height on a leg is
counted as if it were flown after the leg. Against a head wind w the speed over ground is what is asked for, and no more
than what its speed through the air leaves, `air` - w. The charge is that of the time: `flight_us` is how long a full
battery flies, whatever it flies.

The constants are what recorded flights took beyond that (PX4 1.16, ArduCopter 4.7: docs/flying/speeds.md).
"""

from math import isqrt

from rtshcua.model.flat.limits import FULL
from rtshcua.model.flat.policy import Speeds, VehicleLimits

SECOND = 1_000_000  # us
MINUTE = 60 * SECOND
#: the most that is counted to be taken of a charge in a minute, 1/10000: all of it in a second
MOST_DRAIN = 60 * FULL
#: from a command to the motion that it asks for
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
    """The slower of two speeds that steps ask for, mm/s; 0 asks for none."""
    return min(one or other, other or one)


def over_ground(speeds: Speeds, asked: int, wind: int | None = None) -> int:
    """The speed over ground that is sure where `asked` is flown, against the declared wind or another, mm/s."""
    return max(1, min(asked, speeds.air - (speeds.wind if wind is None else wind)))


def leg_us(speeds: Speeds, distance: int, speed: int) -> int:
    """A leg of this length at a speed over ground, from rest to rest; rounded up."""
    if distance * speeds.acceleration < speed * speed:
        return isqrt(4 * distance * SECOND * SECOND // speeds.acceleration) + 1
    return _over(distance * SECOND, speed) + _over(speed * SECOND, speeds.acceleration)


def rising_us(speeds: Speeds, height: int) -> int:
    """A climb by this height; nothing where there is none."""
    return leg_us(speeds, height, speeds.climb) if height > 0 else 0


def sinking_us(speeds: Speeds, height: int) -> int:
    """A descent by this height, in the air; nothing where there is none."""
    return leg_us(speeds, height, speeds.descent) if height > 0 else 0


def landing_us(speeds: Speeds, height: int) -> int:
    """From a height down to the ground, until the motors have stopped."""
    slow = min(max(height, 0), speeds.landing_below)
    return sinking_us(speeds, height - slow) + _over(slow * SECOND, speeds.landing) + LANDED


def home_us(vehicle: VehicleLimits, speeds: Speeds, distance: int, heights: tuple[int, int], asked: int = 0) -> int:
    """Home from anywhere within a distance of where it is declared and between two heights, and down there.

    An autopilot may go on with a speed that this step or one before it asked for (PX4: DO_CHANGE_SPEED outlives the
    mode): `asked` is the slowest of these, 0 if none did.
    """
    low, high = heights
    up = rising_us(speeds, vehicle.return_altitude - low)
    speed = over_ground(speeds, min(asked or speeds.homeward, speeds.homeward))
    way = leg_us(speeds, distance + vehicle.home_within, speed)
    return BEGINS + up + way + SETTLES + OVER_HOME + landing_us(speeds, max(high, vehicle.return_altitude))


def charge(speeds: Speeds, time_us: int) -> int:
    """What flying so long takes of a full charge, 1/10000, rounded up."""
    return _over(time_us * FULL, speeds.flight_us)


def drained(time_us: int, drain: int) -> int:
    """What flying so long takes where `drain` is taken in a minute, 1/10000, rounded up."""
    return _over(time_us * drain, MINUTE)


def _over(amount: int, by: int) -> int:
    return -(-amount // by)
