"""E0720: rules whose condition can never hold, whatever is asked for, by whom, and in what state; E1102: a confirm
whose condition never fails.

A forbid and a confirm rule act too where their condition is unknown: they may then defer a step, but never do what they
say, so they are reported too.
"""

from collections.abc import Iterator

from rtshcua.decision import tree
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN, Truth
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.analysis.solve import No, Undecided, Yes, satisfiable
from rtshcua.ground.checker.conditions import references
from rtshcua.ground.prove.conjuncts import conjuncts
from rtshcua.ground.prove.minimal import minimal
from rtshcua.ground.prove.ruleset import Group, Ruleset
from rtshcua.model.flat.policy import RuleKind
from rtshcua.model.ir.expression import Condition


def dead(rules: Ruleset, group: Group) -> bool:
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
    rules.ground.context.report.add(
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
        labels=[*others, *_ranges(rules, group, conflict)],
    )
    return True


def always(rules: Ruleset, group: Group) -> None:
    """Report a condition that makes no difference to who confirms; of what forbids or degrades always, E0721 tells."""
    when = group.declared.when
    if group.kind != RuleKind.CONFIRM or when is None:
        return
    for number in group.rules:
        for skill in rules.skills(number):
            if rules.exhausted or not isinstance(rules.ask([(number, FALSE)], skill), No):
                return
    rules.ground.context.report.add(
        codes.ALWAYS_HOLDS,
        when.span,
        "this cannot be false, so every step that the rule is about is confirmed",
        help="leave the condition out, or say what was meant",
    )


def _defers(rules: Ruleset, group: Group) -> bool:
    """Whether a rule whose condition is never true may still defer, for it may be unknown."""
    return group.kind in (RuleKind.FORBID, RuleKind.CONFIRM) and any(
        not isinstance(rules.ask([(number, UNKNOWN)], skill), No)
        for number in group.rules
        for skill in rules.skills(number)
    )


def _ranges(rules: Ruleset, group: Group, conflict: list[Condition]) -> Iterator[tuple[Span, str]]:
    """Where the ranges of the arguments are declared that a conflict reads."""
    names = dict.fromkeys(each.name for condition in conflict for each in references(condition))
    context = rules.ground.context
    for name in names:
        for skill in group.declared.skills:
            argument = context.arguments(context.symbols.skills[skill.text]).get(name)
            if argument is not None and argument.declaration.range is not None:
                yield argument.declaration.span, f"`{name}` is in this range"


def _conflict(rules: Ruleset, group: Group, wanted: Truth) -> list[Condition]:
    """The conjuncts that rule each other out, for all that the rule speaks of."""
    when = group.declared.when
    assert when is not None
    split = [list(conjuncts(when, rules.node(number))) for number in group.rules]
    count = len(split[0])
    if any(len(each) != count for each in split):
        return [when]

    def impossible(positions: list[int]) -> bool:
        for number, parts in zip(group.rules, split, strict=True):
            node = _joined([parts[at][1] for at in positions])
            for skill in rules.skills(number):
                if not isinstance(satisfiable([(node, wanted)], rules.space(skill)), No):
                    return False
        return True

    return [split[0][at][0] for at in minimal(range(count), impossible)]


def _joined(nodes: list[tree.Node]) -> tree.Node:
    joined = nodes[0]
    for node in nodes[1:]:
        joined = tree.Both(joined, node)
    return joined
