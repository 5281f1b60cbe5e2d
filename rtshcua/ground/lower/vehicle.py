"""Lower the vehicle of a policy to the flat form, with its declared speeds and defaults for the others.

The defaults are the slower of the factory settings of PX4 1.16 and ArduCopter 4.7 (docs/flying/speeds.md lists the
parameters and their documentation), limited by the vehicle's declared maxima.
"""

from typing import Final

from rtshcua.ground.checker import time_zones
from rtshcua.ground.checker.checks.vehicles import deceleration, gained
from rtshcua.model.flat.policy import Speeds, VehicleLimits
from rtshcua.model.ir.places import VehicleDecl

#: default speeds in mm/s, the height in mm below which a landing is slow, and the acceleration in mm/s per second
CRUISE: Final = 5_000
CLIMB: Final = 1_500
DESCENT: Final = 1_000
LANDING: Final = 500
LANDING_BELOW: Final = 10_000
ACCELERATION: Final = 1_000
#: default of the strongest wind in which a vehicle is flown, mm/s
WIND: Final = 5_000


def speeds_of(vehicle: VehicleDecl) -> Speeds:
    """Return the least speeds of a vehicle, by its declaration and the defaults."""
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
    """Lower a vehicle. The numbers are the slots of the signals that supervision reads, -1 for none."""
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
        servos=tuple(sorted({servo.value for servo in vehicle.servos})),
    )
