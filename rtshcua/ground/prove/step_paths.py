"""Prove that home and the path of each step lie in the airspace (E0508), that its contract can hold along the path
(E0616), and that the vehicle can fly it (E0614).

The vehicle is at home before the first step and lands there after the last, so the whole disc in which home may lie
must be in the airspace. The leg to a step's path is part of its path. It begins at every place where the vehicle may
then be (`step_starts`), at every time at which the step may begin (`step_times`).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from rtshcua.decision.evaluate import Condition, Environment
from rtshcua.decision.prepare import PreparedAirspace, PreparedInvocation
from rtshcua.decision.situation import ranging
from rtshcua.decision.tree import slots_read
from rtshcua.decision.values import EVERYWHERE, FALSE, TRUE
from rtshcua.decision.values import Span as Utc
from rtshcua.decision.volume import Volume
from rtshcua.decision.zones import PlaceSet as Places
from rtshcua.decision.zones import Sweep
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.analysis.witness import local_time_text
from rtshcua.ground.geometry.polygons import Point
from rtshcua.ground.lower.mission import argument_span
from rtshcua.ground.prove.airspace_keeping import (
    HullSweep,
    Landmarks,
    Leg,
    breach_text,
    disc,
    hull,
    keeps,
    path_legs,
    place_text,
    places_along,
)
from rtshcua.ground.prove.fallback_ways import FallbackWays
from rtshcua.ground.prove.proof_context import EVER, ProofContext
from rtshcua.ground.prove.step_starts import StartPlace, from_home, from_where, planned
from rtshcua.ground.prove.step_times import MissionStep, at_moment, zone_span
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.limits import FULL
from rtshcua.model.quantity import Dimension, display


def prove_home(proof: ProofContext, steps: Sequence[MissionStep]) -> bool:
    """Whether a vehicle on the ground is in the airspace wherever home may lie. Reports the first step otherwise."""
    airspace, policy = proof.prepared.airspace, proof.policy
    if airspace is None:
        return True
    first, last = steps[0], steps[-1].time
    whole = replace(first.time, high=last.high)
    present = whole.present(airspace, last.lasts_us)
    error, within = policy.vehicle.position_error, policy.vehicle.home_within
    homes = disc(within)
    space = Places(((HullSweep(homes, (-error, -error, error, error), Landmarks(policy)), 0, 0),), 0)
    if keeps(space, present) == TRUE:
        for zone in whole.avoidable(airspace, last.lasts_us):
            if space.inside(zone) != FALSE:
                whole.avoid(zone, last.lasts_us)
        return True
    edge = hull(homes)
    legs = [*((corner, corner) for corner in edge), *(((0, 0), corner) for corner in edge)]
    written = proof.lowered.vehicle.within
    proof.report.add(
        codes.PATH_OUTSIDE,
        first.span,
        f"home may lie up to {display(within, Dimension.LENGTH)} from its declared place, and there the "
        f"vehicle would {breach_text(policy, present, legs, 0, 0)}",
        help="widen the airspace, or reduce `within` of home",
        labels=[
            (written.span, "home may be this far from its declared place"),
            (proof.span(airspace.airspace), "the airspace"),
            *whole.labels(present, space, last.lasts_us),
        ],
    )
    return False


def prove_path(
    proof: ProofContext, step: MissionStep, starts: Sequence[StartPlace], skipped: Sequence[MissionStep]
) -> tuple[StartPlace, ...]:
    """Report why a step cannot fly from `starts` in any state. Returns the places from which it can.

    The first of `starts` is the place where it begins if none of the `skipped` steps was skipped.
    """
    if _too_fast(proof, step):
        return ()

    def flies(start: StartPlace) -> None:
        _volume(proof, step, start, () if start is starts[0] else skipped)

    return from_where(proof, step.prepared, starts, flies)


def _too_fast(proof: ProofContext, step: MissionStep) -> bool:
    """Whether a step sets a speed above the vehicle's limit. Reports it."""
    flat, vehicle = step.flat, proof.policy.vehicle
    if flat.plan.speed <= vehicle.speed:
        return False
    cell = flat.contract.motion.speed
    name = next(parameter.name for parameter in flat.contract.parameters if parameter.cell == cell)
    span = argument_span(proof.context, step.declared, name)
    most = display(vehicle.speed, Dimension.SPEED)
    proof.report.add(
        codes.BEYOND_VEHICLE,
        span,
        f"`{vehicle.name}` flies at most {most}, but the step sets {display(flat.plan.speed, Dimension.SPEED)}",
        help=f"nearest accepted: `{most}`",
        labels=[(proof.lowered.vehicle.speed.span, "declared here")],
        fix=None if span == step.span else (span, most, f"write `{most}`"),
    )
    return True


