"""A contract that emits what no compiler would write is refused when it is loaded, for each part of a command."""

from msgspec.structs import replace

from reference import flat_case as flat
from reference.payload_case import SPEED, contract, emission, policy
from rtshcua.decision.checks.emission_numbers import emission as problems_of
from rtshcua.decision.checks.emission_numbers import servos
from rtshcua.decision.checks.policy import problems as problems_of_policy
from rtshcua.mavlink.parameters import NAN, nearest_bits
from rtshcua.model.flat.contract import (
    Addressee,
    Emission,
    EmissionMoment,
    EmissionParameter,
    EmissionSuccess,
    MotionKind,
    NumberOrigin,
)
from rtshcua.model.flat.zone import HIGHEST
from virtual.rows import rows

VEHICLE = policy().vehicle
PICTURE, ROI, SERVO, POINT = 2000, 195, 183, 1000
PLACED = (
    *(EmissionParameter(NumberOrigin.CONSTANT, -1, 0),) * 4,
    EmissionParameter(NumberOrigin.LATITUDE, 2, 0),
    EmissionParameter(NumberOrigin.LONGITUDE, 2, 0),
    EmissionParameter(NumberOrigin.HEIGHT, 4, 0),
)


def with_first(origin: int, cell: int, value: int, command: int = PICTURE) -> Emission:
    """A command whose first parameter is this one."""
    made = emission(command, to=Addressee.VEHICLE)
    return replace(made, parameters=(EmissionParameter(origin, cell, value), *made.parameters[1:]))


def at(moment: int, amount: int) -> dict[str, int]:
    return {"moment": moment, "amount": amount}


def shown(success: int, bound: int = 0, command: int = PICTURE) -> Emission:
    return replace(emission(command, to=Addressee.VEHICLE), success=success, bound=bound)


def placed(*changes: tuple[int, int, int, int]) -> Emission:
    """A region of interest; a change is the number of a parameter, and its origin, cell and value."""
    parameters = list(PLACED)
    for number, *fields in changes:
        parameters[number - 1] = EmissionParameter(*fields)
    return replace(emission(ROI, to=Addressee.GIMBAL), parameters=tuple(parameters))


