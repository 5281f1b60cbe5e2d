"""Limits of conditions are found at the right values, with adjacent values on both sides."""

from collections.abc import Iterator
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from reference import flat_case as flat
from rtshcua.decision.prepare import prepare, prepare_mission
from rtshcua.decision.times import time_of_week
from rtshcua.decision.values import FALSE, TRUE
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.analysis.solve import Questions
from rtshcua.ground.testing.boundaries.clause_limits import ClauseLimit
from rtshcua.ground.testing.boundaries.limit_search import search
from rtshcua.ground.testing.boundaries.scene import TIME, PolicyPart, Scene, SceneVariable, Value, part_truth, parts_of
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.limits import DAY
from rtshcua.model.flat.policy import Policy, RuleKind
from rtshcua.model.flat.situation import Now

NOW = Now(flat.NOW.monotonic_us, flat.NOW.utc_us, 0)
HOME = {flat.POSITION_X: 0, flat.POSITION_Y: 0, flat.HEIGHT: 0}
TAKEOFF, GOTO, INSPECT, RETURN = range(4)


def scene(policy: Policy = flat.POLICY, step: int = TAKEOFF, values: dict[int, int | None] | None = None) -> Scene:
    ready = prepare(policy)
    assert not isinstance(ready, Refusal), ready
    invocations = prepare_mission(flat.MISSION, ready)
    assert not isinstance(invocations, Refusal), invocations
    one = invocations[step]
    return Scene(one, flat.state(HOME | (values or {})), flat.context(one.invocation), NOW)


def found(here: Scene) -> list[ClauseLimit]:
    space = Questions(here.invocation.policy).space(here.invocation.invocation.skill)
    every = list(parts_of(here.invocation))
    return list(search(every, every, here, space).limits)


def sides(limit: ClauseLimit, here: Scene) -> tuple[int, int]:
    made = here.with_all(dict(limit.made))
    return (
        part_truth(limit.part, made.put(limit.variable, limit.holds)),
        part_truth(limit.part, made.put(limit.variable, limit.fails)),
    )


def turning(here: Scene, role: str, text: str = "") -> set[tuple[SceneVariable, Value, Value]]:
    """The variables and both sides of the limits of one part."""
    return {
        (each.variable, each.holds, each.fails)
        for each in found(here)
        if each.part.role == role and text in each.part.text
    }


def test_limits_of_a_step_are_those_of_its_contract_and_rules() -> None:
    here = scene()
    numbers = turning(here, "require") | turning(here, "assume")
    assert numbers == {
        (SceneVariable(False, flat.BATTERY), 3_501, 3_500),
        (SceneVariable(False, flat.WIND), 9_999, 10_000),
    }
    assert turning(here, "permit") == {(SceneVariable(True, 0), 40_000, 40_001)}
    assert turning(here, "degrade") == {(SceneVariable(False, flat.BATTERY), 2_499, 2_500)}
    assert turning(here, "energy") == {(SceneVariable(False, flat.BATTERY), 1_200, 1_199)}


def test_clause_with_signal_and_argument_has_limits_for_both() -> None:
    here = scene(step=INSPECT, values={flat.POSITION_X: 110_000, flat.POSITION_Y: -20_000, flat.HEIGHT: 20_000})
    assert turning(here, "maintain", "height") == {
        (SceneVariable(False, flat.HEIGHT), 25_000, 25_001),
        (SceneVariable(True, 1), 15_000, 14_999),
    }


def test_limits_of_a_daily_window_are_exact_to_the_microsecond() -> None:
    here = scene(step=INSPECT)
    offset = flat.POLICY.vehicle.utc_offset_us
    times = {
        ((holds + offset) % DAY, (fails + offset) % DAY)
        for variable, holds, fails in turning(here, "permit")
        if variable == TIME and isinstance(holds, int) and isinstance(fails, int)
    }
    assert times == {(8 * flat.H, 8 * flat.H - 1), (18 * flat.H, 18 * flat.H + 1)}


def test_limits_of_a_weekly_window_are_exact_to_the_microsecond() -> None:
    code = flat.clause("times", (Op.WEEK_IN, len(flat.POLICY.sets), 0))
    offset = flat.POLICY.vehicle.utc_offset_us
    today = time_of_week(NOW.utc_us + offset) // DAY * DAY
    week = (today + 8 * flat.H, today + 18 * flat.H)
    rules = tuple(replace(rule, when=code) if rule.kind == RuleKind.PERMIT else rule for rule in flat.POLICY.rules)
    here = scene(replace(flat.POLICY, sets=(*flat.POLICY.sets, week), rules=rules))
    times = {
        (time_of_week(holds + offset), time_of_week(fails + offset))
        for variable, holds, fails in turning(here, "permit")
        if variable == TIME and isinstance(holds, int) and isinstance(fails, int)
    }
    assert times == {(week[0], week[0] - 1), (week[1] - 1, week[1])}


