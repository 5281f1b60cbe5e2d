"""The effects that end a stage, and what is left to them, common to all flavours.

Tolerances are arrival tolerances, not safety margins.
"""

from collections.abc import Callable
from functools import lru_cache
from math import cos, hypot, radians

from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.model.flat.zone import meridian

_MM_PER_UNIT = 11.1319  # one 1e-7 degree of latitude; only for "has it arrived", never decided, signed or logged
ARRIVED = 2_000  # mm, horizontally
LEVEL = 1_500  # mm, vertically
CLIMBED = 1_000  # mm below the height asked for
STILL = 700  # mm/s

Effect = Callable[[ObservedVehicle], bool]
Measure = Callable[[ObservedVehicle], tuple[int, ...] | None]
"""What is left, in mm, in one or more ways of which one falls while there is progress; None: not known now."""


@lru_cache(maxsize=8)  # one report is held against the same place several times
def apart(latitude: int, longitude: int, to_latitude: int, to_longitude: int) -> float:
    """How far two places (1e-7 degree) are from each other, in mm."""
    north = (latitude - to_latitude) * _MM_PER_UNIT
    east = (meridian(longitude, to_longitude) - to_longitude) * _MM_PER_UNIT * cos(radians(to_latitude / 1e7))
    return hypot(north, east)


def in_mode(number: int) -> Effect:
    """The heartbeat shows the mode."""
    return lambda seen: seen.mode == number


def in_mode_or_down(number: int) -> Effect:
    """The heartbeat shows the mode, or there is nothing left to bring down."""
    return lambda seen: seen.mode == number or seen.down


def airborne(seen: ObservedVehicle) -> bool:
    """In the air, as far as it says."""
    return seen.airborne


def still(seen: ObservedVehicle) -> bool:
    """In the air and not moving, gusts apart."""
    return seen.airborne and seen.speed is not None and seen.speed <= STILL


def climbed(altitude: int) -> Effect:
    """In the air at the height (mm above home), by what the estimator vouches for."""
    return lambda seen: seen.airborne and seen.levelled and seen.height >= altitude - CLIMBED


def arrived(latitude: int, longitude: int, altitude: int) -> Effect:
    """Near the place (1e-7 degree, mm above home), by what the estimator vouches for."""

    def near(seen: ObservedVehicle) -> bool:
        if not (seen.located and seen.levelled):
            return False
        away = apart(seen.latitude, seen.longitude, latitude, longitude)
        return away <= ARRIVED and abs(seen.height - altitude) <= LEVEL

    return near


# ---------------------------------------------------------------- what is left, in mm: see `ExpectedProgress`


def to_place(latitude: int, longitude: int, altitude: int) -> Measure:
    """The way to a place that is flown to in a straight line."""

    def left(seen: ObservedVehicle) -> tuple[int, ...] | None:
        if not (seen.located and seen.levelled):
            return None
        away = apart(seen.latitude, seen.longitude, latitude, longitude)
        return (round(hypot(away, seen.height - altitude)),)

    return left


def up_to(altitude: int) -> Measure:
    """The height that is missing."""
    return lambda seen: (altitude - seen.height,) if seen.levelled else None


def to_the_ground(seen: ObservedVehicle) -> tuple[int, ...] | None:
    """The height above home. On the ground, until the motors stop, nothing is expected of it any more."""
    return (seen.height,) if seen.levelled and seen.airborne else None


def homeward(seen: ObservedVehicle) -> tuple[int, ...] | None:
    """Where it is: a return climbs first, then crosses, to home or to a rally point, then descends; but it moves."""
    if not (seen.located and seen.levelled and seen.airborne):
        return None
    east = seen.longitude * _MM_PER_UNIT * cos(radians(seen.latitude / 1e7))
    return round(seen.latitude * _MM_PER_UNIT), round(east), seen.height
