"""The signals that every decision reads, or the supervision of a vehicle that brakes."""

from collections.abc import Mapping

from rtshcua.ground.checker.places import POSITION_SIGNAL
from rtshcua.ground.checker.types import HEIGHT, POSITION, RATIO, SPEED, Type
from rtshcua.model.ir.places import VehicleDecl

#: the signals that every decision reads, in the order of their slots: where the vehicle is, how high, how much energy
WELL_KNOWN: Mapping[str, Type] = {POSITION_SIGNAL: POSITION, "height": HEIGHT, "battery": RATIO}

#: the signals of the velocity over ground (NED), which a vehicle that `brakes` is watched by
VELOCITY: Mapping[str, Type] = dict.fromkeys(("velocity.north", "velocity.east", "velocity.down"), SPEED)


def read_by_all(vehicle: VehicleDecl) -> Mapping[str, Type]:
    """What is read of a vehicle whatever its policy says, and the type of each."""
    return WELL_KNOWN if vehicle.braking is None else {**WELL_KNOWN, **VELOCITY}
