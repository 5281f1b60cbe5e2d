"""The signals that every decision reads, or the supervision of a vehicle that brakes."""

from collections.abc import Mapping

from rtshcua.ground.checker.types import HEIGHT, POSITION, RATIO, SPEED, VOLTAGE, Type
from rtshcua.model.flat.signal import CELL, DRAIN
from rtshcua.model.ir.places import VehicleDecl

#: the signal whose place is the vehicle's
POSITION_SIGNAL = "position"

#: the signals that every decision reads, in the order of their slots: where the vehicle is, how high, how much energy
WELL_KNOWN: Mapping[str, Type] = {POSITION_SIGNAL: POSITION, "height": HEIGHT, "battery": RATIO}

#: signals that are read where they are declared: what is taken of the battery in a minute, as measured in flight
MEASURED: Mapping[str, Type] = {DRAIN: RATIO}

#: the voltage of one cell: that of its field by the vehicle's `cells`
PER_CELL: Mapping[str, Type] = {CELL: VOLTAGE}

#: the signals of the velocity over ground (NED), which a vehicle that `brakes` is watched by
VELOCITY: Mapping[str, Type] = dict.fromkeys(("velocity.north", "velocity.east", "velocity.down"), SPEED)


def read_by_all(vehicle: VehicleDecl) -> Mapping[str, Type]:
    """What is read of a vehicle whatever its policy says, and the type of each."""
    return WELL_KNOWN if vehicle.braking is None else {**WELL_KNOWN, **VELOCITY}
