"""Required message rates: by stale times and deadlines, within the rates of vehicles."""

import pytest
from msgspec.structs import replace

from rtshcua.decision.rates import (
    AT_BEST,
    AT_LEAST,
    LEAST_OFTEN,
    MOST_OFTEN,
    SUFFICES,
    Rate,
    delivered,
    rates,
    signal_of,
)
from rtshcua.model.flat.contract import Contract, Link, TimingClass
from rtshcua.model.flat.policy import Policy, RuleKind
from virtual import case
from virtual.policy import BATTERY, POLICY, POSITION_X

S = 1_000_000
GIVEN = case.policy()


def quick(deadline_us: int, **fields: object) -> Contract:
    """The reference policy's first skill that waits for something, with another deadline."""
    found = next(each for each in GIVEN.contracts if each.timing_class != TimingClass.REFLEX and each.require)
    return replace(found, deadline_us=deadline_us, **fields)  # type: ignore[arg-type]


def test_rates_follow_stale_times_and_effects() -> None:
    found = rates(POLICY)
    assert found["BATTERY_STATUS"] == Rate(1_000_000, 1_000_000)
    assert found["GLOBAL_POSITION_INT"] == Rate(100_000, 250_000)
    assert found["GPS_RAW_INT"] == Rate(500_000, 1_000_000)
    for name, rate in found.items():
        assert MOST_OFTEN <= rate.asked <= AT_LEAST.get(name, LEAST_OFTEN)
        assert rate.asked <= rate.suffices <= max(rate.asked, SUFFICES.get(name, LEAST_OFTEN))


@pytest.mark.parametrize(("deadline_us", "asked"), [
    (3 * S, 1_000_000), (500_000, 250_000), (200_000, 100_000), (100_000, 50_000), (10_000, 50_000),
])  # fmt: skip
def test_awaited_signal_is_reported_twice_within_deadline(deadline_us: int, asked: int) -> None:
    slots = {"GPS_RAW_INT", "BATTERY_STATUS", "GLOBAL_POSITION_INT"}
    found = rates(GIVEN, [quick(deadline_us)])
    for name in slots & found.keys():
        assert found[name].asked <= asked
        assert found[name].suffices <= max(deadline_us, found[name].asked)


def test_a_reflex_waits_for_nothing() -> None:
    assert rates(GIVEN, [quick(60_000, timing_class=TimingClass.REFLEX)]) == rates(GIVEN)


@pytest.mark.parametrize("kind", [RuleKind.FORBID, RuleKind.DEGRADE])
def test_signals_of_forbid_and_degrade_rules_are_awaited(kind: RuleKind) -> None:
    permits = [rule for rule in GIVEN.rules if rule.kind == RuleKind.PERMIT]
    clause = quick(S).require[0]
    target = Link(skill=99, arguments=(), limit_us=0, text="", source=0, start=0, end=0)
    rule = replace(permits[0], kind=kind, when=clause, skills=(), target=target if kind is RuleKind.DEGRADE else None)
    bare: Policy = replace(GIVEN, rules=(), contracts=tuple(
        replace(each, require=(), assume=(), maintain=()) for each in GIVEN.contracts
    ))  # fmt: skip
    step = quick(100_000, require=(), assume=(), maintain=())
    without = rates(bare, [step])
    own = GIVEN.contracts.index(next(c for c in GIVEN.contracts if c.name == step.name))
    for skills in ((), (own,)):
        assert rates(replace(bare, rules=(replace(rule, skills=skills),)), [step]) != without
    if kind is RuleKind.DEGRADE:  # no step degrades to itself
        itself = replace(rule, skills=(own,), target=replace(target, skill=own))
        assert rates(replace(bare, rules=(itself,)), [step]) == without
    assert rates(replace(bare, rules=(replace(rule, skills=(99,)),)), [step]) == without


def test_rate_is_limited_by_message_source() -> None:
    asked = {"HEARTBEAT": Rate(100_000, S), "RADIO_STATUS": Rate(50_000, S), "WIND": Rate(50_000, S)}
    assert {name: delivered(asked, name) for name in asked} == {
        "HEARTBEAT": AT_BEST["HEARTBEAT"], "RADIO_STATUS": S, "WIND": 50_000,
    }  # fmt: skip
    assert delivered(asked, "RADIO_STATUS", 100_000) == 100_000, "this sender is known"
    assert delivered(asked, "RADIO_STATUS", 10_000) == 50_000, "no more often than requested"
    assert delivered(asked, "WIND", 2 * S) == 2 * S


def test_the_signal_of_a_slot() -> None:
    assert signal_of(POLICY, BATTERY).name == "battery"
    assert signal_of(POLICY, POSITION_X + 1).name == "position", "a position has two"
