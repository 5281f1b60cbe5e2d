"""E0508, E0614, E0616: where a step goes from where its predecessor ended, it may go, and has the charge for.

The leg to a step's path is part of it, from wherever the vehicle may be then (`places`), and whenever it may come
(`period`).
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

from rtshcua.decision.evaluate import Condition, Environment
from rtshcua.decision.prepare import PreparedAirspace, PreparedInvocation
from rtshcua.decision.situation import ranging
from rtshcua.decision.tree import slots_read
from rtshcua.decision.values import EVERYWHERE, FALSE, TRUE
from rtshcua.decision.values import Span as Utc
from rtshcua.decision.volume import Volume
from rtshcua.decision.zones import Place as Places
from rtshcua.decision.zones import Sweep
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.analysis.words import clock
from rtshcua.ground.geometry.polygons import Point
from rtshcua.ground.lower.mission import argument_span
from rtshcua.ground.prove.leaving import Leg, breach, path_legs, places_along, position
from rtshcua.ground.prove.period import Period, at_moment, keeps, zone_span
from rtshcua.ground.prove.places import Place, from_home, from_where, planned
from rtshcua.ground.prove.situation import EVER, Ground
from rtshcua.ground.prove.ways import Ways
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.limits import FULL
from rtshcua.model.ir.missions import Step
from rtshcua.model.quantity import Dimension, display


def prove(
    ground: Ground,
    step: Step,
    invocation: PreparedInvocation,
    period: Period,
    starts: Sequence[Place],
    before: Sequence[Step],
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
        _volume(ground, step, invocation, period, start, skipped)

    return from_where(ground, invocation, starts, flies)


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


def _volume(
    ground: Ground,
    step: Step,
    invocation: PreparedInvocation,
    period: Period,
    start: Place,
    skipped: Sequence[Step],
) -> None:
    """The planned volume keeps the airspace and what the contract maintains; charge and clauses can suffice."""
    at, volume = planned(ground, invocation, start)
    labels = [(each.span, "this step may be skipped") for each in skipped[-1:]]
    if not _airspace(ground, step, invocation, period, start, volume, labels):
        return
    path = invocation.invocation.plan.path
    legs = path_legs([(start.x, start.y), *zip(path[::2], path[1::2], strict=True)])
    broken = _broken(ground, invocation, period, at, volume, legs)
    if broken is not None:
        _never(ground, step, broken, labels)
        return
    needed = invocation.energy.needed(volume.farthest[1], volume.height[:2])
    if needed > FULL:
        ground.context.report.add(
            codes.BEYOND_VEHICLE,
            step.span,
            f"the step needs {display(needed, Dimension.RATIO)} of a full charge, with the way home and the reserve",
            labels=[(ground.lowered.vehicle.endurance.span, "what a full charge is worth")],
        )


def _airspace(
    ground: Ground,
    step: Step,
    invocation: PreparedInvocation,
    period: Period,
    start: Place,
    volume: Volume,
    labels: list[tuple[Span, str]],
) -> bool:
    """Whether the planned volume keeps the airspace whenever the step may come."""
    airspace, policy, lasts = ground.prepared.airspace, ground.prepared.policy, invocation.lasts_us
    if airspace is None:
        return True
    present = period.present(airspace, lasts)
    begins = f"on its way, which {'may begin' if labels else 'begins'} {from_home(start.x, start.y)}, the vehicle would"
    written = (ground.span(airspace.airspace), "the airspace")
    if EVERYWHERE[keeps(volume.place, present)] == FALSE:
        home = invocation.invocation.plan.kind == MotionKind.HOME
        higher = Ways(ground).raised(start, present) if home else ""
        ground.context.report.add(
            codes.PATH_OUTSIDE,
            step.span,
            f"{begins} {_breach(ground, present, volume)}",
            help=f"{higher}; or go around by further steps"
            if higher
            else "the leg to where the step begins counts, widened by the vehicle's position error; "
            "go around by further steps",
            labels=[written, *period.labels(present, volume.place, lasts), *labels],
        )
        return False
    missing = period.missing(airspace, lasts)
    if missing is not None:
        name = policy.zones[missing.number].name
        ground.context.report.add(
            codes.PATH_OUTSIDE,
            step.span,
            f"{begins} be in `{name}`, which does not always exist {period.from_to(lasts)}, when this step may fly",
            help="issue the mission at another time, or let the steps before this one take less",
            labels=[written, (zone_span(ground, missing), "declared here")],
        )
        return False
    for zone in period.avoidable(airspace, lasts):
        if volume.place.inside(zone) != FALSE:
            period.avoid(zone, lasts)
    for zone in airspace.inside:
        period.stay(zone, lasts)
    return True


def _breach(ground: Ground, airspace: PreparedAirspace, volume: Volume) -> str:
    """What the vehicle would do in the first part of a volume that does not keep the airspace."""
    parts = volume.place.parts
    sweep, low, high = next((part for part in parts if keeps(Places((part,)), airspace) != TRUE), parts[0])
    points = list(zip(sweep.path[::2], sweep.path[1::2], strict=True))
    return breach(ground.prepared.policy, airspace, path_legs(points), low, high)


class Broken(NamedTuple):
    """A clause of the contract that cannot hold, the moment of UTC at which it cannot, near where, and between which
    heights the step flies; None where these do not matter.
    """

    clause: Clause
    moment: int | None = None
    place: Point | None = None
    height: tuple[int, int] | None = None


def _broken(
    ground: Ground,
    invocation: PreparedInvocation,
    period: Period,
    at: Environment,
    volume: Volume,
    legs: Sequence[Leg],
) -> Broken | None:
    """A clause of the contract that cannot hold over the planned volume, which leads along `legs`, or at the start."""
    over = ranging(at, volume, ground.prepared.tables.known.height, invocation.lasts_us)
    arguments, contract = invocation.invocation.arguments, invocation.invocation.contract
    anywhere = ground.around(invocation)

    def can(condition: Condition, best: Condition | None, there: Environment, utc: Utc) -> bool:
        """Whether a clause can be true at a moment, and in the best case is nowhere false."""
        then = at_moment(there, utc)
        return bool(condition(then) & TRUE) and (best is None or EVERYWHERE[best(then)] != FALSE)

    for clause, condition in invocation.maintain:
        maintained = partial(can, condition, ground.best(clause, contract), over)
        fails, moment = period.fails(clause, arguments, invocation.lasts_us, maintained)
        if fails:
            then = (0, EVER) if moment is None else (moment, moment)

            def holds(
                there: Environment, condition: Condition = condition, clause: Clause = clause, then: Utc = then
            ) -> bool:
                return can(condition, ground.best(clause, contract), there, then)

            near = _near(ground, invocation, at, volume, legs, holds)
            (low, high), vehicle = volume.height[:2], ground.prepared.policy.vehicle
            of_height = slots_read((clause,), vehicle, ground.prepared.policy.monitors) == (vehicle.height,)
            return Broken(clause, moment, near, (low, high) if of_height and low < high else None)
    for clause, condition in (*invocation.require, *invocation.assume):
        # where the step begins, only if the time matters too: else E0619 says so
        for there in (anywhere, at) if period.timed(clause, arguments) else (anywhere,):
            fails, moment = period.fails(clause, arguments, 0, partial(can, condition, None, there))
            if fails:
                return Broken(clause, moment)
    return None


def _near(
    ground: Ground,
    invocation: PreparedInvocation,
    at: Environment,
    volume: Volume,
    legs: Sequence[Leg],
    holds: Callable[[Environment], bool],
) -> Point | None:
    """The first place on the way at which a clause cannot hold; None where that is so everywhere, or nowhere alone."""
    error = ground.prepared.policy.vehicle.position_error
    box = (-error, -error, error, error)
    first, elsewhere = None, False
    for place in places_along(legs):
        there = Places(((Sweep(place, box), *volume.height[:2]),), 0)
        here = ranging(at, volume._replace(place=there), ground.prepared.tables.known.height, invocation.lasts_us)
        if holds(here):
            elsewhere = True
        elif first is None:
            first = place
        if first is not None and elsewhere:
            return first
    return None


def _never(ground: Ground, step: Step, broken: Broken, labels: list[tuple[Span, str]]) -> None:
    clause, policy = broken.clause, ground.prepared.policy
    at = where = ""
    if broken.moment is not None:
        at = f" at {clock(broken.moment, ground.prepared.tables.local)}, local time, when it may begin"
    if broken.place is not None:
        where = f": it fails near {position(policy, broken.place)}"
    elif broken.height is not None:
        low, high = (display(each, Dimension.ALTITUDE) for each in broken.height)
        where = f": from where it begins on it flies between {low} and {high}"
    ground.context.report.add(
        codes.NEVER_HOLDS,
        step.span,
        f"`{clause.text}` cannot hold all along this step{at}{where}",
        help="change the step's arguments, or where it begins"
        + (": a step before it may be skipped, and then it begins elsewhere" if labels else ""),
        labels=[(ground.span(clause), "the contract asks for this"), *labels],
    )