def _volume(proof: ProofContext, step: MissionStep, start: StartPlace, skipped: Sequence[MissionStep]) -> None:
    """Report a planned volume that leaves the airspace, breaks the contract, or needs more than a full charge."""
    at, volume = planned(proof, step.prepared, start)
    labels = [(each.span, "this step may be skipped") for each in skipped[-1:]]
    if not _airspace(proof, step, start, volume, labels):
        return
    path = step.flat.plan.path
    legs = path_legs([(start.x, start.y), *zip(path[::2], path[1::2], strict=True)])
    broken = _broken(proof, step, at, volume, legs)
    if broken is not None:
        _report_broken(proof, step, broken, labels)
        return
    needed = step.prepared.energy.needed(volume.farthest[1], volume.height[:2])
    if needed > FULL:
        proof.report.add(
            codes.BEYOND_VEHICLE,
            step.span,
            f"the step needs {display(needed, Dimension.RATIO)} of a full charge, with the way home and the reserve",
            labels=[(proof.lowered.vehicle.endurance.span, "the endurance of a full charge")],
        )


def _airspace(
    proof: ProofContext, step: MissionStep, start: StartPlace, volume: Volume, labels: list[tuple[Span, str]]
) -> bool:
    """Whether the planned volume stays in the airspace whenever the step may fly. Reports the first violation."""
    airspace, policy, lasts = proof.prepared.airspace, proof.policy, step.prepared.lasts_us
    if airspace is None:
        return True
    present = step.time.present(airspace, lasts)
    begins = (
        f"on the path, which {'may begin' if labels else 'begins'} {from_home(start.x, start.y)}, the vehicle would"
    )
    written = (proof.span(airspace.airspace), "the airspace")
    if EVERYWHERE[keeps(volume.place, present)] == FALSE:
        home = step.flat.plan.kind == MotionKind.HOME
        higher = FallbackWays(proof).raised(start, present) if home else ""
        proof.report.add(
            codes.PATH_OUTSIDE,
            step.span,
            f"{begins} {_breach_of(proof, present, volume)}",
            help=f"{higher}; or add steps that lead around"
            if higher
            else "add steps that lead around; the leg to the step's first place counts too, and the path is widened by "
            "the vehicle's position error",
            labels=[written, *step.time.labels(present, volume.place, lasts), *labels],
        )
        return False
    missing = step.time.missing(airspace, lasts)
    if missing is not None:
        name = policy.zones[missing.number].name
        proof.report.add(
            codes.PATH_OUTSIDE,
            step.span,
            f"{begins} be in `{name}`, which does not always exist {step.time.from_to(lasts)}, when this step may fly",
            help="issue the mission at another time, or shorten the steps before this one",
            labels=[written, (zone_span(proof, missing), "declared here")],
        )
        return False
    for zone in step.time.avoidable(airspace, lasts):
        if volume.place.inside(zone) != FALSE:
            step.time.avoid(zone, lasts)
    for zone in airspace.inside:
        step.time.stay(zone, lasts)
    return True


def _breach_of(proof: ProofContext, airspace: PreparedAirspace, volume: Volume) -> str:
    """Describe how the first part of a volume that leaves the airspace violates it."""
    parts = volume.place.parts
    sweep, low, high = next((part for part in parts if keeps(Places((part,)), airspace) != TRUE), parts[0])
    points = list(zip(sweep.path[::2], sweep.path[1::2], strict=True))
    return breach_text(proof.policy, airspace, path_legs(points), low, high)


