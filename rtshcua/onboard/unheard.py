"""Signals that cannot come on a link, and the steps that a mission would wait at for ever, or break off at."""

from collections.abc import Container

from rtshcua.decision.reads import slots_read
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.policy import Policy, RuleKind
from rtshcua.model.flat.signal import POSITION


def unheard(policy: Policy, messages: Container[str]) -> frozenset[int]:
    """The state slots of the signals that nothing but these messages carries."""
    slots: set[int] = set()
    for signal in policy.signals:
        if signal.sources and all(source.message in messages for source in signal.sources):
            slots.update(range(signal.slot, signal.slot + (2 if signal.kind == POSITION else 1)))
    return frozenset(slots)


def needed(policy: Policy, invocation: Invocation) -> frozenset[int]:
    """The slots without which a step is held up: those of its contract, of the rules that it may meet, and those that
    each permit asks about which may cover it.
    """
    contract = invocation.contract
    clauses = [*contract.require, *contract.assume, *contract.maintain]
    permits: list[set[int]] = []
    for rule in policy.rules:
        if rule.skills and invocation.skill not in rule.skills:
            continue
        if rule.kind == RuleKind.PERMIT:
            read = () if rule.when is None else slots_read((rule.when,), policy.vehicle, policy.monitors)
            permits.append(set(read))
        elif rule.when is not None:
            clauses.append(rule.when)
    every = set.intersection(*permits) if permits else set[int]()
    return frozenset({*contract.reads, *slots_read(clauses, policy.vehicle, policy.monitors), *every})


def stranded(policy: Policy, mission: Mission, slots: frozenset[int]) -> tuple[Invocation, ...]:
    """The steps of a mission that need a slot of these."""
    return tuple(each for each in mission.invocations if slots and not slots.isdisjoint(needed(policy, each)))
