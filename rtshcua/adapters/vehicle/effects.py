"""The effects that end a stage, common to all flavours. Tolerances are arrival tolerances, not safety margins."""

from collections.abc import Callable
from math import cos, hypot, radians

from rtshcua.adapters.vehicle.observed import Observed
from rtshcua.model.flat.zone import meridian

_MM_PER_UNIT = 11.1319  # one 1e-7 degree of latitude; only for "has it arrived", never decided, signed or logged
ARRIVED = 2_000  # mm, horizontally
LEVEL = 1_500  # mm, vertically
CLIMBED = 1_000  # mm below the height asked for
STILL = 700  # mm/s, in any direction


def in_mode(number: int) -> Callable[[Observed], bool]:
    """The heartbeat shows the mode."""
    return lambda seen: seen.mode == number


def in_mode_or_down(number: int) -> Callable[[Observed], bool]:
    """The heartbeat shows the mode, or there is nothing left to bring down."""
    return lambda seen: seen.mode == number or seen.down


def armed(seen: Observed) -> bool:
    """The heartbeat shows armed motors."""
    return seen.armed


def airborne(seen: Observed) -> bool:
    """It left the ground."""
    return seen.airborne


def still(seen: Observed) -> bool:
    """In the air and not moving, gusts apart."""
    return seen.airborne and seen.speed is not None and seen.speed <= STILL


def down(seen: Observed) -> bool:
    """On the ground, motors off."""
    return seen.down


def climbed(altitude: int) -> Callable[[Observed], bool]:
    """In the air at the height (mm above home), by what the estimator vouches for."""
    return lambda seen: seen.airborne and seen.levelled and seen.height >= altitude - CLIMBED


def arrived(latitude: int, longitude: int, altitude: int) -> Callable[[Observed], bool]:
    """Near the place (1e-7 degree, mm above home), by what the estimator vouches for."""
    shrink = cos(radians(latitude / 1e7))

    def near(seen: Observed) -> bool:
        if not (seen.located and seen.levelled):
            return False
        north = (seen.latitude - latitude) * _MM_PER_UNIT
        east = (meridian(seen.longitude, longitude) - longitude) * _MM_PER_UNIT * shrink
        return hypot(north, east) <= ARRIVED and abs(seen.height - altitude) <= LEVEL

    return near
