"""E0721, E0723: degrade rules that another always comes before.

The first `degrade` that matches and whose target may fly is the one that flies. A narrower rule after a wider one is
not what its author means: where it matches, the wider one flies. Nor are two with one condition: they ask for different
things at once, and what follows a target that cannot fly is said by a chain. If nothing can keep the first one's target
from flying, the other never does. Rules that merely overlap are left alone: which of them comes first says what matters
more.
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
    """Report each degrade rule that comes after one to another target that is wider, or has the same condition."""
    degrades = [group for group in alive if group.kind == RuleKind.DEGRADE]
    place = {rules.group_of(group.rules[0]): at for at, group in enumerate(degrades)}
    flown = {rules.flown(number) for group in degrades for number in group.rules}
    last = -1  # of the rules of those before
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
    """The rules, in order, that may match wherever one does, and fly something else; each is to be asked about."""
    pairs = [(number, skill) for number in later.rules for skill in rules.skills_decided(number)]
    # an earlier rule that flies the very skill says nothing of it; so one is taken that none flies, if there is any
    number, skill = next((pair for pair in pairs if pair[1] not in flown), pairs[0] if pairs else (-1, -1))
    if number < 0:
        return iter(())  # it is about nothing but what it flies itself
    if skill in flown:
        return (each for each, rule in enumerate(rules.policy.rules) if rule.kind == RuleKind.DEGRADE)
    rule, effect = rules.rule(number), rules.effect(number)
    queries = [
        RuleQuery(skill, rule.roles, rule.sources, effects) for effects in ((-FAR, effect - 1), (effect + 1, FAR))
    ]
    return rules.candidates(RuleKind.DEGRADE, number, queries, frozenset(), sure=True)


def _after_wider(rules: Ruleset, earlier: WrittenRule, later: WrittenRule) -> bool:
    """Whether one rule matches wherever another does; reports it."""
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
        "this `degrade` never decides: wherever it matches, an earlier one does too"
        if always
        else f"at {situation} an earlier `degrade` matches too, and it is the one that decides",
        help=("write the narrower rule first" if narrower else "delete one of them, or tell their conditions apart")
        + (f"; at {situation} `{name}` flies" if always else f"; now `{name}` flies there, if it may"),
        labels=[(earlier.span, "this comes first")],
    )
    return True


def _before(rules: Ruleset, earlier: WrittenRule, number: int, skill: int) -> int | None:
    """The flat rule of an earlier one that matches wherever another does, for a skill, and flies something else."""
    matching = rules.ask([(number, TRUE)], skill)
    for candidate in earlier.rules:
        if rules.effect(candidate) == rules.effect(number) or not rules.wider(candidate, number, skill):
            continue
        if isinstance(matching, Yes) and rules.holds(candidate, matching.witness.at) != TRUE:
            continue
        if rules.never([(number, TRUE), (candidate, FALSE | UNKNOWN)], skill):
            return candidate
    return None
