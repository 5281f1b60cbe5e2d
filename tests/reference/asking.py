"""Decide one step of the hand-written mission, with changes by the test, by both functions that decide."""

from typing import Any

from msgspec.structs import replace

from reference import flat_case as flat
from rtshcua.decision.decide import decide, possible
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy, prepare, prepare_invocation
from rtshcua.decision.situation import situation
from rtshcua.model.decision import Decision
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy, Rule

STEP = flat.INVOCATIONS[flat.INSPECTION_STEP]


def loaded(policy: Policy = flat.POLICY) -> PreparedPolicy:
    found = prepare(policy)
    assert isinstance(found, PreparedPolicy), found
    return found


def ready(invocation: Invocation, policy: PreparedPolicy) -> PreparedInvocation:
    found = prepare_invocation(invocation, policy, flat.MISSION.phases)
    assert isinstance(found, PreparedInvocation), found
    return found


POLICY = loaded()


def ask(
    invocation: Invocation = STEP,
    values: dict[int, int | None] | None = None,
    ages: dict[int, int] | None = None,
    now: flat.Now = flat.NOW,
    policy: PreparedPolicy = POLICY,
    **context: Any,
) -> Decision:
    """Return the decision. `possible` over the single situation must return exactly this decision."""
    prepared, state = ready(invocation, policy), flat.state(values, ages)
    circumstances = flat.context(invocation, **context)
    decision = decide(prepared, state, policy, circumstances, now)
    same = possible(prepared, situation(state, policy, now), policy, circumstances)
    assert same == {(decision.outcome, decision.reason, decision.target)}
    return decision


def with_rules(*rules: Rule) -> PreparedPolicy:
    return loaded(replace(flat.POLICY, rules=rules))


def with_contract(skill: int, **fields: Any) -> tuple[PreparedPolicy, Contract]:
    """Return the policy with one changed contract, and that contract."""
    contract = replace(flat.CONTRACTS[skill], **fields)
    contracts = tuple(contract if n == skill else other for n, other in enumerate(flat.CONTRACTS))
    return loaded(replace(flat.POLICY, contracts=contracts)), contract