def test_each_zone_of_an_airspace_has_a_writable_edge() -> None:
    places = {each for each in turning(scene(), "airspace") if each[0].at == flat.POSITION_X}
    assert len(places) == 2  # the city, which is 1 km wide, and the school
    for _, holds, fails in places:
        assert isinstance(holds, tuple)
        assert isinstance(fails, tuple)
        apart = max(abs(holds[0] - fails[0]), abs(holds[1] - fails[1]))
        assert apart <= 1_000  # mm; most are adjacent, some are closer to the edge elsewhere
    (height,) = [each for each in turning(scene(), "airspace") if each[0].at == flat.HEIGHT]
    assert height[1:] == (119_999, 120_000)


@pytest.mark.parametrize("step", [TAKEOFF, GOTO, INSPECT, RETURN])
def test_part_has_different_truths_on_both_sides_of_a_limit(step: int) -> None:
    here = scene(step=step)
    assert [each for each in found(here) if sides(each, here) != (TRUE, FALSE)] == []


def test_limit_hidden_by_another_part_is_found() -> None:
    """In `a and (b or c)` the limit of c matters only if b is false."""
    low_wind = flat.apply(Op.LE, flat.signal(flat.WIND), flat.const(5_000))
    high_link = flat.apply(Op.GE, flat.signal(flat.LINK), flat.const(7_000))
    text = "wind.speed <= 5 m/s or link.quality >= 70 %"
    clause = flat.clause(text, flat.apply(Op.OR, low_wind, high_link))
    rules = (*flat.RULES, flat.rule(RuleKind.FORBID, flat.TAKEOFF, when=clause, text="forbid both"))
    here = scene(replace(flat.POLICY, rules=rules))
    hidden = [each for each in found(here) if each.part.text == "forbid both" and each.variable.at == flat.LINK]
    assert [(each.holds, each.fails) for each in hidden] == [(7_000, 6_999)]
    ((variable, wind),) = hidden[0].made
    assert variable == SceneVariable(False, flat.WIND)
    assert isinstance(wind, int)
    assert wind > 5_000


# --------------------------------------------------------------------------------------------------- any condition

LOW, HIGH = 0, 24


@st.composite
def conditions(draw: st.DrawFn, depth: int = 2) -> flat.Code:
    """A condition on the wind only, with small numbers."""
    if depth == 0 or draw(st.booleans()):
        op = draw(st.sampled_from([Op.LT, Op.LE, Op.GT, Op.GE, Op.EQ, Op.NE]))
        operands = [flat.signal(flat.WIND), flat.const(draw(st.integers(LOW + 2, HIGH - 2)))]
        return flat.apply(op, *operands)
    if draw(st.integers(0, 3)) == 0:
        return flat.apply(Op.NOT, draw(conditions(depth=depth - 1)))
    return flat.apply(
        draw(st.sampled_from([Op.AND, Op.OR])), draw(conditions(depth=depth - 1)), draw(conditions(depth=depth - 1))
    )


def flips(part: PolicyPart, here: Scene) -> Iterator[frozenset[int]]:
    """The limits of a condition, by trying all values."""
    values = [part_truth(part, here.put(SceneVariable(False, flat.WIND), value)) for value in range(LOW, HIGH + 1)]
    for value, (one, other) in enumerate(pairwise(values)):
        if one != other:
            yield frozenset({value, value + 1})


@given(conditions(), st.integers(LOW, HIGH))
def test_every_limit_of_a_condition_is_found(code: flat.Code, wind: int) -> None:
    clause = flat.clause("of the wind", code)
    contract = replace(flat.CONTRACTS[flat.TAKEOFF], assume=(clause,))
    contracts = (contract, *flat.CONTRACTS[1:])
    step = replace(flat.INVOCATIONS[0], contract=contract)
    ready = prepare(replace(flat.POLICY, contracts=contracts))
    assert not isinstance(ready, Refusal), ready
    invocations = prepare_mission(replace(flat.MISSION, invocations=(step,)), ready)
    assert not isinstance(invocations, Refusal), invocations
    here = Scene(invocations[0], flat.state(HOME | {flat.WIND: wind}), flat.context(step), NOW)
    part = next(each for each in parts_of(here.invocation) if each.clause == clause)
    ours = list(search([part], [part], here, Questions(ready).space(flat.TAKEOFF)).limits)
    assert [each for each in ours if sides(each, here) != (TRUE, FALSE)] == []
    turned = {frozenset((each.holds, each.fails)) for each in ours if each.variable == SceneVariable(False, flat.WIND)}
    assert turned == set(flips(part, here))
