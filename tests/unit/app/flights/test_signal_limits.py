"""The limits of signals, by hand: on which side a condition that has to hold is false."""

from msgspec.structs import replace

from reference import flat_case as flat
from reference.flat_case import apply, clause, const, signal
from rtshcua.app.flights.flight_view import signal_limits
from rtshcua.model.flat.code import Clause, Op
from rtshcua.model.flat.policy import Policy, RuleKind


def limits_of(kind: RuleKind, *when: Clause | None) -> list[tuple[int, bool]]:
    """The limits of the battery in a policy with rules of a kind, for a mission whose skills have no conditions."""
    policy: Policy = replace(flat.POLICY, rules=tuple(flat.rule(kind, when=each) for each in when))
    steps = tuple(
        replace(each, contract=replace(each.contract, require=(), assume=(), maintain=()))
        for each in flat.MISSION.invocations
    )
    found = signal_limits(policy, steps)
    return [(each.value, each.low) for each in found.get(flat.BATTERY, ())]


LOW = apply(Op.LT, signal(flat.BATTERY), const(2_500))
HIGH = apply(Op.GT, signal(flat.BATTERY), const(9_000))


def test_prohibition_below_a_value_is_a_lower_limit() -> None:
    assert limits_of(RuleKind.FORBID, clause("battery < 25 %", LOW)) == [(2_499, True)]


def test_permit_above_a_value_is_a_lower_limit() -> None:
    assert limits_of(RuleKind.PERMIT, clause("battery > 90 %", HIGH)) == [(9_001, True)]


def test_prohibition_above_a_value_is_an_upper_limit() -> None:
    assert limits_of(RuleKind.DEGRADE, clause("battery > 90 %", HIGH)) == [(9_001, False)]


def test_negation_turns_the_side() -> None:
    assert limits_of(RuleKind.FORBID, clause("not battery < 25 %", apply(Op.NOT, LOW))) == [(2_499, False)]


EITHER = clause("battery < 25 % or battery > 90 %", apply(Op.OR, LOW, HIGH))
#: battery from 25 % to 90 %
BETWEEN = apply(Op.AND, apply(Op.NOT, LOW), apply(Op.NOT, HIGH))


def test_each_branch_of_an_or_that_must_not_hold_counts() -> None:
    assert limits_of(RuleKind.FORBID, EITHER) == [(2_499, True), (9_001, False)]


def test_no_branch_of_an_or_that_has_to_hold_counts_alone() -> None:
    assert limits_of(RuleKind.PERMIT, EITHER) == []


def test_each_branch_of_an_and_that_has_to_hold_counts() -> None:
    assert limits_of(RuleKind.PERMIT, clause("between", BETWEEN)) == [(2_499, True), (9_001, False)]
    assert limits_of(RuleKind.FORBID, clause("not between", apply(Op.NOT, BETWEEN))) == [(2_499, True), (9_001, False)]


def test_no_branch_of_an_and_that_must_not_hold_counts_alone() -> None:
    assert limits_of(RuleKind.FORBID, clause("between", BETWEEN)) == []
    assert limits_of(RuleKind.PERMIT, clause("not between", apply(Op.NOT, BETWEEN))) == []


def test_no_permit_beside_another_counts_alone() -> None:
    assert limits_of(RuleKind.PERMIT, clause("battery > 90 %", HIGH), None) == []
    assert limits_of(RuleKind.FORBID, clause("battery > 90 %", HIGH), None) == [(9_001, False)]


def test_conditions_of_the_skills_of_the_mission_count() -> None:
    found = signal_limits(flat.POLICY, flat.MISSION.invocations)
    assert any("battery" in each.told for each in found[flat.BATTERY])
