"""E0508, E0614, E0616, E0804: where a step goes from where its predecessor ended, it may go, and can in time.

The start is taken to be the declared home, and every step to end where it was planned to. The leg to a step's path is
part of it.
"""

from typing import NamedTuple

from rtshcua.decision.airspace import keeps
from rtshcua.decision.energy import Energy
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.prepared import PreparedInvocation
from rtshcua.decision.reads import slots_read, where
from rtshcua.decision.safety import ranging
from rtshcua.decision.state import state
from rtshcua.decision.truth import EVERYWHERE, FALSE
from rtshcua.decision.values import point
from rtshcua.decision.verdict import PASS
from rtshcua.decision.volume import Volume
from rtshcua.diagnostics import codes
from rtshcua.ground.compiler.mission import argument_span
from rtshcua.ground.compiler.proofs.situation import Ground
from rtshcua.ground.compiler.shapes import Point
from rtshcua.ground.compiler.survey import path_length
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.limits import FULL
from rtshcua.model.ir.missions import Step
from rtshcua.model.quantity import Dimension, display

SECOND_US = 1_000_000


class Place(NamedTuple):
    """Where the vehicle is between two steps: local x, y and its height, in mm."""

    x: int
    y: int
    height: int


AT_HOME = Place(0, 0, 0)


def prove(ground: Ground, step: Step, invocation: PreparedInvocation, start: Place) -> Place | None:
    """Report what no state makes possible about a step that begins at `start`; where it ends, None after a finding."""
    before = len(ground.context.report.found)
    _speed(ground, step, invocation)
    if len(ground.context.report.found) == before:
        _volume(ground, step, invocation, start)
    if len(ground.context.report.found) == before:
        _duration(ground, step, invocation, start)
    return _end(invocation, start) if len(ground.context.report.found) == before else None


def _end(invocation: PreparedInvocation, start: Place) -> Place:
    plan = invocation.invocation.plan
    x, y = plan.path[-2:] if plan.path else start[:2]
    match plan.kind:
        case MotionKind.HOME | MotionKind.LAND:
            return Place(x, y, 0)
        case MotionKind.HOLD:
            return start
        case _:
            return Place(x, y, plan.altitude)


def _speed(ground: Ground, step: Step, invocation: PreparedInvocation) -> None:
    flat, vehicle = invocation.invocation, ground.prepared.policy.vehicle
    if flat.plan.speed <= vehicle.speed:
        return
    cell = flat.contract.motion.speed
    name = next(parameter.name for parameter in flat.contract.parameters if parameter.cell == cell)
    span = argument_span(ground.context, step, name)
    most = display(vehicle.speed, Dimension.SPEED)
    ground.context.report.add(
        codes.BEYOND_VEHICLE,
        span,
        f"`{vehicle.name}` flies at most {most}, and the step asks for {display(flat.plan.speed, Dimension.SPEED)}",
        help=f"the nearest value that it can fly is `{most}`",
        labels=[(ground.lowered.vehicle.speed.span, "declared here")],
        fix=None if span == step.span else (span, most, f"write `{most}`"),
    )


def _volume(ground: Ground, step: Step, invocation: PreparedInvocation, start: Place) -> None:
    """The planned volume keeps the airspace and what the contract maintains; charge and clauses can suffice."""
    known = ground.prepared.tables.known
    case = ground.case(invocation)
    slots = list(case.at.slots)
    slots[known.x], slots[known.y], slots[known.height] = point(start.x), point(start.y), point(start.height)
    at = Environment(slots, case.at.arguments, case.at.utc, case.at.error)
    volume = invocation.planner.volume(slots, known)
    airspace = ground.prepared.airspace
    if airspace is not None and EVERYWHERE[keeps(volume.place, airspace)] == FALSE:
        ground.context.report.add(
            codes.PATH_OUTSIDE,
            step.span,
            f"on its way, which begins {_from_home(start)}, the vehicle would leave the airspace",
            help="the leg to where the step begins counts, widened by the vehicle's position error; "
            "go around by further steps",
            labels=[(ground.span(airspace.airspace), "the airspace")],
        )
        return
    clause = _broken(ground, invocation, at, volume)
    if clause is not None:
        _never(ground, step, clause)
        return
    needed = Energy(invocation.invocation.contract, ground.prepared.policy.vehicle).needed(volume.farthest[1])
    if needed > FULL:
        ground.context.report.add(
            codes.BEYOND_VEHICLE,
            step.span,
            f"the step needs {display(needed, Dimension.RATIO)} of a full charge, with the way home and the reserve",
            labels=[(ground.lowered.vehicle.endurance.span, "what a full charge is worth")],
        )


def _from_home(place: Place) -> str:
    """A place in words, to the nearest metre."""
    east, north = (place.x + 500) // 1000, (place.y + 500) // 1000
    words = [f"{abs(east)} m {'east' if east > 0 else 'west'}"] if east else []
    words += [f"{abs(north)} m {'north' if north > 0 else 'south'}"] if north else []
    return f"{' and '.join(words)} of home" if words else "at home"


def _broken(ground: Ground, invocation: PreparedInvocation, at: Environment, volume: Volume) -> Clause | None:
    """A clause of the contract that cannot hold: over the planned volume, if it reads nothing else, or at all."""
    over = ranging(at, volume, ground.prepared.tables.known.height)
    vehicle = ground.prepared.policy.vehicle
    fixed = set(where(vehicle))
    for clause, condition in invocation.maintain:
        truth = condition(over)
        if set(slots_read((clause,), vehicle)) <= fixed:
            truth = EVERYWHERE[truth]
        if truth == FALSE:
            return clause
    found = state(ground.case(invocation))
    if found and PASS not in found:
        broken = found[0].clause
        return broken if isinstance(broken, Clause) else None
    return None


def _never(ground: Ground, step: Step, clause: Clause) -> None:
    ground.context.report.add(
        codes.NEVER_HOLDS,
        step.span,
        f"`{clause.text}` cannot hold all along this step",
        help="change the step's arguments, or where it begins",
        labels=[(ground.span(clause), "the contract asks for this")],
    )


def _duration(ground: Ground, step: Step, invocation: PreparedInvocation, start: Place) -> None:
    """The planned path can be flown in the time that the skill may last; speeding up and turning are not counted."""
    flat, vehicle = invocation.invocation, ground.prepared.policy.vehicle
    allowed = flat.contract.duration_us
    if not allowed:
        return
    points: list[Point] = [(start.x, start.y), *zip(flat.plan.path[::2], flat.plan.path[1::2], strict=True)]
    speed = flat.plan.speed or vehicle.speed
    end = _end(invocation, start)
    needed = path_length(points) * SECOND_US // speed
    climbing = abs(end.height - start.height) * SECOND_US // vehicle.climb
    total = needed + climbing if flat.plan.kind == MotionKind.HOME else max(needed, climbing)
    if flat.contract.motion.time >= 0:
        total = flat.arguments[flat.contract.motion.time]
    if total <= allowed:
        return
    skill = ground.context.symbols.skills[step.skill.text]
    assert skill.duration is not None
    ground.context.report.add(
        codes.PLAN_TOO_LONG,
        step.span,
        f"the step takes at least {display(total // SECOND_US * SECOND_US, Dimension.DURATION)}, and "
        f"`{skill.name.text}` lasts at most {display(allowed, Dimension.DURATION)}",
        help="fly a shorter path, or faster" if flat.plan.path else None,
        labels=[(skill.duration.span, "declared here")],
    )
