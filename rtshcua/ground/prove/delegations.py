"""E0715: a delegation's condition can hold together with at least one of the permits that it passes on."""

from rtshcua.decision.values import TRUE
from rtshcua.diagnostics import codes
from rtshcua.ground.analysis.solve import No
from rtshcua.ground.prove.situation import Ground
from rtshcua.model.flat.policy import Rule, RuleKind
from rtshcua.model.ir.policies import Delegation

#: so many permits are shown that a condition contradicts
SHOWN = 3


def prove(ground: Ground) -> None:
    """Report every delegation of which it is proved that nothing can ever be had by it."""
    for delegation in ground.lowered.declaration.delegations:
        permits = _permits(ground, delegation)
        if delegation.when is None or not permits:
            continue
        if not any(_possible(ground, permit) for permit in permits):
            ground.context.report.add(
                codes.EMPTY_DELEGATION,
                delegation.when.span,
                f"`{ground.context.report.text(delegation.when.span)}` can never hold together with what "
                f"`{delegation.grantor.text}` is permitted",
                help=f"so nothing is delegated to `{delegation.grantee.text}`: a delegation narrows what its grantor "
                "has, and gives nothing beyond it",
                labels=[(ground.lowered.written[permit].span, "permitted by this rule") for permit in permits[:SHOWN]],
            )


def _permits(ground: Ground, delegation: Delegation) -> list[Rule]:
    """The permits that a delegation made."""
    return [
        flat
        for flat, rule in ground.lowered.written.items()
        if flat.kind == RuleKind.PERMIT and rule.origin and rule.origin[0] is delegation
    ]


def _possible(ground: Ground, permit: Rule) -> bool:
    """Whether a permit may ever match, for all that can be proved."""
    node = ground.prepared.compiler.when(permit)
    if node is None:
        return True
    goals = [(node, TRUE)]
    skills = permit.skills or range(len(ground.prepared.policy.contracts))
    answers = (
        ground.questions.ask(("may match", permit, skill), lambda: goals, ground.questions.space(skill))
        for skill in skills
    )
    return not all(isinstance(answer, No) for answer in answers)
