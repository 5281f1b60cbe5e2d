"""Contracts and policies that emit commands to payload, for tests of the gate and of loading."""

from msgspec.structs import replace

from reference import flat_case as flat
from rtshcua.model.flat.contract import (
    PLACE,
    QUANTITY,
    Addressee,
    Contract,
    Emission,
    EmissionMoment,
    EmissionParameter,
    EmissionSuccess,
    Motion,
    MotionKind,
    NumberOrigin,
    Parameter,
)
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import Projection
from rtshcua.onboard.enforcement.payload_gate import ending_of
from rtshcua.onboard.ports import PayloadFrame

#: an angle, a time, a place, a height
PARAMETERS = (
    Parameter("pitch", QUANTITY, "angle", 0, -900_000_000, 0, ()),
    Parameter("pause", QUANTITY, "duration", 1, 0, 60_000_000, ()),
    Parameter("to", PLACE, "", 2, 0, 0, ()),
    Parameter("altitude", QUANTITY, "altitude", 4, 5_000, 60_000, ()),
)
ARGUMENTS = (-450_000_000, 3_000_000, 12_345, -67_890, 25_000)
SERVOS = (9, 10)
SPEED = 12_000  # mm/s, the greatest of the vehicle


def constant(bits: int = 0) -> EmissionParameter:
    return EmissionParameter(NumberOrigin.CONSTANT, -1, bits)


def emission(
    command: int,
    *bits: int,
    to: Addressee = Addressee.CAMERA,
    moment: EmissionMoment = EmissionMoment.BEGIN,
    amount: int = 0,
) -> Emission:
    """A command whose first parameters are constants."""
    parameters = tuple(map(constant, (*bits, *[0] * (7 - len(bits)))))
    return Emission(
        command, to, parameters, moment, amount, EmissionSuccess.ACKNOWLEDGEMENT, 0, 3_000_000, 0, f"emits {command}"
    )


def contract(emits: tuple[Emission, ...], motion: MotionKind = MotionKind.FLY) -> Contract:
    """A skill that flies to a place and emits commands."""
    return flat.contract("look", Motion(motion, 4, -1), parameters=PARAMETERS, emits=emits)


def policy(projection: Projection | None = None, speed: int = SPEED, *, of: Contract | None = None) -> Policy:
    """A policy whose vehicle has this greatest speed, and free servo outputs; with another contract at its end."""
    vehicle = replace(flat.POLICY.vehicle, speed=speed, servos=SERVOS)
    contracts = flat.POLICY.contracts if of is None else (*flat.POLICY.contracts, of)
    return replace(flat.POLICY, vehicle=vehicle, projection=projection or flat.POLICY.projection, contracts=contracts)


def ending(frame: PayloadFrame) -> PayloadFrame | None:
    """The frame that ends what another one begins."""
    found = ending_of(frame.command, frame.numbers)
    return None if found is None else replace(frame, command=found[0], numbers=found[1], height=None)
