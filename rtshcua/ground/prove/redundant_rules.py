"""E0721, E0722: rules that decide nothing, because others always outweigh them or always say the same.

A permit never decides where, wherever it is true, some forbid or some degrade to another skill is true or unknown. A
permit is redundant where some other permit is true wherever it is; a forbid, where some other forbid is, and where
wherever it is unknown another is true or unknown. A later degrade rule to the same target never decides where an
earlier one is true wherever it is, and not false wherever it is unknown; an earlier one neither, if no degrade to
another target stands between the two. A confirm rule is redundant where another awaits the same role wherever it does,
and no longer. Of rules that make each other redundant the last one is reported.

A `use` or `delegate` is redundant where each of its rules says nothing that the rules from elsewhere do not say: a
template may repeat a `forbid` each time it is used.
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
    """Where a rule is written that alone says all that a rule says, without some numbers; None where none does."""
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
    """The rules, in order, that may say all that a rule says; each is to be asked about."""
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
    """Whether a rule, for a skill, does nothing that a candidate does not do."""
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
    """Report the permits that forbids outweigh, and then the rules that others make redundant; their numbers."""
    gone: set[int] = set()
    for group in alive:
        if group.kind == RuleKind.PERMIT and _shadowed(rules, group):
            gone.update(group.rules)
            rules.drop(group.rules)
    for group in reversed(alive):
        if not gone.intersection(group.rules):
            gone.update(group.rules)
            said_by = _saying_all(rules, group, gone)
            if said_by is None:
                gone.difference_update(group.rules)
            else:
                rules.drop(group.rules)
                _report_rule(rules, group, said_by)
    return gone


def _shadowed(rules: Ruleset, group: WrittenRule) -> bool:
    outweighing = None
    for kind in (RuleKind.FORBID, RuleKind.DEGRADE):
        word = kind.name.lower()
        what = f"is ever not outweighed by a `{word}`"
        outweighing = _covered(rules, group, kind, frozenset(), ((TRUE, FALSE),), what)
        if outweighing is not None:
            break
    if outweighing is None:
        return False
    rules.proof.report.add(
        codes.SHADOWED_RULE,
        group.span,
        f"this `permit` never decides: wherever it matches, a `{word}` does too, or is unknown",
        help=f"narrow the `{word}`, or delete this rule",
        labels=[(span, "this outweighs it") for span in outweighing],
    )
    return True


def _saying_all(rules: Ruleset, group: WrittenRule, gone: AbstractSet[int]) -> tuple[Span, ...] | None:
    """Where the rules are written that say all that a rule says; `gone` has its own numbers and those of rules that
    were already reported.
    """
    if group.kind in (RuleKind.PERMIT, RuleKind.FORBID):
        return saying(rules, group, gone)
    one = covering_rule(rules, group, gone)
    return None if one is None else (one,)


def saying(
    rules: Ruleset, group: WrittenRule, gone: AbstractSet[int], *, quiet: bool = False
) -> tuple[Span, ...] | None:
    """Where the permits or forbids are written that say all that one says; nothing is noted if `quiet`."""
    kind = RuleKind(group.kind)
    questions: tuple[tuple[Truth, Truth], ...] = ((TRUE, FALSE | UNKNOWN),)
    if kind is RuleKind.FORBID:
        questions = (*questions, (UNKNOWN, FALSE))
    what = None if quiet else "says anything that others do not say"
    return _covered(rules, group, kind, gone, questions, what)


def _covered(
    rules: Ruleset,
    group: WrittenRule,
    kind: RuleKind,
    but: AbstractSet[int],
    questions: tuple[tuple[Truth, Truth], ...],
    what: str | None,
) -> tuple[Span, ...] | None:
    """Where the rules are written that together leave a rule nothing; None where they leave something.

    Each question is a truth of the rule's condition, and the truths of the others that leave it something.
    """
    found: dict[Span, None] = {}
    open_: str | None = None
    for number in group.rules:
        for key in rules.keys(number):
            for wanted, escape in questions:
                by = rules.covered(number, wanted, kind, but, escape, key)
                if isinstance(by, Undecided):
                    open_ = by.why
                elif by is None or _clock_matters(rules, number, by):
                    return None
                else:
                    found.update(dict.fromkeys(rules.proof.span(rules.rule(each)) for each in by))
    if open_ is not None:
        if what is not None:
            rules.undecided(group, what, open_)
        return None
    return tuple(found)


def _clock_matters(rules: Ruleset, number: int, used: tuple[int, ...]) -> bool:
    """Whether several rules share the times of one: with an inexact clock there is then a moment that none has."""
    return len(used) > 1 and rules.timed(number)


def _report_rule(rules: Ruleset, group: WrittenRule, said_by: tuple[Span, ...]) -> None:
    kind = group.declared.kind
    report = rules.proof.report
    copies = [span for span in said_by if _identical(rules, group, rules.at[span])]
    help = "delete it, or change what it is about"
    if len(said_by) == 1 and not copies:
        much = "permits too much" if kind == "permit" else "says too much"
        help = f"look at `{report.text(said_by[0])}` first: if it {much}, narrow it; else delete this rule"
    source = report.sources.get(group.span.file)
    gone = group.span if source is None else whole_line(source.text, group.span)
    report.add(
        codes.REDUNDANT_RULE,
        group.span,
        f"this `{kind}` says nothing that " + ("another does" if len(said_by) == 1 else "others do") + " not say",
        help=help,
        labels=[(span, "this says it already" if len(said_by) == 1 else "this says a part of it") for span in said_by],
        fix=(gone, "", "delete this rule") if copies else None,
    )


def _identical(rules: Ruleset, one: WrittenRule, other: WrittenRule) -> bool:
    """Whether one rule is written twice: for the same skills, roles and sources, under the same conditions, to the same
    effect. Where the other is wider, it may be the one that is wrong, and no fix deletes the narrow one.
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
    """Report each that is redundant, the last one first; `gone` are the rules that were reported themselves."""
    living = {number for group in alive for number in group.rules}
    alone = {frozenset(group.rules) for group in rules.groups}
    left_out = set(gone)
    for node, numbers in reversed(_bundles(rules)):
        # what all comes from one rule of the source was already asked about as that
        if not living.issuperset(numbers) or not left_out.isdisjoint(numbers) or frozenset(numbers) in alone:
            continue
        left_out.update(numbers)
        found = _bundle_covered(rules, numbers, left_out)
        if not found:
            left_out.difference_update(numbers)
            continue  # nothing else says it, or there is nothing in it, which is reported as that
        rules.drop(numbers)
        word = "use" if isinstance(node, Use) else "delegate"
        rules.proof.report.add(
            codes.REDUNDANT_RULE,
            node.span,
            f"this `{word}` says nothing that other rules do not say",
            help="delete it, or change what it is about",
            labels=[(span, "this says it already") for span in found],
        )


def _bundles(rules: Ruleset) -> list[tuple[Node, list[int]]]:
    """The rules that each `use` and `delegate` of the policy brought about, in their order."""
    found: dict[Node, list[int]] = {}
    for number, declared in enumerate(rules.proof.lowered.rules):
        for node in declared.origin:
            found.setdefault(node, []).append(number)
    return sorted(found.items(), key=lambda each: each[0].span.start)


def _bundle_covered(rules: Ruleset, numbers: list[int], but: set[int]) -> tuple[Span, ...] | None:
    """Where the rules are written that say all of some rules; None where they leave something."""
    places: dict[Span, None] = {}
    for number in numbers:
        kind = RuleKind(rules.rule(number).kind)
        declared = rules.proof.lowered.rules[number]
        group = WrittenRule(declared, declared.span, kind, (number,))
        if kind in (RuleKind.PERMIT, RuleKind.FORBID):
            spans = saying(rules, group, but, quiet=True)
        else:
            one = covering_rule(rules, group, but)
            spans = None if one is None else (one,)
        if spans is None:
            return None
        places.update(dict.fromkeys(spans))
    return tuple(places)
