"""All proofs, of a policy and of the missions under it."""

from functools import lru_cache

from rtshcua.decision.flying import slower
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy, at_slowest, paths_fit, prepare
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.analysis.questions import Questions
from rtshcua.ground.analysis.space import signals
from rtshcua.ground.checker.context import Context
from rtshcua.ground.lower.policy import LoweredPolicy
from rtshcua.ground.prove import (
    authority,
    between,
    chains,
    contradiction,
    deferral,
    delegations,
    flight,
    hours,
    last_link,
    observation,
    rules,
    some_time,
    timing,
)
from rtshcua.ground.prove.durations import StepBound
from rtshcua.ground.prove.line import still
from rtshcua.ground.prove.period import periods
from rtshcua.ground.prove.situation import Ground
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.ir.missions import MissionDecl


def prove_policy(context: Context, lowered: LoweredPolicy) -> Ground | None:
    """The policy prepared as on board, after its proofs; None where it would be refused there."""
    asked = _asked(lowered.policy)
    if isinstance(asked, Refusal):
        refused(context, lowered, asked)
        return None
    prepared, questions = asked
    ground = Ground(context, lowered, prepared, tuple(signals(lowered.policy)), questions.again())
    for proof in (chains, last_link, deferral, observation, contradiction, delegations, rules):
        proof.prove(ground)
    return ground


@lru_cache(maxsize=32)
def _asked(policy: Policy) -> tuple[PreparedPolicy, Questions] | Refusal:
    """A policy prepared, and what is asked about it: missions in several files are often under the same one, and each
    is a program of its own, in which the same questions come up.
    """
    prepared = prepare(policy)
    return prepared if isinstance(prepared, Refusal) else (prepared, Questions(prepared))


def prove_mission(ground: Ground, declared: MissionDecl, mission: Mission) -> tuple[StepBound, ...]:
    """The proofs of a mission under a policy; what each step takes at most, as far as the mission can be flown."""
    too_long = paths_fit(mission, ground.prepared)
    if too_long is not None:
        text = f"`{declared.name.text}` does not fit on board: {too_long.text}"
        ground.context.report.add(codes.TOO_MANY, declared.name.span, text, help=too_long.help)
        return ()
    prepared: list[PreparedInvocation] = []
    slowest = 0
    for invocation in mission.invocations:
        found = ground.prepare(invocation, mission.phases)
        if isinstance(found, Refusal):
            refused(ground.context, ground.lowered, found)
            return ()
        prepared.append(at_slowest(found, slowest))
        slowest = slower(slowest, invocation.plan.speed)
    steps = [step for phase in declared.phases for step in phase.steps]
    permitted = [authority.prove(ground, declared, step, one) for step, one in zip(steps, prepared, strict=True)]
    before = len(ground.context.report.found)
    comes = periods(ground, prepared)
    flown = flight.prove(ground, declared, steps, prepared, comes, permitted)
    if len(ground.context.report.found) == before:
        for step, one, good in zip(steps, prepared, permitted, strict=True):
            if good:
                contradiction.prove_step(ground, step, one)
    if all(permitted):
        timely = hours.prove if mission.issued_at_us else some_time.prove
        if not timely(ground, steps, prepared, comes, still(prepared)):
            between.prove(ground, declared, steps, prepared, comes, timely)
    for step, one in zip(steps, prepared, strict=True):
        deferral.prove_step(ground, step, one)
        observation.prove_step(ground, step, one)
    timing.prove(ground, steps, prepared)
    deferral.prove_mission(ground, steps, prepared)
    return flown


def refused(context: Context, lowered: LoweredPolicy, malformed: Refusal) -> None:
    """Report what would not be loaded on board."""
    context.report.add(
        codes.REFUSED_ON_BOARD,
        lowered.declaration.name.span,
        f"what `{lowered.declaration.name.text}` was compiled to would be refused on board: {malformed.text}",
        help="this is a fault of the compiler, unless a limit is named",
    )
