"""What would have passed: computed only on refusal, from the condition that decided."""

from typing import NamedTuple

from rtshcua.decision.case import environment, situation
from rtshcua.decision.change import Changes, Made
from rtshcua.decision.decide import Decision
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.lasting import longest
from rtshcua.decision.offer import Offer, offer
from rtshcua.decision.prepared import PreparedInvocation, PreparedPolicy
from rtshcua.decision.safety import ranging
from rtshcua.decision.tree import Node
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import PLACE
from rtshcua.model.flat.limits import FULL
from rtshcua.model.flat.policy import Rule
from rtshcua.model.flat.situation import Now, State
from rtshcua.model.outcome import Reason


class Nearest(NamedTuple):
    """A value of `subject` (a parameter, a signal, or the local time) that would have passed, the nearest there is.

    `value` is in the canonical unit of `dimension` (`daytime`: us since local midnight). For an enumeration or a zone,
    `choices` are the names that would pass, and `value` is the ordinal or index of the first.
    """

    subject: str
    dimension: str
    value: int
    choices: tuple[str, ...]


def nearest(
    decision: Decision, invocation: PreparedInvocation, state: State, policy: PreparedPolicy, now: Now
) -> tuple[Nearest, ...]:
    """The changes which, made together, satisfy what decided; empty when no change of a value is known to."""
    sets = situation(state, policy, now)
    at = environment(sets, policy, invocation.arguments, invocation.phase)
    match decision.reason:
        case Reason.ARGUMENT_RANGE:
            return _in_range(invocation)
        case Reason.ENVELOPE:
            return _slower(invocation, policy)
        case Reason.ENERGY:
            return _charged(invocation, policy, at)
        case Reason.INVARIANT:
            known = policy.tables.known
            through = longest(invocation.invocation.contract, policy.policy.vehicle)
            at = ranging(at, invocation.planner.volume(at.slots, known), known.height, through)
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
        if offers and all(one.options for one in offers):
            tried = _tried(offers, changes, node, goal)
            if tried is not None:
                fitting.append(tried)
    return min(fitting, key=len, default=())


def _tried(offers: list[Offer], changes: Changes, node: Node, goal: bool) -> tuple[Nearest, ...] | None:
    """The offers that hold when tried, for a change may undo what another part of the condition was content with."""
    first: Made = {one.change.subject: one.options[0][0] for one in offers}
    kept: list[Nearest] = []
    for one in offers:
        good = [option for option in one.options if changes.help(node, goal, first | {one.change.subject: option[0]})]
        if not good:
            return None
        names = tuple(name for _, name in good if name)
        kept.append(Nearest(one.subject, one.dimension, good[0][0], names))
    return tuple(kept)


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
