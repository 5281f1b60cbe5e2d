"""E0722: a `use` or `delegate` of whose rules others leave nothing.

The rules of one are looked at together: a template may well repeat a `forbid` each time it is used. So it is only
reported where every one of its rules says nothing that the rules from elsewhere do not say.
"""

from collections.abc import Set as AbstractSet

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.prove.nested import covering
from rtshcua.ground.prove.redundant import said
from rtshcua.ground.prove.ruleset import Group, Ruleset
from rtshcua.model.flat.policy import RuleKind
from rtshcua.model.ir.node import Node
from rtshcua.model.ir.policies import Use


def prove(rules: Ruleset, alive: list[Group], gone: AbstractSet[int]) -> None:
    """Report each that is redundant, the last one first; `gone` are the rules that were reported themselves."""
    living = {number for group in alive for number in group.rules}
    alone = {frozenset(group.rules) for group in rules.groups}
    left_out = set(gone)
    for node, numbers in reversed(_bundles(rules)):
        # what all comes from one rule of the source was already asked about as that
        if not living.issuperset(numbers) or not left_out.isdisjoint(numbers) or frozenset(numbers) in alone:
            continue
        left_out.update(numbers)
        found = _covered(rules, numbers, left_out)
        if not found:
            left_out.difference_update(numbers)
            continue  # nothing else says it, or there is nothing in it, which is reported as that
        rules.drop(numbers)
        word = "use" if isinstance(node, Use) else "delegate"
        rules.ground.context.report.add(
            codes.REDUNDANT_RULE,
            node.span,
            f"this `{word}` says nothing that other rules do not say",
            help="delete it, or change what it is about",
            labels=[(span, "this says it already") for span in found],
        )


def _bundles(rules: Ruleset) -> list[tuple[Node, list[int]]]:
    """The rules that each `use` and `delegate` of the policy brought about, in their order."""
    found: dict[Node, list[int]] = {}
    for number, declared in enumerate(rules.ground.lowered.rules):
        for node in declared.origin:
            found.setdefault(node, []).append(number)
    return sorted(found.items(), key=lambda each: each[0].span.start)


def _covered(rules: Ruleset, numbers: list[int], but: set[int]) -> tuple[Span, ...] | None:
    """Where the rules are written that say all of some rules; None where they leave something."""
    places: dict[Span, None] = {}
    for number in numbers:
        kind = RuleKind(rules.rule(number).kind)
        declared = rules.ground.lowered.rules[number]
        group = Group(declared, declared.span, kind, (number,))
        if kind in (RuleKind.PERMIT, RuleKind.FORBID):
            spans = said(rules, group, but, quiet=True)
        else:
            one = covering(rules, group, but)
            spans = None if one is None else (one,)
        if spans is None:
            return None
        places.update(dict.fromkeys(spans))
    return tuple(places)
