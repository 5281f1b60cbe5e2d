"""What a policy may permit to an agent, as far as it can be told without flying: skills, roles, zones, ranges.

It may say too much, never too little: what it leaves out is never permitted. The compiler stays the authority.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from rtshcua.ground.lower.policy import LoweredPolicy
from rtshcua.model.flat.contract import CHOICE, PLACE, QUANTITY, ZONE, Contract, Parameter, SourceKind
from rtshcua.model.flat.policy import Rule, RuleKind
from rtshcua.model.ir.expression import Comparison, Condition, Inside, Junction, Quantity, Reference, Value, Within

AGENT = int(SourceKind.AGENT)
_MIRRORED = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}


@dataclass(frozen=True, slots=True)
class Allowed:
    """A parameter, and what of it may be permitted: the ends of a range, the names of zones, or choices."""

    parameter: Parameter
    low: int = 0
    high: int = 0
    names: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Permitted:
    """A skill that an agent may ask for, in one of these roles."""

    contract: Contract
    roles: tuple[str, ...]
    allowed: tuple[Allowed, ...]


def permitted(lowered: LoweredPolicy, entries: Sequence[str]) -> tuple[Permitted, ...]:
    """The skills that some permit names for an agent, and that nothing forbids it always; `entries` are the places
    that have a name.
    """
    policy = lowered.policy
    found = []
    for number, contract in enumerate(policy.contracts):
        rules = [rule for rule in policy.rules if _about(rule, number)]
        permits = [rule for rule in rules if rule.kind == RuleKind.PERMIT]
        if not permits or any(_always(rule) for rule in rules):
            continue
        roles = {policy.roles[role] for rule in permits for role in rule.roles or range(len(policy.roles))}
        conditions = [lowered.written[rule].when for rule in permits]
        allowed = tuple(_allowed(lowered, parameter, conditions, entries) for parameter in contract.parameters)
        found.append(Permitted(contract, tuple(sorted(roles)), allowed))
    return tuple(found)


def _about(rule: Rule, skill: int) -> bool:
    return (not rule.skills or skill in rule.skills) and (not rule.sources or AGENT in rule.sources)


def _always(rule: Rule) -> bool:
    return rule.kind == RuleKind.FORBID and rule.when is None and not rule.roles


def _allowed(
    lowered: LoweredPolicy, parameter: Parameter, conditions: Sequence[Condition | None], entries: Sequence[str]
) -> Allowed:
    """What any of the permits leaves of a parameter."""
    policy = lowered.policy
    match parameter.kind:
        case kind if kind == CHOICE:
            return Allowed(parameter, names=parameter.labels[parameter.low : parameter.high + 1])
        case kind if kind == ZONE:
            every = [zone.name for zone in policy.zones[parameter.low : parameter.high + 1]]
            left = [_zones(lowered, parameter.name, each) for each in conditions]
            kept = [name for name in every if any(some is None or name in some for some in left)]
            return Allowed(parameter, names=tuple(kept))
        case kind if kind == PLACE:
            return Allowed(parameter, names=tuple(entries))
    ranges = [_range(parameter, each) for each in conditions]
    some = [(low, high) for low, high in ranges if low <= high] or [(parameter.low, parameter.high)]
    return Allowed(parameter, min(low for low, _ in some), max(high for _, high in some))


def _range(parameter: Parameter, condition: Condition | None) -> tuple[int, int]:
    """The range that is left when comparisons of the parameter with quantities must hold: both ends belong to it."""
    low, high = parameter.low, parameter.high
    if parameter.kind != QUANTITY:
        return low, high
    for operator, bound in _bounds(parameter.name, condition):
        if operator in ("<", "<=", "=="):
            high = min(high, bound - (operator == "<"))
        if operator in (">", ">=", "=="):
            low = max(low, bound + (operator == ">"))
    return low, high


def _bounds(name: str, condition: Condition | None) -> Iterator[tuple[str, int]]:
    """How a parameter must compare with which quantities, the parameter on the left."""
    for each in _conjuncts(condition):
        if isinstance(each, Comparison):
            if _is(each.left, name) and isinstance(each.right, Quantity):
                yield each.operator, each.right.value
            elif _is(each.right, name) and isinstance(each.left, Quantity):
                yield _MIRRORED.get(each.operator, each.operator), each.left.value
        elif isinstance(each, Within) and _is(each.subject, name):
            if isinstance(each.range.low, Quantity):
                yield ">=", each.range.low.value
            if isinstance(each.range.high, Quantity):
                yield "<=", each.range.high.value


def _is(value: Value, name: str) -> bool:
    return isinstance(value, Reference) and value.name == name


def _zones(lowered: LoweredPolicy, name: str, condition: Condition | None) -> frozenset[str] | None:
    """The zones for which the parameter may lie where a condition says; None: it says nothing of that."""
    left: frozenset[str] | None = None
    for each in _conjuncts(condition):
        found = _within(lowered, name, each)
        if found is not None:
            left = found if left is None else left & found
    return left


def _within(lowered: LoweredPolicy, name: str, condition: Condition) -> frozenset[str] | None:
    if isinstance(condition, Junction) and condition.operator == "or":
        parts = [_within(lowered, name, each) for each in condition.operands]
        known = [part for part in parts if part is not None]
        return frozenset().union(*known) if len(known) == len(parts) else None
    if not isinstance(condition, Inside) or condition.negated or not isinstance(condition.region, Reference):
        return None
    if not isinstance(condition.subject, Reference) or condition.subject.name != name:
        return None
    if condition.region.name not in lowered.zones.index:
        return None
    inside = lowered.zones.within(condition.region.name, 0, smaller=False, span=condition.span)
    return frozenset(lowered.policy.zones[number].name for number in inside)


def _conjuncts(condition: Condition | None) -> Iterator[Condition]:
    if isinstance(condition, Junction) and condition.operator == "and":
        for each in condition.operands:
            yield from _conjuncts(each)
    elif condition is not None:
        yield condition
