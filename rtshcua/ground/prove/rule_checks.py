"""Rules and delegations that never match, and the order of all checks of rules.

A forbid or confirm rule whose condition can be unknown but never true only defers steps. It is reported too. The
condition of a delegation must be able to hold together with one of the delegated permits.
"""

from collections.abc import Iterator

from rtshcua.decision import tree
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN, Truth
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.analysis.condition_trees import conjuncts, minimal_conflict
from rtshcua.ground.analysis.solve import No, Undecided, Yes, satisfiable
from rtshcua.ground.checker.conditions import references
from rtshcua.ground.prove import overridden_degrades, redundant_rules
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.ruleset import MOST_EFFORT, Ruleset, WrittenRule
from rtshcua.model.flat.policy import Rule, RuleKind
from rtshcua.model.ir.expression import Condition
from rtshcua.model.ir.policies import Delegation

#: the number of contradicting permits that a message lists
_SHOWN_PERMITS = 3


def prove_delegations(proof: ProofContext) -> None:
    """Report every delegation that is proved to delegate nothing."""
    for delegation in proof.lowered.declaration.delegations:
        permits = _delegated(proof, delegation)
        if delegation.when is None or not permits:
            continue
        if not any(_may_match(proof, permit) for permit in permits):
            proof.report.add(
                codes.EMPTY_DELEGATION,
                delegation.when.span,
                f"`{proof.report.text(delegation.when.span)}` can never hold together with the conditions of "
                f"`{delegation.grantor.text}`'s permits, so nothing is delegated to `{delegation.grantee.text}`",
                help="correct the condition; a delegation can only narrow the permits of its grantor",
                labels=[
                    (proof.lowered.written[permit].span, "permitted by this rule")
                    for permit in permits[:_SHOWN_PERMITS]
                ],
            )


def _delegated(proof: ProofContext, delegation: Delegation) -> list[Rule]:
    """Return the permits that a delegation created."""
    return [
        flat
        for flat, rule in proof.lowered.written.items()
        if flat.kind == RuleKind.PERMIT and rule.origin and rule.origin[0] is delegation
    ]


def _may_match(proof: ProofContext, permit: Rule) -> bool:
    """Whether it is not proved that a permit never matches."""
    node = proof.prepared.compiler.when(permit)
    if node is None:
        return True
    goals = [(node, TRUE)]
    skills = permit.skills or range(len(proof.policy.contracts))
    answers = (
        proof.questions.ask(("may match", permit, skill), lambda: goals, proof.questions.space(skill))
        for skill in skills
    )
    return not all(isinstance(answer, No) for answer in answers)


def report_dead(rules: Ruleset, group: WrittenRule) -> bool:
    """Whether a rule is proved never to match. Reports it."""
    wanted: Truth = TRUE
    undecided: str | None = None
    for number in group.rules:
        for skill in rules.skills(number):
            if rules.exhausted or rules.may_match(number, skill):
                return False
            answer = rules.ask([(number, wanted)], skill)
            if isinstance(answer, Yes):
                return False
            if isinstance(answer, Undecided):
                undecided = answer.why
    if undecided is not None:
        rules.undecided(group, "can match", undecided)
        return False
    conflict = _conflict(rules, group, wanted)
    last = conflict[-1]
    others = [(each.span, "this contradicts it") for each in conflict[:-1]]
    rules.proof.report.add(
        codes.DEAD_RULE,
        last.span,
        f"this `{group.declared.kind}` can never match: "
        + ("its conditions cannot hold together" if others else "this condition cannot hold"),
        help="change the condition, or delete the rule"
        + ("; the condition can only be unknown, and then the step is deferred" if _defers(rules, group) else ""),
        labels=[*others, *_range_labels(rules, group, conflict)],
    )
    return True


def report_always(rules: Ruleset, group: WrittenRule) -> None:
    """Report the condition of a `confirm` that cannot be false. E0721 covers such a forbid or degrade."""
    when = group.declared.when
    if group.kind != RuleKind.CONFIRM or when is None:
        return
    for number in group.rules:
        for skill in rules.skills(number):
            if rules.exhausted or not rules.never([(number, FALSE)], skill):
                return
    rules.proof.report.add(
        codes.ALWAYS_HOLDS,
        when.span,
        "this condition cannot be false, so the rule requires approval for every step of its skills",
        help="remove the condition, or correct it",
    )


def _defers(rules: Ruleset, group: WrittenRule) -> bool:
    """Whether a rule whose condition is never true may still defer a step because it is unknown."""
    return group.kind in (RuleKind.FORBID, RuleKind.CONFIRM) and any(
        not rules.never([(number, UNKNOWN)], skill) for number in group.rules for skill in rules.skills(number)
    )


def _range_labels(rules: Ruleset, group: WrittenRule, conflict: list[Condition]) -> Iterator[tuple[Span, str]]:
    """Yield labels for the declared ranges of the arguments that a conflict reads."""
    names = dict.fromkeys(each.name for condition in conflict for each in references(condition))
    context = rules.proof.context
    for name in names:
        for skill in group.declared.skills:
            argument = context.arguments(context.symbols.skills[skill.text]).get(name)
            if argument is not None and argument.declaration.range is not None:
                yield argument.declaration.span, f"the range of `{name}`"


def _conflict(rules: Ruleset, group: WrittenRule, wanted: Truth) -> list[Condition]:
    """Return a minimal set of conjuncts that contradict each other for all skills of the rule."""
    when = group.declared.when
    assert when is not None
    split = [list(conjuncts(when, rules.node(number))) for number in group.rules]
    count = len(split[0])
    if any(len(each) != count for each in split):
        return [when]

    def impossible(positions: list[int]) -> bool:
        for number, parts in zip(group.rules, split, strict=True):
            node = _conjunction([parts[at][1] for at in positions])
            for skill in rules.skills(number):
                if not isinstance(satisfiable([(node, wanted)], rules.space(skill)), No):
                    return False
        return True

    return [split[0][at][0] for at in minimal_conflict(range(count), impossible)]


def _conjunction(nodes: list[tree.Node]) -> tree.Node:
    joined = nodes[0]
    for node in nodes[1:]:
        joined = tree.Both(joined, node)
    return joined


def prove_rules(proof: ProofContext) -> None:
    """Report rules without effect. A rule that never matches is reported only for that."""
    rules = Ruleset(proof)
    alive = [group for group in rules.groups if not report_dead(rules, group) and group.span not in rules.open]
    living = {number for group in alive for number in group.rules}
    rules.drop(number for group in rules.groups for number in group.rules if number not in living)
    for group in alive:
        report_always(rules, group)
    gone = redundant_rules.report_redundant(rules, alive)
    redundant_rules.report_bundles(rules, alive, gone)
    overridden_degrades.report_overridden(rules, [group for group in alive if gone.isdisjoint(group.rules)])
    if rules.exhausted:
        declared = proof.lowered.declaration
        proof.report.add(
            codes.UNDECIDED,
            declared.name.span,
            f"the rules of `{declared.name.text}` were not all compared with each other: the analysis stopped at its "
            f"limit of {MOST_EFFORT:,} steps",
            help="use fewer rules or simpler conditions; dead, shadowed, redundant or conflicting rules may be missing "
            "from this report",
        )