class _BrokenClause(NamedTuple):
    """A clause of the contract that cannot hold, with the UTC time, the place and the heights, if they matter."""

    clause: Clause
    moment: int | None = None
    place: Point | None = None
    height: tuple[int, int] | None = None


def _broken(
    proof: ProofContext, step: MissionStep, at: Environment, volume: Volume, legs: Sequence[Leg]
) -> _BrokenClause | None:
    """Return a clause of the contract that cannot hold over the planned volume along `legs`, or at the start."""
    invocation, period, arguments = step.prepared, step.time, step.flat.arguments
    over = ranging(at, volume, proof.prepared.tables.known.height, invocation.lasts_us)
    anywhere = proof.around(invocation)

    def can(condition: Condition, best: Condition | None, there: Environment, utc: Utc) -> bool:
        """Whether a clause can be true at a time, and in the best case is nowhere false."""
        then = at_moment(there, utc)
        return bool(condition(then) & TRUE) and (best is None or EVERYWHERE[best(then)] != FALSE)

    for clause, condition in invocation.maintain:
        maintained = partial(can, condition, proof.best(clause, step.contract), over)
        fails, moment = period.fails(clause, arguments, invocation.lasts_us, maintained)
        if fails:
            then = (0, EVER) if moment is None else (moment, moment)

            def holds(
                there: Environment, condition: Condition = condition, clause: Clause = clause, then: Utc = then
            ) -> bool:
                return can(condition, proof.best(clause, step.contract), there, then)

            near = _near(proof, invocation, at, volume, legs, holds)
            (low, high), vehicle = volume.height[:2], proof.policy.vehicle
            of_height = slots_read((clause,), vehicle, proof.policy.monitors) == (vehicle.height,)
            return _BrokenClause(clause, moment, near, (low, high) if of_height and low < high else None)
    for clause, condition in (*invocation.require, *invocation.assume):
        # the start place matters only together with the time; E0619 covers the place alone
        for there in (anywhere, at) if period.timed(clause, arguments) else (anywhere,):
            fails, moment = period.fails(clause, arguments, 0, partial(can, condition, None, there))
            if fails:
                return _BrokenClause(clause, moment)
    return None


def _near(
    proof: ProofContext,
    invocation: PreparedInvocation,
    at: Environment,
    volume: Volume,
    legs: Sequence[Leg],
    holds: Callable[[Environment], bool],
) -> Point | None:
    """Return the first place at which a clause cannot hold, if it can hold elsewhere on the path; else None."""
    error = proof.policy.vehicle.position_error
    box = (-error, -error, error, error)
    first, elsewhere = None, False
    for place in places_along(legs):
        there = Places(((Sweep(place, box), *volume.height[:2]),), 0)
        here = ranging(at, volume._replace(place=there), proof.prepared.tables.known.height, invocation.lasts_us)
        if holds(here):
            elsewhere = True
        elif first is None:
            first = place
        if first is not None and elsewhere:
            return first
    return None


def _report_broken(
    proof: ProofContext, step: MissionStep, broken: _BrokenClause, labels: list[tuple[Span, str]]
) -> None:
    clause, policy = broken.clause, proof.policy
    at = where = ""
    if broken.moment is not None:
        at = f" at {local_time_text(broken.moment, proof.prepared.tables.local)}, local time, when it may begin"
    if broken.place is not None:
        where = f": it fails near {place_text(policy, broken.place)}"
    elif broken.height is not None:
        low, high = (display(each, Dimension.ALTITUDE) for each in broken.height)
        where = f": the step flies between {low} and {high}"
    proof.report.add(
        codes.NEVER_HOLDS,
        step.span,
        f"`{clause.text}` cannot hold during the whole step{at}{where}",
        help="change the step's arguments or its start"
        + ("; it begins elsewhere if the step before it is skipped" if labels else ""),
        labels=[(proof.span(clause), "the contract contains this condition"), *labels],
    )
