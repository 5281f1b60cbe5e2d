"""The missions of the sorties, as sources under the user's own policy: the compiler proves them like any other. Each
step uses the policy's own skill for its kind of motion. Distance, speed and direction of a leg are tried out: the first
of `trials` that the policy permits, within its airspace, is flown.
"""

from collections.abc import Iterator
from itertools import groupby, product
from math import cos, radians, sin
from typing import Final, NamedTuple

from rtshcua.adapters.qualification.observed import TakeoverKind
from rtshcua.adapters.qualification.sortie import Sortie
from rtshcua.model.flat.contract import PLACE, Contract, MotionKind, Parameter, SourceKind
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import unproject
from rtshcua.model.quantity import Dimension, display

#: the shipped skill of each kind of motion, if a policy has several of the kind
_SHIPPED: Final = {
    MotionKind.CLIMB: "takeoff", MotionKind.FLY: "goto", MotionKind.HOLD: "hover", MotionKind.HOME: "return_home",
    MotionKind.LAND: "emergency_land",
}  # fmt: skip
_HEIGHTS_MM: Final = (10_000, 6_000)
_LEGS_MM: Final = (50_000, 30_000)
_SPEEDS_MM_S: Final = (5_000, 3_000, 2_000)
_BEARINGS_DEG: Final = (0, 180, 90, 270, 45, 135, 225, 315)
_HOLD_US: Final = 5_000_000
#: us of link time for each silence, and for the time between and around them
_AROUND_US, _EACH_US = 3_500_000, 4_000_000
_PILOT_US: Final = 30_000_000
NAME: Final = "qualification"


class SortiePlan(NamedTuple):
    """The height of the sorties, and the length, speed and direction of their legs."""

    height: int
    leg: int
    speed: int
    bearing: int


def trials() -> Iterator[SortiePlan]:
    """The plans to try, the most informative first."""
    for height, leg, speed, bearing in product(_HEIGHTS_MM, _LEGS_MM, _SPEEDS_MM_S, _BEARINGS_DEG):
        yield SortiePlan(height, leg, speed, bearing)


def skill_of(policy: Policy, kind: MotionKind) -> Contract | None:
    """The policy's skill for a kind of motion."""
    those = [each for each in policy.contracts if each.motion.kind == kind]
    return next((each for each in those if each.name == _SHIPPED[kind]), those[0] if those else None)


def source_of(
    sortie: Sortie, trial: SortiePlan, imported: str, policy: Policy, mission: Mission, *, by_pilot: bool
) -> str:
    """The source of a sortie's mission: it imports the file `imported`, has the proposer of `mission`, and its policy.
    Raises LookupError with a kind of motion that the policy has no skill for.
    """
    first = mission.invocations[0]
    source, role = SourceKind(first.source).name.lower(), policy.roles[first.role]
    speaker = f"agent {mission.proposer}" if source == "agent" else f"{source} {mission.proposer}"
    # a vehicle that was taken over lands where it is: the next leg goes back over home, so that it does not drift away
    way = trial._replace(bearing=(trial.bearing + 180) % 360) if sortie.takeover is TakeoverKind.PAUSE else trial
    steps = []
    for kind in sortie.steps:
        contract = skill_of(policy, kind)
        if contract is None:
            raise LookupError(kind.name.lower())
        phase = contract.phases[0] if contract.phases else NAME
        steps.append((phase, _step(contract, _held(sortie, by_pilot=by_pilot), way, policy)))
    lines = [
        f'import "{imported}"',
        "",
        f"mission {NAME} under {policy.name}@{policy.version} on {policy.vehicle.name} {{",
    ]
    lines += [f'  intent   "Qualification: {sortie.about}."', f"  proposed by {speaker.strip()} for role {role}", ""]
    for phase, those in groupby(steps, key=lambda each: each[0]):
        lines += [f"  phase {phase} {{", *[f"    {text}" for _, text in those], "  }"]
    return "\n".join([*lines, "}", ""])


def _held(sortie: Sortie, *, by_pilot: bool) -> int:
    if by_pilot and sortie.takeover is not None:
        return _PILOT_US
    return _AROUND_US + _EACH_US * len(sortie.silences) if sortie.silences else _HOLD_US


def _step(contract: Contract, hold_us: int, trial: SortiePlan, policy: Policy) -> str:
    motion, arguments = contract.motion, []
    for each in contract.parameters:
        if each.kind == PLACE and motion.kind == MotionKind.FLY:
            arguments.append(f"{each.name} = {_place(trial, policy)}")
        elif each.cell == motion.altitude:
            arguments.append(f"{each.name} = {display(_within(each, trial.height), Dimension.LENGTH)}")
        elif each.cell == motion.speed:
            arguments.append(f"{each.name} = {display(_within(each, trial.speed), Dimension.SPEED)}")
        elif each.cell == motion.time:
            arguments.append(f"{each.name} = {display(_within(each, hold_us) // 1_000 * 1_000, Dimension.DURATION)}")
    return f"{contract.name}({', '.join(arguments)})"


def _within(parameter: Parameter, value: int) -> int:
    return min(max(value, parameter.low), parameter.high)


def _place(trial: SortiePlan, policy: Policy) -> str:
    angle = radians(trial.bearing)
    east, north = round(trial.leg * sin(angle)), round(trial.leg * cos(angle))
    latitude, longitude = unproject(policy.projection, east, north)
    return f"{_degrees(latitude, 'NS')}, {_degrees(longitude, 'EW')}"


def _degrees(value: int, sides: str) -> str:
    return f"{abs(value) // 10_000_000}.{abs(value) % 10_000_000:07d} {sides[value < 0]}"
