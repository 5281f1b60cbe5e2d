"""Rules that have no effect, because other rules always override them (E0721) or cover them (E0722).

- A permit is overridden if, wherever it is true, a forbid or a degrade to another skill is true or unknown.
- A permit is redundant if, wherever it is true, another permit is true.
- A forbid is redundant if, wherever it is true, another forbid is true, and wherever it is unknown, another is true or
  unknown.
- A degrade is redundant if an earlier degrade to the same target covers it in the same way. A later degrade covers it
  too, unless a degrade to another target comes between the two.
- A confirm is redundant if another confirm awaits the same roles wherever it does, and no longer.

Of rules that make each other redundant, the last one is reported. A `use` or `delegate` is redundant if each of its
rules is. One rule of a template may be: a template may repeat a `forbid` each time it is used.
"""

from collections.abc import Iterator
from collections.abc import Set as AbstractSet

from rtshcua.decision.values import FALSE, TRUE, UNKNOWN, Truth
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.removal import whole_line
from rtshcua.diagnostics.span import Span
from rtshcua.ground.analysis.extent import FAR
from rtshcua.ground.analysis.solve import Undecided
from rtshcua.ground.prove.rule_index import RuleQuery
from rtshcua.ground.prove.ruleset import Ruleset, WrittenRule
from rtshcua.model.flat.policy import RuleKind
from rtshcua.model.ir.node import Node
from rtshcua.model.ir.policies import Use


def covering_rule(rules: Ruleset, group: WrittenRule, but: AbstractSet[int]) -> Span | None:
    """Return the span of one rule that covers a whole group, ignoring the flat rules `but`; None if there is none."""
    looked_at: set[int] = set()
    for candidate in _covering_candidates(rules, group, but):
        at = rules.group_of(candidate)
        if at in looked_at:
            continue
        looked_at.add(at)
        other = rules.groups[at]
        other = other._replace(rules=tuple(each for each in other.rules if each not in but))
        if all(
            any(_covers_rule(rules, number, each, skill) for each in other.rules)
            for number in group.rules
            for skill in rules.skills_decided(number)
        ):
            return other.span
    return None


def _covering_candidates(rules: Ruleset, group: WrittenRule, but: AbstractSet[int]) -> Iterator[int]:
    """Yield in order the flat rules that may cover a group. The caller proves each."""
    pair = next(((number, skill) for number in group.rules for skill in rules.skills_decided(number)), None)
    kind = RuleKind(group.kind)
    if pair is None:
        return (each for each, rule in enumerate(rules.policy.rules) if rule.kind == kind and each not in but)
    number, skill = pair
    rule, effect = rules.rule(number), rules.effect(number)
    within_us = rule.within_us if kind is RuleKind.CONFIRM else FAR
    query = RuleQuery(skill, rule.roles, rule.sources, (effect, effect), within_us)
    return rules.candidates(kind, number, [query], but, sure=kind is RuleKind.DEGRADE)


def _covers_rule(rules: Ruleset, number: int, candidate: int, skill: int) -> bool:
    """Whether a candidate has, for a skill, every effect of a rule."""
    rule = rules.rule(number)
    if not rules.wider(candidate, number, skill) or rules.effect(candidate) != rules.effect(number):
        return False
    if rule.kind == RuleKind.CONFIRM:
        longer = rule.within_us >= rules.rule(candidate).within_us
        return longer and rules.never([(number, TRUE | UNKNOWN), (candidate, FALSE)], skill)
    if candidate > number and rules.other_effect_after(number) < candidate:
        return False
    return rules.never([(number, TRUE), (candidate, FALSE | UNKNOWN)], skill) and rules.never(
        [(number, UNKNOWN), (candidate, FALSE)], skill
    )


def report_redundant(rules: Ruleset, alive: list[WrittenRule]) -> set[int]:
    """Report overridden permits, and then redundant rules. Returns the numbers of the reported flat rules."""
    gone: set[int] = set()
    for group in alive:
        if group.kind == RuleKind.PERMIT and _shadowed(rules, group):
            gone.update(group.rules)
            rules.drop(group.rules)
    for group in reversed(alive):
        if not gone.intersection(group.rules):
            gone.update(group.rules)
            covered_by = _covering(rules, group, gone)
            if covered_by is None:
                gone.difference_update(group.rules)
            else:
                rules.drop(group.rules)
                _report_rule(rules, group, covered_by)
    return gone


def _shadowed(rules: Ruleset, group: WrittenRule) -> bool:
    overriding = None
    for kind in (RuleKind.FORBID, RuleKind.DEGRADE):
        word = kind.name.lower()
        question = f"is always overridden by a `{word}`"
        overriding = _covered(rules, group, kind, frozenset(), ((TRUE, FALSE),), question)
        if overriding is not None:
            break
    if overriding is None:
        return False
    rules.proof.report.add(
        codes.SHADOWED_RULE,
        group.span,
        f"this `permit` never decides: wherever it matches, a `{word}` matches too, or is unknown",
        help=f"narrow the `{word}`, or delete this rule",
        labels=[(span, "this overrides it") for span in overriding],
    )
    return True


