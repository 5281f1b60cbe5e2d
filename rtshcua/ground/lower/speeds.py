"""The speeds that durations are proved by: what a vehicle declares of them, and what is taken where it does not.

The defaults are what a PX4 1.16 and an ArduCopter 4.7 keep as they come, the slower of both: docs/flying/speeds.md has
the parameters and where they are documented. None is more than the vehicle says that it does at most.
"""

from typing import Final

from rtshcua.ground.checker.checks.vehicles import gained
from rtshcua.model.flat.policy import Speeds
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
