"""Degrade rules that an earlier one always precedes (E0721, E0723).

The first `degrade` that matches and whose target can fly decides. A narrower rule after a wider one is a mistake: where
it matches, the wider one decides. Two rules with the same condition are a mistake too: they require different skills at
once, and a fallback for a target that cannot fly belongs in a chain. If the target of the earlier rule can always fly,
the later rule never decides (E0721). Rules that only overlap are not reported: their order states a priority.
"""

from collections.abc import Iterator
from collections.abc import Set as AbstractSet

from rtshcua.decision.values import FALSE, TRUE, UNKNOWN
from rtshcua.diagnostics import codes
from rtshcua.ground.analysis.extent import FAR
from rtshcua.ground.analysis.solve import Yes
from rtshcua.ground.analysis.witness import witness_text
from rtshcua.ground.prove.rule_index import RuleQuery
from rtshcua.ground.prove.ruleset import Ruleset, WrittenRule
from rtshcua.model.flat.policy import RuleKind


def report_overridden(rules: Ruleset, alive: list[WrittenRule]) -> None:
    """Report each degrade rule after one with another target and a wider or the same condition."""
    degrades = [group for group in alive if group.kind == RuleKind.DEGRADE]
    place = {rules.group_of(group.rules[0]): at for at, group in enumerate(degrades)}
    flown = {rules.flown(number) for group in degrades for number in group.rules}
    last = -1  # the last flat rule of the groups before
    for at, later in enumerate(degrades):
        looked_at: set[int] = set()
        for candidate in _candidates(rules, later, flown):
            if candidate > last:
                break
            earlier = place.get(rules.group_of(candidate), at)
            if earlier < at and earlier not in looked_at:
                looked_at.add(earlier)
                if _after_wider(rules, degrades[earlier], later):
                    break
        last = max(last, *later.rules)


def _candidates(rules: Ruleset, later: WrittenRule, flown: AbstractSet[int | None]) -> Iterator[int]:
    """Yield in order the rules to another target that may match wherever `later` does. The caller proves each."""
    pairs = [(number, skill) for number in later.rules for skill in rules.skills_decided(number)]
    # a degrade to a skill does not decide about that skill, so prefer a skill that is no target
    number, skill = next((pair for pair in pairs if pair[1] not in flown), pairs[0] if pairs else (-1, -1))
    if number < 0:
        return iter(())  # it applies only to its own target
    if skill in flown:
        return (each for each, rule in enumerate(rules.policy.rules) if rule.kind == RuleKind.DEGRADE)
    rule, effect = rules.rule(number), rules.effect(number)
    queries = [
        RuleQuery(skill, rule.roles, rule.sources, effects) for effects in ((-FAR, effect - 1), (effect + 1, FAR))
    ]
    return rules.candidates(RuleKind.DEGRADE, number, queries, frozenset(), sure=True)


def _after_wider(rules: Ruleset, earlier: WrittenRule, later: WrittenRule) -> bool:
    """Whether the earlier rule matches wherever the later one does. Reports it."""
    witness: tuple[Yes, int] | None = None
    narrower = False
    target = rules.rule(earlier.rules[0]).target
    assert target is not None
    always = not rules.policy.contracts[target.skill].require
    for number in later.rules:
        for skill in rules.skills_decided(number):
            if any(rules.flown(candidate) == skill for candidate in earlier.rules):
                always = False
                continue
            before = _before(rules, earlier, number, skill)
            if before is None:
                return False
            narrower = narrower or isinstance(rules.ask([(before, TRUE), (number, FALSE | UNKNOWN)], skill), Yes)
            both = rules.ask([(number, TRUE)], skill)
            if witness is None and isinstance(both, Yes):
                witness = both, skill
    if witness is None:
        return False
    policy = rules.policy
    name = policy.contracts[target.skill].name
    situation = witness_text(witness[0].witness, policy, policy.contracts[witness[1]])
    rules.proof.report.add(
        codes.SHADOWED_RULE if always else codes.CONFLICTING_RULES,
        later.span,
        "this `degrade` never decides: wherever it matches, an earlier `degrade` decides"
        if always
        else f"at {situation} an earlier `degrade` matches too, and decides",
        help=("write the narrower rule first" if narrower else "delete one of them, or separate their conditions")
        + (f"; at {situation} `{name}` flies" if always else f"; now `{name}` flies there, if it can"),
        labels=[(earlier.span, "this comes first")],
    )
    return True


def _before(rules: Ruleset, earlier: WrittenRule, number: int, skill: int) -> int | None:
    """Return the flat rule of `earlier` to another target that matches wherever a rule does, for a skill; else None."""
    matching = rules.ask([(number, TRUE)], skill)
    for candidate in earlier.rules:
        if rules.effect(candidate) == rules.effect(number) or not rules.wider(candidate, number, skill):
            continue
        if isinstance(matching, Yes) and rules.holds(candidate, matching.witness.at) != TRUE:
            continue
        if rules.never([(number, TRUE), (candidate, FALSE | UNKNOWN)], skill):
            return candidate
    return None
