"""All proofs, of a policy and of the missions under it."""

from rtshcua.decision.prepare import Malformed, prepare, prepare_invocation
from rtshcua.decision.prepared import PreparedInvocation
from rtshcua.diagnostics import codes
from rtshcua.ground.checker.context import Context
from rtshcua.ground.compiler.policy import LoweredPolicy
from rtshcua.ground.compiler.proofs import authority, chains, path, timing
from rtshcua.ground.compiler.proofs.situation import Ground, anything
from rtshcua.model.flat.mission import Mission
from rtshcua.model.ir.missions import MissionDecl


def prove_policy(context: Context, lowered: LoweredPolicy) -> Ground | None:
    """The policy prepared as on board, after its proofs; None where it would be refused there."""
    prepared = prepare(lowered.policy)
    if isinstance(prepared, Malformed):
        _refused(context, lowered, prepared)
        return None
    ground = Ground(context, lowered, prepared, anything(lowered.policy))
    chains.prove(ground)
    return ground


def prove_mission(ground: Ground, declared: MissionDecl, mission: Mission) -> None:
    """The proofs of a mission under a policy."""
    prepared: list[PreparedInvocation] = []
    for invocation in mission.invocations:
        found = prepare_invocation(invocation, ground.prepared)
        if isinstance(found, Malformed):
            _refused(ground.context, ground.lowered, found)
            return
        prepared.append(found)
    steps = [step for phase in declared.phases for step in phase.steps]
    place: path.Place | None = path.AT_HOME
    for step, one in zip(steps, prepared, strict=True):
        permitted = authority.prove(ground, declared, step, one)
        # what comes after a step that cannot be flown would begin at a place that is never reached
        place = path.prove(ground, step, one, place) if permitted and place is not None else None
    timing.prove(ground, steps, prepared)


def _refused(context: Context, lowered: LoweredPolicy, malformed: Malformed) -> None:
    context.report.add(
        codes.REFUSED_ON_BOARD,
        lowered.declaration.name.span,
        f"what `{lowered.declaration.name.text}` was compiled to would be refused on board: {malformed.what}",
        help="this is a fault of the compiler, unless a limit is named",
    )
