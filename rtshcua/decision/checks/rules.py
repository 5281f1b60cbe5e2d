"""Rules and the airspace."""

from collections.abc import Iterator

from rtshcua.decision.checks.contracts import clause, link
from rtshcua.decision.checks.indexes import ascending, at, index, within
from rtshcua.decision.scope import Scope
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.limits import MAX_DURATION, MAX_RULE_KEYS, MAX_RULES
from rtshcua.model.flat.policy import Airspace, Policy, Rule, RuleKind


def rules(policy: Policy, scope: Scope) -> Iterator[str]:
    """What is wrong with a policy's rules; its contracts are well-formed."""
    yield from within("number of rules", len(policy.rules), 0, MAX_RULES)
    keys = sum((len(rule.skills) or 1) * (len(rule.roles) or 1) for rule in policy.rules)
    yield from within("number of skills times roles in the rules", keys, 0, MAX_RULE_KEYS)
    for number, one in enumerate(policy.rules):
        yield from at(f"rule {number}", rule(one, policy, scope))


def rule(rule: Rule, policy: Policy, scope: Scope) -> Iterator[str]:
    """What is wrong with a rule."""
    yield from within("kind", rule.kind, RuleKind.FORBID, RuleKind.DEGRADE)
    yield from ascending("skill", rule.skills, len(policy.contracts))
    yield from ascending("role", rule.roles, len(policy.roles))
    yield from ascending("source", rule.sources, len(SourceKind))
    if rule.when is not None:
        yield from at("when", clause(rule.when, scope.about(*(policy.contracts[skill] for skill in rule.skills))))
    if rule.kind == RuleKind.CONFIRM:
        yield from index("role", rule.approver, len(policy.roles))
        yield from within("within", rule.within_us, 1, MAX_DURATION)
    if rule.kind == RuleKind.DEGRADE:
        if rule.target is None:
            yield "degrade has no target"
        else:
            yield from at("target", link(rule.target, policy))


def airspace(airspace: Airspace | None, policy: Policy) -> Iterator[str]:
    """What is wrong with the airspace."""
    if airspace is not None:
        for zone in (*airspace.inside, *airspace.outside):
            yield from index("zone", zone, len(policy.zones))
