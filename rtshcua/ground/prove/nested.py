"""E0722: a `degrade` or `confirm` that another of the same target, or by the same role, says already.

A later degrade rule to the same target is never the one that decides where an earlier one is true wherever it is, and
not false wherever it is unknown; an earlier one is not either, if nothing that flies elsewhere stands between the two.
A confirm rule asks for nothing further where another awaits the same role wherever it does, and no longer.
"""

from collections.abc import Iterator
from collections.abc import Set as AbstractSet

from rtshcua.decision.values import FALSE, TRUE, UNKNOWN, Truth
from rtshcua.diagnostics.span import Span
from rtshcua.ground.analysis.extent import FAR
from rtshcua.ground.analysis.solve import No, Yes
from rtshcua.ground.prove.conflicting import covers, same
from rtshcua.ground.prove.overlaps import About
from rtshcua.ground.prove.ruleset import Group, Ruleset
from rtshcua.model.flat.contract import Link
from rtshcua.model.flat.policy import Rule, RuleKind


def covering(rules: Ruleset, group: Group, but: AbstractSet[int]) -> Span | None:
    """Where a rule is written that alone says all that a rule says, without some numbers; None where none does."""
    looked_at: set[int] = set()
    for candidate in _candidates(rules, group, but):
        at = rules.group_of(candidate)
        if at in looked_at:
            continue
        looked_at.add(at)
        other = rules.groups[at]
        other = other._replace(rules=tuple(each for each in other.rules if each not in but))
        if all(_one(rules, number, other) for number in group.rules):
            return other.span
    return None


def _candidates(rules: Ruleset, group: Group, but: AbstractSet[int]) -> Iterator[int]:
    """The rules, in order, that may say all that a rule says; each is to be asked about."""
    pair = next(((number, skill) for number in group.rules for skill in _skills(rules, number)), None)
    if pair is None:
        yield from (each for each, rule in enumerate(rules.policy.rules) if rule.kind == group.kind and each not in but)
        return
    number, skill = pair
    rule, effect = rules.rule(number), rules.effect(number)
    sure = group.kind == RuleKind.DEGRADE
    within_us = rule.within_us if group.kind == RuleKind.CONFIRM else FAR
    about = About(skill, rule.roles, rule.sources, (effect, effect), within_us)
    points = list(rules.situations(number, skill))
    met = rules.overlaps(group.kind).meeting(about, points, sure=sure)
    while not rules.exhausted:
        candidate = next(met, None)
        if candidate is None:
            return
        if candidate in but or any(_differs(rules.holds(candidate, at), sure=sure) for at in points):
            continue
        yield candidate
        answer = rules.known([(number, TRUE if sure else TRUE | UNKNOWN), (candidate, _not(sure=sure))], skill)
        if isinstance(answer, Yes):  # nor does any other that is not there what it should be
            points.append(answer.witness.at)
            met = rules.overlaps(group.kind).meeting(about, points, sure=sure, after=candidate)


def _not(*, sure: bool) -> Truth:
    return FALSE | UNKNOWN if sure else FALSE


def _differs(truth: Truth, *, sure: bool) -> bool:
    return bool(truth & _not(sure=sure))


def _skills(rules: Ruleset, number: int) -> list[int]:
    """The skills that a rule is about; not the one that it flies itself."""
    target = rules.rule(number).target
    return [skill for skill in rules.skills(number) if target is None or skill != target.skill]


def _one(rules: Ruleset, number: int, other: Group) -> bool:
    return all(
        any(_says(rules, number, candidate, skill) for candidate in other.rules) for skill in _skills(rules, number)
    )


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
    if not _alike(rule, wider) or (candidate > number and rules.other_effect_after(number) < candidate):
        return False
    return isinstance(rules.ask([(number, TRUE), (candidate, FALSE | UNKNOWN)], skill), No) and isinstance(
        rules.ask([(number, UNKNOWN), (candidate, FALSE)], skill), No
    )


def _alike(one: Rule, other: Rule) -> bool:
    return isinstance(one.target, Link) and isinstance(other.target, Link) and same(one.target, other.target)
