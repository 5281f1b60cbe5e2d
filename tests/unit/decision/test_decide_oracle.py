"""`decide` and the choice of links against the oracle, and `possible` against `decide`, in random worlds."""

from random import Random

import pytest
from hypothesis import assume, given, settings

from reference import flat_case as flat
from reference import worlds
from reference.naive_code import TooNear
from reference.oracle import Oracle
from rtshcua.decision.decide import decide, possible
from rtshcua.decision.fallbacks import START, choose_contingency, choose_fallback, link_admissible
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy, prepare, prepare_invocation
from rtshcua.decision.situation import is_situation, situation
from rtshcua.model.outcome import Outcome

MANY = settings(max_examples=settings().max_examples * 4)


def prepared(of: Random) -> tuple[PreparedPolicy, PreparedInvocation]:
    policy = prepare(worlds.policy(of))
    assert isinstance(policy, PreparedPolicy), policy
    invocation = prepare_invocation(worlds.invocation(of, policy.policy), policy, flat.MISSION.phases)
    assert isinstance(invocation, PreparedInvocation), invocation
    return policy, invocation


@pytest.mark.claim("A2")
@MANY
@given(worlds.CHANCES)
def test_the_oracle_decides_the_same(of: Random) -> None:
    policy, invocation = prepared(of)
    state, now, context = (
        worlds.state(of, len(policy.monitors)),
        worlds.now(of),
        worlds.context(of, invocation.invocation),
    )
    oracle = Oracle(policy.policy, state, now)
    try:
        outcome, reason, step = oracle.decide(invocation.invocation, context)
        target = oracle.target(invocation.invocation) if outcome is Outcome.FALLBACK else None
    except TooNear:
        assume(False)
    decision = decide(invocation, state, policy, context, now)
    assert (decision.outcome, decision.reason, decision.step) == (outcome, reason, step)
    assert (decision.link, decision.target) == (target or (None, None))


@pytest.mark.claim("A2")
@MANY
@given(worlds.CHANCES)
def test_the_oracle_chooses_the_same_links(of: Random) -> None:
    policy, invocation = prepared(of)
    state, now, after = worlds.state(of, len(policy.monitors)), worlds.now(of), of.randrange(START, 3)
    oracle = Oracle(policy.policy, state, now)
    try:
        oracle.enter(invocation.invocation)
        fallback = oracle.first(invocation.invocation.contract.fallback, after)
        oracle.phase = -1
        contingency = oracle.first(policy.policy.contingency, after)
        may = [oracle.may_fly(link) for link in policy.policy.contingency]
    except TooNear:
        assume(False)
    if after > START:
        choice = choose_fallback(invocation, state, policy, now, after)
        assert (choice and (choice.index, choice.link)) == fallback
    choice = choose_contingency(state, policy, now, after)
    assert (choice and (choice.index, choice.link)) == contingency
    assert [link_admissible(link, state, policy, now) for link in policy.contingency] == may


@MANY
@given(worlds.CHANCES)
def test_possible_outcomes_include_decision(of: Random) -> None:
    policy, invocation = prepared(of)
    sets, context = worlds.sets(of, len(policy.monitors)), worlds.context(of, invocation.invocation)
    answers = possible(invocation, sets, policy, context)
    assert answers
    for _ in range(8):
        state, now = worlds.situation(of, sets, len(policy.monitors))
        decision = decide(invocation, state, policy, context, now)
        assert (decision.outcome, decision.reason, decision.target) in answers


@given(worlds.CHANCES)
def test_decision_is_the_only_possible_answer(of: Random) -> None:
    policy, invocation = prepared(of)
    state, now, context = (
        worlds.state(of, len(policy.monitors)),
        worlds.now(of),
        worlds.context(of, invocation.invocation),
    )
    decision = decide(invocation, state, policy, context, now)
    sets = situation(state, policy, now)
    assert is_situation(sets, policy)
    answers = possible(invocation, sets, policy, context)
    assert answers == {(decision.outcome, decision.reason, decision.target)}
