"""E0721, E0722: rules that decide nothing, for others always outweigh them or always say the same.

A permit never decides where, wherever it is true, some forbid or some degrade to another skill is true or unknown: then
no step is flown by it. A permit says nothing further where some other permit is true wherever it is; a forbid, where
some other forbid is, and where wherever it is unknown another is true or unknown; the other kinds have words of their
own (`nested`). Of rules that make each other redundant the last one is reported.
"""

from collections.abc import Set as AbstractSet

from rtshcua.decision.values import FALSE, TRUE, UNKNOWN, Truth
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.removal import whole_line
from rtshcua.diagnostics.span import Span
from rtshcua.ground.analysis.solve import Undecided
from rtshcua.ground.prove.nested import covering
from rtshcua.ground.prove.ruleset import Group, Ruleset
from rtshcua.model.flat.policy import RuleKind


def prove(rules: Ruleset, alive: list[Group]) -> set[int]:
    """Report the permits that forbids outweigh, and then the rules that others make redundant; their numbers."""
    gone: set[int] = set()
    for group in alive:
        if group.kind == RuleKind.PERMIT and _shadowed(rules, group):
            gone.update(group.rules)
            rules.drop(group.rules)
    for group in reversed(alive):
        if not gone.intersection(group.rules):
            gone.update(group.rules)
            said_by = _redundant(rules, group, gone)
            if said_by is None:
                gone.difference_update(group.rules)
            else:
                rules.drop(group.rules)
                _report(rules, group, said_by)
    return gone


def _shadowed(rules: Ruleset, group: Group) -> bool:
    outweighing = None
    for kind in (RuleKind.FORBID, RuleKind.DEGRADE):
        word = kind.name.lower()
        what = f"is ever not outweighed by a `{word}`"
        outweighing = _covered(rules, group, kind, frozenset(), ((TRUE, FALSE),), what)
        if outweighing is not None:
            break
    if outweighing is None:
        return False
    rules.ground.context.report.add(
        codes.SHADOWED_RULE,
        group.span,
        f"this `permit` never decides: wherever it matches, a `{word}` does too, or is unknown",
        help=f"narrow the `{word}`, or delete this rule",
        labels=[(span, "this outweighs it") for span in outweighing],
    )
    return True


def _redundant(rules: Ruleset, group: Group, gone: AbstractSet[int]) -> tuple[Span, ...] | None:
    """Where the rules are written that say all that a rule says; `gone` has its own numbers and those of rules that
    were already reported.
    """
    if group.kind in (RuleKind.PERMIT, RuleKind.FORBID):
        return said(rules, group, gone)
    one = covering(rules, group, gone)
    return None if one is None else (one,)


def said(rules: Ruleset, group: Group, gone: AbstractSet[int], *, quiet: bool = False) -> tuple[Span, ...] | None:
    """Where the permits or forbids are written that say all that one says; nothing is noted if `quiet`."""
    kind = RuleKind(group.kind)
    questions: tuple[tuple[Truth, Truth], ...] = ((TRUE, FALSE | UNKNOWN),)
    if kind is RuleKind.FORBID:
        questions = (*questions, (UNKNOWN, FALSE))
    what = None if quiet else "says anything that others do not say"
    return _covered(rules, group, kind, gone, questions, what)


def _covered(
    rules: Ruleset,
    group: Group,
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
                    found.update(dict.fromkeys(rules.ground.span(rules.rule(each)) for each in by))
    if open_ is not None:
        if what is not None:
            rules.undecided(group, what, open_)
        return None
    return tuple(found)


def _clock_matters(rules: Ruleset, number: int, used: tuple[int, ...]) -> bool:
    """Whether several rules share the times of one: with an inexact clock there is then a moment that none has."""
    return len(used) > 1 and rules.timed(number)


def _report(rules: Ruleset, group: Group, said_by: tuple[Span, ...]) -> None:
    kind = group.declared.kind
    report = rules.ground.context.report
    copies = [span for span in said_by if _same(rules, group, rules.at[span])]
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


def _same(rules: Ruleset, one: Group, other: Group) -> bool:
    """Whether one rule is written twice: for the same skills, roles and sources, under the same conditions, to the same
    effect. Where the other is wider, it may be the one that is wrong, and no fix deletes the narrow one.
    """
    return _said(rules, one) == _said(rules, other)


def _said(rules: Ruleset, group: Group) -> set[tuple[object, ...]]:
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
