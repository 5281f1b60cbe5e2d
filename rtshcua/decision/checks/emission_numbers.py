"""Checks of the commands to payload that a contract emits.

A bundle may be signed by a compiler that was taken over. So the commands that may be emitted are written down here
again, by their numbers, independently of the compiler (`ground/checker/checks/emits.py`) and of the gate
(`onboard/enforcement/payload_gate.py`): cameras, gimbals, regions of interest, grippers, winches, free servo outputs.
Nothing here moves or arms the vehicle, or changes its parameters, its home, its fence or its mission.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import Final

from rtshcua.decision.checks.indexes import at, within
from rtshcua.mavlink.parameters import NAN, nearest_bits
from rtshcua.model.flat import limits
from rtshcua.model.flat.contract import (
    PLACE,
    QUANTITY,
    Addressee,
    Contract,
    Emission,
    EmissionMoment,
    EmissionParameter,
    EmissionSuccess,
    MotionKind,
    NumberOrigin,
)
from rtshcua.model.flat.policy import VehicleLimits
from rtshcua.model.flat.zone import HIGHEST, LOWEST, MAX_COORDINATE

_ROI_LOCATION, _SERVO = 195, 183
#: MAV_CMD by addressee
_COMMANDS: Final = {
    Addressee.CAMERA: frozenset({203, 206, 530, 531, 532, 2000, 2001, 2003, 2500, 2501}),
    Addressee.GIMBAL: frozenset({_ROI_LOCATION, 197, 205, 1000, 1001}),
    Addressee.VEHICLE: frozenset(
        {_SERVO, _ROI_LOCATION, 197, 203, 205, 206, 211, 530, 531, 532, 1000, 1001, 2000, 2001, 2003, 2500, 2501, 42600}
    ),
}
#: what shows the success of a command, besides its acknowledgement
_SHOWN_BY: Final = {
    203: {EmissionSuccess.IMAGE, EmissionSuccess.ALL_IMAGES},
    206: {EmissionSuccess.ALL_IMAGES},
    2000: {EmissionSuccess.IMAGE, EmissionSuccess.ALL_IMAGES},
    2003: {EmissionSuccess.ALL_IMAGES},
    205: {EmissionSuccess.ATTITUDE},
    1000: {EmissionSuccess.ATTITUDE},
}
_PARAMETERS: Final = 7
_HALF_TURN: Final = 1_800_000_000  # 1e-7 degree
_EXPONENT: Final = 0x7F800000


def may_be_emitted(command: int, addressee: int) -> bool:
    """Whether a command may be emitted to an addressee."""
    return command in _COMMANDS.get(Addressee(addressee), frozenset()) if 0 <= addressee < len(Addressee) else False


def emission(emitted: Emission, contract: Contract, vehicle: VehicleLimits) -> Iterator[str]:
    """Yield the problems of a command to payload."""
    if not may_be_emitted(emitted.command, emitted.addressee):
        yield f"command {emitted.command} may not be emitted to addressee {emitted.addressee}"
    if len(emitted.parameters) != _PARAMETERS:
        yield f"{len(emitted.parameters)} parameters; a command has {_PARAMETERS}"
        return
    kinds = {parameter.cell: parameter.kind for parameter in contract.parameters}
    for number, parameter in enumerate(emitted.parameters, start=1):
        yield from at(f"parameter {number}", _parameter(parameter, number, emitted.command, kinds))
    if emitted.command == _SERVO:
        channel = emitted.parameters[0]
        free = [nearest_bits(servo, 1) for servo in vehicle.servos]
        if channel.origin != NumberOrigin.CONSTANT or channel.value not in free:
            yield "a servo output that the vehicle does not declare free"
    yield from _moment(emitted, contract, vehicle)
    yield from within("required", emitted.required, 0, 1)
    yield from within("success", emitted.success, EmissionSuccess.ACKNOWLEDGEMENT, EmissionSuccess.ALL_IMAGES)
    if emitted.success not in {EmissionSuccess.ACKNOWLEDGEMENT, *_SHOWN_BY.get(emitted.command, ())}:
        yield f"success {emitted.success} does not follow command {emitted.command}"
    of_attitude = emitted.success == EmissionSuccess.ATTITUDE
    yield from within("bound", emitted.bound, int(of_attitude), _HALF_TURN if of_attitude else 0)
    yield from within("time to succeed", emitted.within_us, 1, limits.MAX_PAYLOAD_WAIT)


def _parameter(parameter: EmissionParameter, number: int, command: int, kinds: dict[int, int]) -> Iterator[str]:
    """Only a region of interest has a place and a height, and both in its last three parameters."""
    expected = _PLACE.get(number) if command == _ROI_LOCATION else None
    if (parameter.origin if parameter.origin in _PLACE.values() else None) != expected:
        yield f"origin {parameter.origin}"
    if not _is_valid(parameter, kinds.get(parameter.cell)):
        yield f"{parameter.value} of cell {parameter.cell} is no number of origin {parameter.origin}"


#: the origin of each parameter of a place
_PLACE: Final = {5: NumberOrigin.LATITUDE, 6: NumberOrigin.LONGITUDE, 7: NumberOrigin.HEIGHT}


def _is_valid(parameter: EmissionParameter, kind: int | None) -> bool:
    """Whether a parameter is one of its origin; `kind` is that of its cell."""
    cell, value = parameter.cell, parameter.value
    match parameter.origin:
        case NumberOrigin.CONSTANT:
            return cell == -1 and (value == NAN or (0 <= value < 1 << 32 and value & _EXPONENT != _EXPONENT))
        case NumberOrigin.ARGUMENT:
            return kind == QUANTITY and 1 <= value <= limits.MAX_DIVISOR
        case NumberOrigin.LATITUDE | NumberOrigin.LONGITUDE:
            return kind == PLACE and not value
        case NumberOrigin.HEIGHT:
            return LOWEST <= value <= HIGHEST if cell == -1 else kind == QUANTITY and not value
    return False


def _moment(emitted: Emission, contract: Contract, vehicle: VehicleLimits) -> Iterator[str]:
    moment, amount, motion = emitted.moment, emitted.amount, contract.motion.kind
    yield from within("moment", moment, EmissionMoment.BEGIN, EmissionMoment.TIME)
    if moment == EmissionMoment.TIME:
        yield from within("interval", amount, limits.MIN_EMISSION_INTERVAL, limits.MAX_DURATION)
    elif moment == EmissionMoment.DISTANCE:
        yield from within("distance", amount, 1, MAX_COORDINATE)
        if amount * 1_000_000 // max(vehicle.speed, 1) < limits.MIN_EMISSION_INTERVAL:
            yield "the vehicle flies the distance in less than the shortest interval"
    else:
        yield from within("interval", amount, 0, 0)
    if moment == EmissionMoment.TURN and motion != MotionKind.COVER:
        yield "a skill without turns"
    if moment == EmissionMoment.WAYPOINT and motion not in (MotionKind.COVER, MotionKind.FLY):
        yield "a skill without waypoints"


def servos(vehicle: VehicleLimits) -> Iterator[str]:
    """Yield the problems of the vehicle's free servo outputs."""
    for servo in vehicle.servos:
        yield from within("servo output", servo, 1, limits.MAX_SERVOS)
    if any(one >= other for one, other in pairwise(vehicle.servos)):
        yield "the servo outputs are not ascending"
