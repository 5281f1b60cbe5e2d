"""A whole policy."""

from collections.abc import Iterator

from rtshcua.decision.checks.contracts import chain, contract
from rtshcua.decision.checks.indexes import at, within
from rtshcua.decision.checks.monitors import monitors, phases
from rtshcua.decision.checks.rules import airspace, rules
from rtshcua.decision.checks.vehicle import signals, vehicle
from rtshcua.decision.checks.zones import zones
from rtshcua.decision.scope import scope_of
from rtshcua.model.flat.limits import MAX_CONTRACTS, MAX_MEMBERS, MAX_ROLES, MAX_SETS, MAX_SILENCE
from rtshcua.model.flat.policy import AfterSilence, Policy, WithoutEvidence


def problems(policy: Policy) -> Iterator[str]:
    """What is wrong with a policy. Later checks rely on earlier ones: stop at the first problem."""
    yield from signals(policy)
    yield from vehicle(policy)
    yield from zones(policy)
    yield from within("number of roles", len(policy.roles), 0, MAX_ROLES)
    yield from within("number of sets", len(policy.sets), 0, MAX_SETS)
    for number, members in enumerate(policy.sets):
        yield from at(f"set {number}", within("number of members", len(members), 0, MAX_MEMBERS))
    yield from within("number of contracts", len(policy.contracts), 0, MAX_CONTRACTS)
    yield from phases(policy)
    scope = scope_of(policy)
    yield from monitors(policy, scope)
    for one in policy.contracts:
        yield from at(f"skill `{one.name}`", contract(one, policy, scope))
    for one in policy.contracts:
        yield from at(f"skill `{one.name}`: fallback", chain(one.fallback, policy))
    yield from at("contingency", chain(policy.contingency, policy))
    yield from rules(policy, scope)
    yield from at("airspace", airspace(policy.airspace, policy))
    yield from within("without evidence", policy.without_evidence, WithoutEvidence.LAND, WithoutEvidence.REFUSE)
    yield from within("silence", policy.silence_us, 1, MAX_SILENCE)
    yield from within("after silence", policy.after_silence, AfterSilence.CONTINUE, AfterSilence.CONTINGENCY)
