"""The signals that every decision reads, and those that the supervision of braking reads."""

from collections.abc import Mapping

from rtshcua.ground.checker.types import HEIGHT, POSITION, RATIO, SPEED, VOLTAGE, Type
from rtshcua.model.flat.signal import CELL, DRAIN
from rtshcua.model.ir.places import VehicleDecl

#: the signal with the vehicle's position
POSITION_SIGNAL = "position"

#: the signals that every decision reads, in the order of their slots: position, height, energy
WELL_KNOWN: Mapping[str, Type] = {POSITION_SIGNAL: POSITION, "height": HEIGHT, "battery": RATIO}

#: signals that are read if declared: the measured battery consumption per minute
MEASURED: Mapping[str, Type] = {DRAIN: RATIO}

#: the voltage of one cell: that of its field divided by the vehicle's `cells`
PER_CELL: Mapping[str, Type] = {CELL: VOLTAGE}

#: the signals of the velocity over ground (NED), which the supervision of a vehicle with `brakes` reads
VELOCITY: Mapping[str, Type] = dict.fromkeys(("velocity.north", "velocity.east", "velocity.down"), SPEED)


def read_by_all(vehicle: VehicleDecl) -> Mapping[str, Type]:
    """Return the signals that are read with any policy, and their types."""
    return WELL_KNOWN if vehicle.braking is None else {**WELL_KNOWN, **VELOCITY}
