"""What would have passed: computed only on refusal, from the condition that decided."""

from rtshcua.decision.case import situation
from rtshcua.decision.change import Changes
from rtshcua.decision.decide import Decision
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.offer import Nearest, offer
from rtshcua.decision.prepared import PreparedInvocation, PreparedPolicy
from rtshcua.decision.safety import ranging
from rtshcua.decision.tree import Node
from rtshcua.decision.values import MISSING
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import PLACE
from rtshcua.model.flat.limits import FULL
from rtshcua.model.flat.policy import Rule
from rtshcua.model.flat.situation import Now, State
from rtshcua.model.outcome import Reason


def nearest(
    decision: Decision, invocation: PreparedInvocation, state: State, policy: PreparedPolicy, now: Now
) -> tuple[Nearest, ...]:
    """The changes which, made together, satisfy what decided; empty when no change of a value is known to."""
    sets = situation(state, policy, now)
    at = Environment([*sets.values, MISSING], invocation.arguments, sets.utc_us, sets.utc_error_us)
    match decision.reason:
        case Reason.ARGUMENT_RANGE:
            return _in_range(invocation)
        case Reason.ENVELOPE:
            return _slower(invocation, policy)
        case Reason.ENERGY:
            return _charged(invocation, policy, at)
        case Reason.INVARIANT:
            known = policy.tables.known
            at = ranging(at, invocation.planner.volume(at.slots, known), known.height)
    return _fewest(_conditions(decision, invocation, policy), invocation, policy, at)


def _conditions(decision: Decision, invocation: PreparedInvocation, policy: PreparedPolicy) -> list[tuple[Node, bool]]:
    """Conditions with the truth they should have had; any one of them would do."""
    compiler, clause = policy.compiler, decision.clause
    match decision.reason:
        case Reason.OUT_OF_SCOPE:
            rules, goal = [permit.rule for permit in invocation.candidates.permits], True
        case Reason.FORBIDDEN | Reason.DEGRADED if isinstance(clause, Rule):
            rules, goal = [clause], False
        case Reason.STATE_VIOLATED | Reason.INVARIANT if isinstance(clause, Clause):
            return [(compiler.node(clause, invocation.invocation.contract), True)]
        case _:
            return []
    return [(node, goal) for rule in rules if (node := compiler.when(rule)) is not None]


def _fewest(
    conditions: list[tuple[Node, bool]], invocation: PreparedInvocation, policy: PreparedPolicy, at: Environment
) -> tuple[Nearest, ...]:
    changes, contract = Changes(at, policy.tables), invocation.invocation.contract
    fitting: list[tuple[Nearest, ...]] = []
    for node, goal in conditions:
        offers = [offer(change, contract, policy.policy, at) for change in changes.find(node, goal) or ()]
        known = tuple(one for one in offers if one is not None)
        if known and len(known) == len(offers):
            fitting.append(known)
    return min(fitting, key=len, default=())


def _in_range(invocation: PreparedInvocation) -> tuple[Nearest, ...]:
    parameter = invocation.misfit
    if parameter is None or parameter.kind == PLACE:
        return ()
    argument = invocation.invocation.arguments[parameter.cell]
    value = parameter.low if argument < parameter.low else parameter.high
    return (Nearest(parameter.name, parameter.dimension, value, ()),)


def _slower(invocation: PreparedInvocation, policy: PreparedPolicy) -> tuple[Nearest, ...]:
    contract, speed = invocation.invocation.contract, policy.policy.vehicle.speed
    return tuple(
        Nearest(parameter.name, parameter.dimension, speed, ())
        for parameter in contract.parameters
        if parameter.cell == contract.motion.speed and parameter.low <= speed
    )


def _charged(invocation: PreparedInvocation, policy: PreparedPolicy, at: Environment) -> tuple[Nearest, ...]:
    volume = invocation.planner.volume(at.slots, policy.tables.known)
    needed = invocation.energy.needed(volume.farthest[1])
    return tuple(
        Nearest(signal.name, signal.dimension, needed, ())
        for signal in policy.policy.signals
        if signal.slot == policy.policy.vehicle.battery and needed <= FULL
    )