def _covering(
    rules: Ruleset, group: WrittenRule, gone: AbstractSet[int], *, quiet: bool = False
) -> tuple[Span, ...] | None:
    """Return the spans of the rules that together cover a group, or None. Reports an undecided question unless `quiet`.

    `gone` are the flat rules of the group itself and those of rules that are already reported.
    """
    kind = RuleKind(group.kind)
    if kind not in (RuleKind.PERMIT, RuleKind.FORBID):
        one = covering_rule(rules, group, gone)
        return None if one is None else (one,)
    questions: tuple[tuple[Truth, Truth], ...] = ((TRUE, FALSE | UNKNOWN),)
    if kind is RuleKind.FORBID:
        questions = (*questions, (UNKNOWN, FALSE))
    return _covered(rules, group, kind, gone, questions, None if quiet else "is redundant")


def _covered(
    rules: Ruleset,
    group: WrittenRule,
    kind: RuleKind,
    but: AbstractSet[int],
    questions: tuple[tuple[Truth, Truth], ...],
    question: str | None,
) -> tuple[Span, ...] | None:
    """Return the spans of the rules of a kind that together leave a group without effect, or None.

    Each of `questions` is a truth value of the group's condition, and the truth values of another rule with which that
    rule does not cover it. An undecided question is reported with the text `question`, if there is one.
    """
    found: dict[Span, None] = {}
    undecided: str | None = None
    for number in group.rules:
        for key in rules.keys(number):
            for wanted, escape in questions:
                by = rules.covered(number, wanted, kind, but, escape, key)
                if isinstance(by, Undecided):
                    undecided = by.why
                elif by is None or _clock_matters(rules, number, by):
                    return None
                else:
                    found.update(dict.fromkeys(rules.proof.span(rules.rule(each)) for each in by))
    if undecided is not None:
        if question is not None:
            rules.undecided(group, question, undecided)
        return None
    return tuple(found)


def _clock_matters(rules: Ruleset, number: int, used: tuple[int, ...]) -> bool:
    """Whether several rules together cover the times of one. With an inexact clock, a gap between them is possible."""
    return len(used) > 1 and rules.timed(number)


def _report_rule(rules: Ruleset, group: WrittenRule, covered_by: tuple[Span, ...]) -> None:
    kind = group.declared.kind
    report = rules.proof.report
    copies = [span for span in covered_by if _identical(rules, group, rules.at[span])]
    help = "delete it, or change it"
    if len(covered_by) == 1 and not copies:
        much = "permits too much" if kind == "permit" else "is too wide"
        help = f"check `{report.text(covered_by[0])}` first: if it {much}, narrow it; otherwise delete this rule"
    source = report.sources.get(group.span.file)
    gone = group.span if source is None else whole_line(source.text, group.span)
    others, label = "other rules cover it", "this covers a part of it"
    if len(covered_by) == 1:
        others, label = "another rule covers it", "this covers it"
    report.add(
        codes.REDUNDANT_RULE,
        group.span,
        f"this `{kind}` is redundant: {others}",
        help=help,
        labels=[(span, label) for span in covered_by],
        fix=(gone, "", "delete this rule") if copies else None,
    )


def _identical(rules: Ruleset, one: WrittenRule, other: WrittenRule) -> bool:
    """Whether two rules have the same skills, roles, sources, conditions and effect.

    Only then does a fix delete one of them: otherwise the wider rule may be the mistake.
    """
    return _content(rules, one) == _content(rules, other)


def _content(rules: Ruleset, group: WrittenRule) -> set[tuple[object, ...]]:
    every = ((rules.code(number), rules.rule(number)) for number in group.rules)
    return {
        (
            code,
            each.skills,
            each.roles,
            each.sources,
            each.approver,
            each.second,
            each.within_us,
            each.target and each.target.text,
        )
        for code, each in every
    }


def report_bundles(rules: Ruleset, alive: list[WrittenRule], gone: AbstractSet[int]) -> None:
    """Report each redundant `use` and `delegate`, the last one first. `gone` are the rules already reported."""
    living = {number for group in alive for number in group.rules}
    alone = {frozenset(group.rules) for group in rules.groups}
    left_out = set(gone)
    for node, numbers in reversed(_bundles(rules)):
        # a bundle with the rules of one written rule is already proved as that rule
        if not living.issuperset(numbers) or not left_out.isdisjoint(numbers) or frozenset(numbers) in alone:
            continue
        left_out.update(numbers)
        found = _bundle_covered(rules, numbers, left_out)
        if not found:
            left_out.difference_update(numbers)
            continue  # not covered, or empty, which is reported elsewhere
        rules.drop(numbers)
        word = "use" if isinstance(node, Use) else "delegate"
        rules.proof.report.add(
            codes.REDUNDANT_RULE,
            node.span,
            f"this `{word}` is redundant: other rules cover it",
            help="delete it, or change it",
            labels=[(span, "this covers it") for span in found],
        )


def _bundles(rules: Ruleset) -> list[tuple[Node, list[int]]]:
    """Return the flat rules that each `use` and `delegate` of the policy created, in order of position."""
    found: dict[Node, list[int]] = {}
    for number, declared in enumerate(rules.proof.lowered.rules):
        for node in declared.origin:
            found.setdefault(node, []).append(number)
    return sorted(found.items(), key=lambda each: each[0].span.start)


def _bundle_covered(rules: Ruleset, numbers: list[int], but: set[int]) -> tuple[Span, ...] | None:
    """Return the spans of the rules that cover each of some flat rules, or None."""
    places: dict[Span, None] = {}
    for number in numbers:
        declared = rules.proof.lowered.rules[number]
        group = WrittenRule(declared, declared.span, RuleKind(rules.rule(number).kind), (number,))
        spans = _covering(rules, group, but, quiet=True)
        if spans is None:
            return None
        places.update(dict.fromkeys(spans))
    return tuple(places)
