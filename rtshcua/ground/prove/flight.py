"""The proofs that follow the vehicle from step to step: where it goes, what it finds there, and how it comes home."""

from collections.abc import Sequence

from rtshcua.decision.flying import slower
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.diagnostics import codes
from rtshcua.ground.prove import chaining, charge, durations, last_link, path, starting
from rtshcua.ground.prove.durations import StepBound
from rtshcua.ground.prove.period import Period
from rtshcua.ground.prove.places import AT_HOME, MOST_PLACES, Place, after, may_be_skipped
from rtshcua.ground.prove.situation import Ground
from rtshcua.ground.prove.ways import Ways
from rtshcua.model.ir.missions import MissionDecl, Step


def prove(
    ground: Ground,
    mission: MissionDecl,
    steps: Sequence[Step],
    invocations: Sequence[PreparedInvocation],
    comes: Sequence[Period],
    permitted: Sequence[bool],
) -> tuple[StepBound, ...]:
    """Report what is wrong with the way of a mission, up to the first step that cannot be flown; what each step takes
    at most, where all are proved.

    What comes after such a step would begin at a place that is never reached.
    """
    ways = Ways(ground)
    starts: list[tuple[Place, ...]] = []
    places: tuple[Place, ...] = (AT_HOME,)
    decided, slowest = True, 0
    bounds: list[StepBound] = []
    for number, (step, one, period) in enumerate(zip(steps, invocations, comes, strict=True)):
        able = places if permitted[number] and one.invocation.skill not in ground.impossible else ()
        if (able and not may_be_skipped(one)) or not any(place.aloft for place in places):
            able = chaining.aloft(ground, step, one, able, steps[:number])
        able = path.prove(ground, step, one, period, able, steps[:number]) if able else ()
        able = chaining.aloft(ground, step, one, able, steps[:number])
        slowest = slower(slowest, one.invocation.plan.speed)
        bound = durations.prove(ground, step, one, able, slowest) if able else None
        able = chaining.prove(ground, step, one, able, steps[:number]) if able else ()
        if not able or not (number or starting.prove(ground, step, comes)):
            return ()
        if bound is not None:
            bounds.append(bound)
        ways.prove(step, one, period, able)
        starts.append(able)
        places = after(one, places, able)
        if len(places) > MOST_PLACES:
            places = places[:MOST_PLACES]
            if decided:
                decided = False
                _undecided(ground, step)
    chaining.ending(ground, mission, steps[-1], places)
    charge.prove(ground, steps, invocations, starts)
    last_link.prove_height(ground, steps, invocations)
    return tuple(bounds) if len(bounds) == len(steps) else ()


def _undecided(ground: Ground, step: Step) -> None:
    ground.context.report.add(
        codes.UNDECIDED,
        step.span,
        f"after this step the vehicle may be at more than {MOST_PLACES} places, for so many steps may be skipped",
        help="the ways from some of them are left for on board; let a step between them `abort` or `hold`",
    )
