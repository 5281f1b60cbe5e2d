"""Which `confirm` rules can match a step at all: its arguments and phase are known before it flies."""

from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.values import TRUE, UNKNOWN
from rtshcua.ground.analysis.solve import No, satisfiable
from rtshcua.ground.analysis.space import space_of


def may_match(of: PreparedInvocation, number: int) -> bool:
    """Whether the condition of this rule can be true or unknown for the step, whatever the vehicle reports and
    whenever it flies. One that was not decided may.
    """
    prepared = of.policy
    rule = prepared.policy.rules[number]
    node = prepared.compiler.when(rule)
    if node is None:
        return True
    space = space_of(prepared, prepared.policy.contracts[of.invocation.skill])
    space = space._replace(arguments=of.arguments, phases=frozenset((of.phase,)))
    return not isinstance(satisfiable([(node, TRUE | UNKNOWN)], space), No)