#: a command, the motion of its skill, and what is wrong with it
CASES: list[tuple[Emission, MotionKind, str | None]] = [
    (emission(PICTURE), MotionKind.FLY, None),
    (emission(400), MotionKind.FLY, "command 400 may not be emitted to addressee 1"),
    (emission(PICTURE, to=Addressee.GIMBAL), MotionKind.FLY, "command 2000 may not be emitted to addressee 2"),
    (replace(emission(PICTURE), addressee=3), MotionKind.FLY, "command 2000 may not be emitted to addressee 3"),
    (replace(emission(PICTURE), parameters=PLACED[:6]), MotionKind.FLY, "6 parameters; a command has 7"),
    (with_first(NumberOrigin.CONSTANT, -1, NAN), MotionKind.FLY, None),
    (with_first(NumberOrigin.CONSTANT, 0, 0), MotionKind.FLY, "parameter 1: 0 of cell 0 is no number of origin 0"),
    (with_first(NumberOrigin.CONSTANT, -1, 0x7F800000), MotionKind.FLY, "parameter 1: 2139095040 of cell -1 is no"),
    (with_first(NumberOrigin.ARGUMENT, 4, 1000), MotionKind.FLY, None),
    (with_first(NumberOrigin.ARGUMENT, 4, 0), MotionKind.FLY, "parameter 1: 0 of cell 4 is no number of origin 1"),
    (with_first(NumberOrigin.ARGUMENT, 2, 1), MotionKind.FLY, "parameter 1: 1 of cell 2 is no number of origin 1"),
    (with_first(9, -1, 0), MotionKind.FLY, "parameter 1: 0 of cell -1 is no number of origin 9"),
    (with_first(NumberOrigin.LATITUDE, 2, 0), MotionKind.FLY, "parameter 1: origin 2"),
    (placed(), MotionKind.FLY, None),
    (placed((5, NumberOrigin.LATITUDE, 2, 1)), MotionKind.FLY, "parameter 5: 1 of cell 2 is no number of origin 2"),
    (placed((7, NumberOrigin.HEIGHT, -1, 20_000)), MotionKind.FLY, None),
    (placed((7, NumberOrigin.HEIGHT, -1, HIGHEST + 1)), MotionKind.FLY, f"parameter 7: {HIGHEST + 1} of cell -1"),
    (placed((7, NumberOrigin.HEIGHT, 2, 0)), MotionKind.FLY, "parameter 7: 0 of cell 2 is no number of origin 4"),
    (placed((6, NumberOrigin.CONSTANT, -1, 0)), MotionKind.FLY, "parameter 6: origin 0"),
    (with_first(NumberOrigin.CONSTANT, -1, nearest_bits(9, 1), SERVO), MotionKind.FLY, None),
    (
        with_first(NumberOrigin.CONSTANT, -1, nearest_bits(1, 1), SERVO),
        MotionKind.FLY,
        "a servo output that the vehicle",
    ),
    (
        with_first(NumberOrigin.ARGUMENT, 4, 1, SERVO),
        MotionKind.FLY,
        "a servo output that the vehicle does not declare",
    ),
    (replace(emission(PICTURE), **at(6, 0)), MotionKind.FLY, "moment 6 is not in 0..5"),
    (replace(emission(PICTURE), **at(EmissionMoment.BEGIN, 1)), MotionKind.FLY, "interval 1 is not in 0..0"),
    (replace(emission(PICTURE), **at(EmissionMoment.TIME, 100_000)), MotionKind.FLY, None),
    (
        replace(emission(PICTURE), **at(EmissionMoment.TIME, 99_999)),
        MotionKind.FLY,
        "interval 99999 is not in 100000..",
    ),
    (replace(emission(PICTURE), **at(EmissionMoment.DISTANCE, SPEED // 10)), MotionKind.FLY, None),
    (replace(emission(PICTURE), **at(EmissionMoment.DISTANCE, 0)), MotionKind.FLY, "distance 0 is not in 1.."),
    (
        replace(emission(PICTURE), **at(EmissionMoment.DISTANCE, SPEED // 10 - 1)),
        MotionKind.FLY,
        "the vehicle flies the",
    ),
    (replace(emission(PICTURE), moment=EmissionMoment.TURN), MotionKind.COVER, None),
    (replace(emission(PICTURE), moment=EmissionMoment.TURN), MotionKind.FLY, "a skill without turns"),
    (replace(emission(PICTURE), moment=EmissionMoment.WAYPOINT), MotionKind.FLY, None),
    (replace(emission(PICTURE), moment=EmissionMoment.WAYPOINT), MotionKind.HOLD, "a skill without waypoints"),
    (replace(emission(PICTURE), required=2), MotionKind.FLY, "required 2 is not in 0..1"),
    (replace(emission(PICTURE), within_us=0), MotionKind.FLY, "time to succeed 0 is not in 1..60000000"),
    (shown(EmissionSuccess.IMAGE), MotionKind.FLY, None),
    (shown(4), MotionKind.FLY, "success 4 is not in 0..3"),
    (shown(EmissionSuccess.ATTITUDE, 1), MotionKind.FLY, "success 2 does not follow command 2000"),
    (shown(EmissionSuccess.ATTITUDE, 20_000_000, POINT), MotionKind.FLY, None),
    (shown(EmissionSuccess.ATTITUDE, 0, POINT), MotionKind.FLY, "bound 0 is not in 1..1800000000"),
    (shown(EmissionSuccess.IMAGE, 1), MotionKind.FLY, "bound 1 is not in 0..0"),
]


@rows(("emitted", "motion", "what"), CASES)
def test_commands_that_no_compiler_writes_are_refused(emitted: Emission, motion: MotionKind, what: str | None) -> None:
    problems = list(problems_of(emitted, contract((emitted,), motion), VEHICLE))
    found = problems[0] if problems else None
    assert (found or "")[: len(what or "")] == (what or "")
    assert (found is None) == (what is None), found


def test_a_policy_names_the_contract_and_the_command_that_is_wrong() -> None:
    found = list(problems_of_policy(policy(of=contract((emission(PICTURE), emission(400))))))
    assert any(each.endswith("emits 1: command 400 may not be emitted to addressee 1") for each in found), found
    many = list(problems_of_policy(policy(of=contract((emission(PICTURE),) * 9))))
    assert any("number of commands to payload 9" in each for each in many), many


@rows(
    ("outputs", "what"), [((9, 10), None), ((), None), ((0,), "servo output 0"), ((10, 9), "the servo outputs are not")]
)
def test_free_servo_outputs_exist_and_ascend(outputs: tuple[int, ...], what: str | None) -> None:
    found = next(servos(replace(flat.POLICY.vehicle, servos=outputs)), None)
    assert (found or "").startswith(what or "")
    assert (found is None) == (what is None)
