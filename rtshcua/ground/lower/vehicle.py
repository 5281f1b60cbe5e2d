"""The vehicle of a policy in the flat form, with the speeds that durations are proved by: those that it declares, and
defaults.

The defaults are what a PX4 1.16 and an ArduCopter 4.7 keep as they come, the slower of both: docs/flying/speeds.md has
the parameters and where they are documented. None is more than the vehicle says that it does at most.
"""

from typing import Final

from rtshcua.ground.checker import time_zones
from rtshcua.ground.checker.checks.vehicles import deceleration, gained
from rtshcua.model.flat.policy import Speeds, VehicleLimits
from rtshcua.model.ir.places import VehicleDecl

#: mm/s; below which height a landing is slow, mm; mm/s in a second
CRUISE: Final = 5_000
CLIMB: Final = 1_500
DESCENT: Final = 1_000
LANDING: Final = 500
LANDING_BELOW: Final = 10_000
ACCELERATION: Final = 1_000
#: the most wind that a vehicle is flown in which says nothing of it, mm/s
WIND: Final = 5_000


def speeds_of(vehicle: VehicleDecl) -> Speeds:
    """What a vehicle keeps at least, by its declaration and the defaults."""
    named = {each.name.text: each for each in vehicle.speeds}
    most = vehicle.speed.value

    def speed(name: str, otherwise: int) -> int:
        return named[name].speed.value if name in named else otherwise

    cruise = speed("cruise", min(CRUISE, most))
    descent = speed("descent", min(DESCENT, vehicle.climb.value))
    air = speed("air", most)
    below = named["landing"].below if "landing" in named else None
    gains = vehicle.acceleration
    return Speeds(
        cruise=cruise,
        climb=speed("climb", min(CLIMB, vehicle.climb.value)),
        descent=descent,
        landing=speed("landing", min(LANDING, descent)),
        landing_below=LANDING_BELOW if below is None else below.value,
        homeward=speed("return", cruise),
        acceleration=ACCELERATION if gains is None else gained(gains),
        air=air,
        wind=min(WIND, air // 2) if vehicle.wind is None else vehicle.wind.value,
        flight_us=vehicle.endurance.value * 3 // 4 if vehicle.flight is None else vehicle.flight.value,
    )


def lower_vehicle(
    vehicle: VehicleDecl, position: int, height: int, battery: int, north: int = -1, east: int = -1, down: int = -1
) -> VehicleLimits:
    """The vehicle in the flat form; the numbers are the slots of the signals that supervision reads, -1 for none."""
    braking, zone = vehicle.braking, vehicle.time_zone
    return VehicleLimits(
        name=vehicle.name.text,
        identity=vehicle.identity,
        home_within=vehicle.within.value,
        speed=vehicle.speed.value,
        climb=vehicle.climb.value,
        position_error=vehicle.position_error.value,
        endurance_us=vehicle.endurance.value,
        reserve=vehicle.reserve.value,
        utc_offset_us=0 if vehicle.utc_offset is None else vehicle.utc_offset.value,
        position=position,
        height=height,
        battery=battery,
        return_altitude=0 if vehicle.return_altitude is None else vehicle.return_altitude.value,
        braking=0 if braking is None else deceleration(braking),
        reaction_us=0 if braking is None else braking.reaction.value,
        north=north,
        east=east,
        down=down,
        without=tuple(sorted({name.text for name in vehicle.without})),
        speeds=speeds_of(vehicle),
        time_zone="" if zone is None else zone.text,
        time_zone_data="" if zone is None else time_zones.VERSION,
        offsets=() if zone is None else time_zones.offsets(zone.text),
    )
