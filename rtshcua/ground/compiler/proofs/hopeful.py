"""Whether a step can be permitted at all: what only the state of the vehicle decides is taken to go the step's way.

Arguments, the time and the phase are known, or known to be in a set; a permit that no state makes true does not permit,
a forbid that every state makes true forbids.
"""

from collections.abc import Iterator

from rtshcua.decision import tree
from rtshcua.decision.prepare import PreparedInvocation, PreparedRule
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN
from rtshcua.ground.analysis.solve import Goal, Yes, satisfiable
from rtshcua.ground.analysis.space import Space
from rtshcua.ground.analysis.witness import Witness
from rtshcua.ground.compiler.proofs.situation import ALWAYS, Ground
from rtshcua.model.flat.policy import Rule

NEVER = tree.AtMost((), -1)


def refused(
    ground: Ground, invocation: PreparedInvocation, space: Space, given: tuple[Goal, ...] = ()
) -> Iterator[tuple[Witness, Rule | None]]:
    """Situations of a space in which a step is surely refused: by a forbid, or (None) for want of a permit.

    At most one of each. `given` must hold in them.
    """
    candidates = invocation.candidates
    permits = [_hoped(ground, permit, True) for permit in candidates.permits]
    if None not in permits:
        wanting: list[Goal] = [(node, FALSE | UNKNOWN) for node in permits if node is not None]
        answer = satisfiable([*given, *wanting], space)
        if isinstance(answer, Yes):
            yield answer.witness, None
    for forbid in candidates.forbids:
        node = _hoped(ground, forbid, False)
        answer = satisfiable([*given, (ALWAYS if node is None else node, TRUE)], space)
        if isinstance(answer, Yes):
            yield answer.witness, forbid.rule


def _hoped(ground: Ground, rule: PreparedRule, hope: bool) -> tree.Node | None:
    key = (rule.number, hope)
    if key not in ground.hopes:
        node = ground.prepared.compiler.when(rule.rule)
        ground.hopes[key] = None if node is None else hopeful(node, hope)
    return ground.hopes[key]


def hopeful(node: tree.Node, hope: bool) -> tree.Node:
    """A condition whose atoms about the state are what brings it nearest to `hope`."""
    match node:
        case tree.Both(left, right):
            return tree.Both(hopeful(left, hope), hopeful(right, hope))
        case tree.Either(left, right):
            return tree.Either(hopeful(left, hope), hopeful(right, hope))
        case tree.Not(operand):
            return tree.Not(hopeful(operand, not hope))
        case tree.AtMost(terms, _) | tree.Equal(terms, _):
            known = all(term.argument for term in terms)
        case tree.Member(argument, _, _):
            known = argument
        case _:
            known = isinstance(node, tree.PointInside | tree.InWindow | tree.InPhase)
    return node if known else ALWAYS if hope else NEVER
