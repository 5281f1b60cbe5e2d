"""E0722: a `degrade` or `confirm` that another of the same target, or by the same role, says already.

A later degrade rule to the same target is never the one that decides where an earlier one is true wherever it is, and
not false wherever it is unknown; an earlier one is not either, if nothing that flies elsewhere stands between the two.
A confirm rule asks for nothing further where another awaits the same role wherever it does, and no longer.
"""

from collections.abc import Iterable

from rtshcua.decision.values import FALSE, TRUE, UNKNOWN
from rtshcua.diagnostics.span import Span
from rtshcua.ground.analysis.solve import No
from rtshcua.ground.compiler.proofs.conflicting import covers, same
from rtshcua.ground.compiler.proofs.ruleset import Group, Ruleset
from rtshcua.model.flat.contract import Link
from rtshcua.model.flat.policy import Rule, RuleKind


def covering(rules: Ruleset, group: Group, others: Iterable[Group]) -> Span | None:
    """Where a rule is written that alone says all that a rule says; None where none does."""
    for other in others:
        if other.kind == group.kind and all(_one(rules, number, other) for number in group.rules):
            return other.span
    return None


def _one(rules: Ruleset, number: int, other: Group) -> bool:
    target = rules.rule(number).target
    skills = [skill for skill in rules.skills(number) if target is None or skill != target.skill]
    return all(any(_says(rules, number, candidate, skill) for candidate in other.rules) for skill in skills)


def _says(rules: Ruleset, number: int, candidate: int, skill: int) -> bool:
    """Whether a rule, for a skill, does nothing that a candidate does not do."""
    rule, wider = rules.rule(number), rules.rule(candidate)
    if skill not in rules.skills(candidate):
        return False
    if not covers(wider.roles, rule.roles) or not covers(wider.sources, rule.sources):
        return False
    if rule.kind == RuleKind.CONFIRM:
        if (rule.approver, rule.second) != (wider.approver, wider.second) or rule.within_us < wider.within_us:
            return False
        return isinstance(rules.ask([(number, TRUE | UNKNOWN), (candidate, FALSE)], skill), No)
    if not _alike(rule, wider) or (candidate > number and _between(rules, number, candidate)):
        return False
    return isinstance(rules.ask([(number, TRUE), (candidate, FALSE | UNKNOWN)], skill), No) and isinstance(
        rules.ask([(number, UNKNOWN), (candidate, FALSE)], skill), No
    )


def _alike(one: Rule, other: Rule) -> bool:
    return isinstance(one.target, Link) and isinstance(other.target, Link) and same(one.target, other.target)


def _between(rules: Ruleset, first: int, last: int) -> bool:
    """Whether a degrade rule to another target stands between two."""
    own = rules.rule(first)
    return any(
        rules.rule(number).kind == RuleKind.DEGRADE and not _alike(own, rules.rule(number))
        for number in range(first + 1, last)
    )
