"""E0715, E0720 to E0723, E1102: rules and delegations that never match, and the order of all checks of rules.

A forbid and a confirm rule act too where their condition is unknown: they may then defer a step, but never do what they
say, so they are reported too. A delegation's condition must be able to hold together with one of the permits that it
passes on.
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

#: so many permits are shown that a condition contradicts
_SHOWN_PERMITS = 3


def prove_delegations(proof: ProofContext) -> None:
    """Report every delegation of which it is proved that nothing can ever be had by it."""
    for delegation in proof.lowered.declaration.delegations:
        permits = _delegated(proof, delegation)
        if delegation.when is None or not permits:
            continue
        if not any(_may_match(proof, permit) for permit in permits):
            proof.report.add(
                codes.EMPTY_DELEGATION,
                delegation.when.span,
                f"`{proof.report.text(delegation.when.span)}` can never hold together with what "
                f"`{delegation.grantor.text}` is permitted",
                help=f"so nothing is delegated to `{delegation.grantee.text}`: a delegation narrows what its grantor "
                "has, and gives nothing beyond it",
                labels=[
                    (proof.lowered.written[permit].span, "permitted by this rule")
                    for permit in permits[:_SHOWN_PERMITS]
                ],
            )


def _delegated(proof: ProofContext, delegation: Delegation) -> list[Rule]:
    """The permits that a delegation made."""
    return [
        flat
        for flat, rule in proof.lowered.written.items()
        if flat.kind == RuleKind.PERMIT and rule.origin and rule.origin[0] is delegation
    ]


def _may_match(proof: ProofContext, permit: Rule) -> bool:
    """Whether a permit may ever match, for all that can be proved."""
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
    """Whether a rule is dead; reports it."""
    wanted: Truth = TRUE
    open_: str | None = None
    for number in group.rules:
        for skill in rules.skills(number):
            if rules.exhausted or rules.may_match(number, skill):
                return False
            answer = rules.ask([(number, wanted)], skill)
            if isinstance(answer, Yes):
                return False
            if isinstance(answer, Undecided):
                open_ = answer.why
    if open_ is not None:
        rules.undecided(group, "can match", open_)
        return False
    conflict = _conflict(rules, group, wanted)
    last = conflict[-1]
    others = [(each.span, "this does not go together with it") for each in conflict[:-1]]
    rules.proof.report.add(
        codes.DEAD_RULE,
        last.span,
        f"this `{group.declared.kind}` can never match: "
        + ("what it asks for cannot all hold at once" if others else "this cannot hold"),
        help="change the condition, or delete the rule"
        + (
            f"; it can only be unknown, and then it defers what it is to {group.declared.kind}"
            if _defers(rules, group)
            else ""
        ),
        labels=[*others, *_range_labels(rules, group, conflict)],
    )
    return True


def report_always(rules: Ruleset, group: WrittenRule) -> None:
    """Report a condition that makes no difference to who confirms; of what forbids or degrades always, E0721 tells."""
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
        "this cannot be false, so every step that the rule is about is confirmed",
        help="leave the condition out, or say what was meant",
    )


def _defers(rules: Ruleset, group: WrittenRule) -> bool:
    """Whether a rule whose condition is never true may still defer, for it may be unknown."""
    return group.kind in (RuleKind.FORBID, RuleKind.CONFIRM) and any(
        not rules.never([(number, UNKNOWN)], skill) for number in group.rules for skill in rules.skills(number)
    )


def _range_labels(rules: Ruleset, group: WrittenRule, conflict: list[Condition]) -> Iterator[tuple[Span, str]]:
    """Where the ranges of the arguments are declared that a conflict reads."""
    names = dict.fromkeys(each.name for condition in conflict for each in references(condition))
    context = rules.proof.context
    for name in names:
        for skill in group.declared.skills:
            argument = context.arguments(context.symbols.skills[skill.text]).get(name)
            if argument is not None and argument.declaration.range is not None:
                yield argument.declaration.span, f"`{name}` is in this range"


def _conflict(rules: Ruleset, group: WrittenRule, wanted: Truth) -> list[Condition]:
    """The conjuncts that rule each other out, for all that the rule speaks of."""
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
    """Report what no rule should be; a dead rule is reported as that alone."""
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
            f"the rules of `{declared.name.text}` were not all compared with each other: "
            f"after {MOST_EFFORT:,} steps that is given up",
            help="rules that are dead, shadowed, redundant or in conflict may not have been reported; "
            "fewer rules, or simpler conditions, would do",
        )
