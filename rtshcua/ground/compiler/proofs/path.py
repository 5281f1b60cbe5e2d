"""E0508, E0614, E0616, E0804: where a step goes from where its predecessor ended, it may go, and can in time.

The leg to a step's path is part of it, from wherever the vehicle may be then (`places`). Zones that exist at some times
only are left for on board, where the time is known.
"""

from collections.abc import Sequence

from rtshcua.decision.contracts import Energy, longest
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.safety import ranging
from rtshcua.decision.tree import monitored, slots_read, where
from rtshcua.decision.values import EVERYWHERE, FALSE, TRUE
from rtshcua.decision.volume import Volume
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.compiler.mission import argument_span
from rtshcua.ground.compiler.proofs.anytime import may_keep
from rtshcua.ground.compiler.proofs.leaving import breach, path_legs
from rtshcua.ground.compiler.proofs.places import Place, end, from_home, from_where, planned
from rtshcua.ground.compiler.proofs.situation import Ground
from rtshcua.ground.compiler.shapes import Point
from rtshcua.ground.compiler.ways import path_length
from rtshcua.model.flat.code import Clause, Op
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.limits import FULL
from rtshcua.model.ir.missions import Step
from rtshcua.model.quantity import Dimension, display

SECOND_US = 1_000_000
MILLISECOND_US = 1_000


def prove(
    ground: Ground, step: Step, invocation: PreparedInvocation, starts: Sequence[Place], before: Sequence[Step]
) -> tuple[Place, ...]:
    """Report what no state makes possible about a step that may come at any of `starts`; where of these it may begin,
    nowhere after a finding.

    The first of `starts` is where it begins when no step `before` was skipped.
    """
    report = ground.context.report
    already = len(report.found)
    _speed(ground, step, invocation)
    if len(report.found) > already:
        return ()

    def flies(start: Place) -> None:
        skipped = [] if start is starts[0] else [each for each in before if each.on_inadmissible == "skip"]
        _volume(ground, step, invocation, start, skipped)

    able = from_where(ground, invocation, starts, flies)
    for start in able:
        _duration(ground, step, invocation, start)
        if len(report.found) > already:
            return ()
    return able


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


def _volume(ground: Ground, step: Step, invocation: PreparedInvocation, start: Place, skipped: Sequence[Step]) -> None:
    """The planned volume keeps the airspace and what the contract maintains; charge and clauses can suffice."""
    at, volume = planned(ground, invocation, start)
    airspace, policy = ground.prepared.airspace, ground.prepared.policy
    labels = [(each.span, "this step may be skipped") for each in skipped[-1:]]
    if airspace is not None and EVERYWHERE[may_keep(volume.place, airspace)] == FALSE:
        path = invocation.invocation.plan.path
        legs = path_legs([(start.x, start.y), *zip(path[::2], path[1::2], strict=True)])
        ground.context.report.add(
            codes.PATH_OUTSIDE,
            step.span,
            f"on its way, which {'may begin' if skipped else 'begins'} {from_home(start.x, start.y)}, the vehicle "
            f"would {breach(policy, airspace, legs, *volume.height[:2])}",
            help="the leg to where the step begins counts, widened by the vehicle's position error; "
            "go around by further steps",
            labels=[(ground.span(airspace.airspace), "the airspace"), *labels],
        )
        return
    clause = _broken(ground, invocation, at, volume)
    if clause is not None:
        _never(ground, step, clause, labels)
        return
    needed = Energy(invocation.invocation.contract, ground.prepared.policy.vehicle).needed(volume.farthest[1])
    if needed > FULL:
        ground.context.report.add(
            codes.BEYOND_VEHICLE,
            step.span,
            f"the step needs {display(needed, Dimension.RATIO)} of a full charge, with the way home and the reserve",
            labels=[(ground.lowered.vehicle.endurance.span, "what a full charge is worth")],
        )


def _broken(ground: Ground, invocation: PreparedInvocation, at: Environment, volume: Volume) -> Clause | None:
    """A clause of the contract that cannot hold: over the planned volume, if it reads nothing else, or at all."""
    vehicle = ground.prepared.policy.vehicle
    through = longest(invocation.invocation.contract, vehicle)
    over = ranging(at, volume, ground.prepared.tables.known.height, through)
    fixed = set(where(vehicle))
    for clause, condition in invocation.maintain:
        truth = condition(over)
        timeless = not monitored((clause,)) and not _timed(ground, clause)
        if timeless and set(slots_read((clause,), vehicle)) <= fixed:
            truth = EVERYWHERE[truth]
        if truth == FALSE:
            return clause
    case = ground.case(invocation)
    for clause, condition in (*invocation.require, *invocation.assume):
        if not condition(case.at) & TRUE:
            return clause
    return None


def _timed(ground: Ground, clause: Clause) -> bool:
    """Whether a clause reads the time, or a zone that exists at some times only."""
    code, tables = clause.code, ground.prepared.tables
    for at in range(0, len(code), 3):
        op, a, b = code[at : at + 3]
        zones = (a,) if op == Op.POSITION_IN else tables.tables[b] if op == Op.POSITION_IN_ARGUMENT else ()
        if op == Op.TIME_IN or any(tables.zones[zone].times is not None for zone in zones):
            return True
    return False


def _never(ground: Ground, step: Step, clause: Clause, labels: list[tuple[Span, str]]) -> None:
    ground.context.report.add(
        codes.NEVER_HOLDS,
        step.span,
        f"`{clause.text}` cannot hold all along this step",
        help="change the step's arguments, or where it begins"
        + (": a step before it may be skipped, and then it begins elsewhere" if labels else ""),
        labels=[(ground.span(clause), "the contract asks for this"), *labels],
    )


def _duration(ground: Ground, step: Step, invocation: PreparedInvocation, start: Place) -> None:
    """The planned path can be flown in the time that the skill may last; speeding up and turning are not counted."""
    flat, vehicle = invocation.invocation, ground.prepared.policy.vehicle
    allowed = flat.contract.duration_us
    if not allowed:
        return
    points: list[Point] = [(start.x, start.y), *zip(flat.plan.path[::2], flat.plan.path[1::2], strict=True)]
    speed = flat.plan.speed or vehicle.speed
    there = end(invocation, start)
    needed = path_length(points) * SECOND_US // speed
    climbing = abs(there.height - start.height) * SECOND_US // vehicle.climb
    total = needed + climbing if flat.plan.kind == MotionKind.HOME else max(needed, climbing)
    if flat.contract.motion.time >= 0:
        total = flat.arguments[flat.contract.motion.time]
    if total <= allowed:
        return
    skill = ground.context.symbols.skills[step.skill.text]
    own = None if step.overrides is None else step.overrides.duration
    limit = own or skill.duration
    assert limit is not None
    lasts = f"`{skill.name.text}` lasts at most {display(allowed, Dimension.DURATION)}"
    over = -(-(total - allowed) // MILLISECOND_US) * MILLISECOND_US
    ground.context.report.add(
        codes.PLAN_TOO_LONG,
        step.span,
        f"the step takes at least {display(total // SECOND_US * SECOND_US, Dimension.DURATION)}, and {lasts}"
        if total - allowed >= SECOND_US
        else f"{lasts}, and the step takes up to {display(over, Dimension.DURATION)} longer",
        help="fly a shorter path, or faster" if flat.plan.path else None,
        labels=[(limit.span, "declared here")],
    )
