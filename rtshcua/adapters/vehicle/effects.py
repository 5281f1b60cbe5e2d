"""The effects that end a stage, and the measures of progress towards them, for all flavours. Tolerances are for
arrival; they are not safety margins.
"""

from collections.abc import Callable
from functools import lru_cache
from math import cos, hypot, radians

from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.model.flat.mission import TURN
from rtshcua.model.flat.zone import meridian

_MM_PER_UNIT = 11.1319  # one 1e-7 degree of latitude; only for arrival, never for decisions, signatures or logs
ARRIVED = 2_000  # mm, horizontally
LEVEL = 1_500  # mm, vertically
CLIMBED = 1_000  # mm below the commanded height
STILL = 700  # mm/s
FACES = 1_000  # 1/100 degree to either side

Effect = Callable[[ObservedVehicle], bool]
Measure = Callable[[ObservedVehicle], tuple[int, ...] | None]
"""What is left, in mm, in one or more ways of which one falls while there is progress; None: not known now."""


@lru_cache(maxsize=8)  # a report is compared with the same place several times
def apart(latitude: int, longitude: int, to_latitude: int, to_longitude: int) -> float:
    """The distance of two places (1e-7 degree) in mm."""
    north = (latitude - to_latitude) * _MM_PER_UNIT
    east = (meridian(longitude, to_longitude) - to_longitude) * _MM_PER_UNIT * cos(radians(to_latitude / 1e7))
    return hypot(north, east)


def in_mode(number: int) -> Effect:
    """The heartbeat shows the mode."""
    return lambda seen: seen.mode == number


def in_mode_or_down(number: int) -> Effect:
    """The heartbeat shows the mode, or the vehicle is already down."""
    return lambda seen: seen.mode == number or seen.down


def airborne(seen: ObservedVehicle) -> bool:
    """In the air by its own report."""
    return seen.airborne


def still(seen: ObservedVehicle) -> bool:
    """In the air and not moving, except for gusts."""
    return seen.airborne and seen.speed is not None and seen.speed <= STILL


def climbed(altitude: int) -> Effect:
    """In the air at the height (mm above home), confirmed by the estimator."""
    return lambda seen: seen.airborne and seen.levelled and seen.height >= altitude - CLIMBED


def arrived(latitude: int, longitude: int, altitude: int) -> Effect:
    """Near the place (1e-7 degree, mm above home), confirmed by the estimator."""

    def near(seen: ObservedVehicle) -> bool:
        if not (seen.located and seen.levelled):
            return False
        away = apart(seen.latitude, seen.longitude, latitude, longitude)
        return away <= ARRIVED and abs(seen.height - altitude) <= LEVEL

    return near


def turned(there: Effect, heading: int) -> Effect:
    """At the place, with the nose at the heading (1/100 degree from true north), confirmed by the estimator."""

    def faces(seen: ObservedVehicle) -> bool:
        if seen.heading is None or not there(seen):
            return False
        return abs((seen.heading - heading + TURN // 2) % TURN - TURN // 2) <= FACES

    return faces


# ---------------------------------------------------------------- remaining distances in mm: see `ExpectedProgress`


def to_place(latitude: int, longitude: int, altitude: int) -> Measure:
    """The remaining distance to a place, in a straight line."""

    def left(seen: ObservedVehicle) -> tuple[int, ...] | None:
        if not (seen.located and seen.levelled):
            return None
        away = apart(seen.latitude, seen.longitude, latitude, longitude)
        return (round(hypot(away, seen.height - altitude)),)

    return left


def up_to(altitude: int) -> Measure:
    """The remaining height."""
    return lambda seen: (altitude - seen.height,) if seen.levelled else None


def to_the_ground(seen: ObservedVehicle) -> tuple[int, ...] | None:
    """The height above home. On the ground no progress is expected until the motors stop."""
    return (seen.height,) if seen.levelled and seen.airborne else None


def homeward(seen: ObservedVehicle) -> tuple[int, ...] | None:
    """Its position: a return climbs, crosses to home or a rally point, and descends, but it always moves."""
    if not (seen.located and seen.levelled and seen.airborne):
        return None
    east = seen.longitude * _MM_PER_UNIT * cos(radians(seen.latitude / 1e7))
    return round(seen.latitude * _MM_PER_UNIT), round(east), seen.height
