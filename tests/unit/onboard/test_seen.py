"""The values that are recorded with a condition that did not hold."""

import pytest
from msgspec.structs import replace

from reference import flat_case as flat
from rtshcua.decision.prepare import prepare, prepare_mission
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.onboard.runtime.seen import seen

INSPECT = 2


@pytest.mark.parametrize(
    ("text", "values", "told"),
    [
        ("wind.speed < 10 m/s", {flat.WIND: 12_000}, "wind.speed = 12 m/s"),
        ("wind.speed < 10 m/s", {flat.WIND: None}, "wind.speed = unknown"),
        (flat.FIX_IS_GOOD.text, {flat.FIX: 77}, "gps.fix = 77"),
        (flat.LOW_BATTERY.text, {flat.BATTERY: 2_450}, ""),  # the condition; the rule has a text of its own
        ("no clause at all", {}, ""),
        (
            flat.NEAR_AREA.text,
            {flat.POSITION_X: 12_000, flat.POSITION_Y: -3_000, flat.HEIGHT: 20_000},
            "height = 20 m, position = 12 m east and -3 m north of home",
        ),
        (flat.NEAR_AREA.text, {flat.POSITION_Y: None}, "height = 20 m, position = unknown"),
    ],
)
def test_signals_of_clause_are_shown(text: str, values: dict[int, int | None], told: str) -> None:
    policy = prepare(flat.POLICY)
    assert not isinstance(policy, Refusal)
    invocations = prepare_mission(flat.MISSION, policy)
    assert not isinstance(invocations, Refusal)
    state = flat.state({flat.HEIGHT: 20_000} | values)
    assert seen(text, invocations[INSPECT], policy, state) == told


def test_signals_of_rule_and_airspace_are_shown() -> None:
    policy = prepare(flat.POLICY)
    assert not isinstance(policy, Refusal)
    invocations = prepare_mission(flat.MISSION, policy)
    assert not isinstance(invocations, Refusal)
    state = flat.state({flat.BATTERY: 2_450})
    degrade = next(rule for rule in flat.POLICY.rules if rule.when == flat.LOW_BATTERY)
    assert seen(degrade.text, invocations[INSPECT], policy, state) == "battery = 24.5 %"
    assert flat.POLICY.airspace is not None
    assert "position = " in seen(flat.POLICY.airspace.text, invocations[INSPECT], policy, state)
    bare = prepare(replace(flat.POLICY, airspace=None))
    assert not isinstance(bare, Refusal)
    assert seen(flat.POLICY.airspace.text, invocations[INSPECT], bare, state) == ""
