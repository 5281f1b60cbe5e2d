"""The reference cases of design 4.1: normal allow; no slack; low battery; degraded link; obstacle near; wind over
limit; GPS missing; stale state; skill not permitted; argument out of scope; binding tampered; replayed; policy version
mismatch; validity window over. The first is allowed, the next five fall back, the next two defer, the rest is denied.
"""

from typing import Any

import pytest
from msgspec.structs import replace

from reference import flat_case as flat
from reference.asking import POLICY, STEP, ask
from reference.flat_case import (
    BATTERY,
    FIX,
    INSPECT,
    LINK,
    MIN,
    NOW,
    OBSTACLE,
    POSITION_X,
    TRACK,
    WIND,
    M,
    S,
)
from rtshcua.decision.decide import decide
from rtshcua.decision.fallbacks import DEGRADE
from rtshcua.decision.prepare import prepare_mission
from rtshcua.model.flat.mission import Plan
from rtshcua.model.outcome import Outcome, Reason
from virtual.rows import rows

HIGHER = replace(STEP, arguments=(flat.BRIDGE, 40 * M, 0, 4 * M), plan=replace(STEP.plan, altitude=40 * M))
TRACKING = flat.invocation(2, flat.INSPECTION, TRACK, Plan(0, (), 0, 0))
LATER = replace(NOW, utc_us=flat.ISSUED + 11 * MIN)


ALLOW, DENY, DEFER, FALLBACK = Outcome

CASES: dict[str, tuple[dict[str, Any], Outcome, Reason]] = {
    "normal allow": ({}, ALLOW, Reason.ADMITTED),
    "no slack": ({"released_us": NOW.monotonic_us - 2 * S}, FALLBACK, Reason.NO_SLACK),
    "low battery": ({"values": {BATTERY: 3_000}}, FALLBACK, Reason.STATE_VIOLATED),
    "degraded link": ({"values": {LINK: 1_000}}, FALLBACK, Reason.STATE_VIOLATED),
    "obstacle near": ({"values": {OBSTACLE: 2 * M}}, FALLBACK, Reason.STATE_VIOLATED),
    "wind over limit": ({"values": {WIND: 12 * M}}, FALLBACK, Reason.STATE_VIOLATED),
    "GPS missing": ({"values": {FIX: None}}, DEFER, Reason.STATE_UNKNOWN),
    "stale state": ({"ages": {POSITION_X: S}}, DEFER, Reason.SAFETY_UNKNOWN),
    "skill not permitted": ({"invocation": TRACKING}, DENY, Reason.FORBIDDEN),
    "argument out of scope": ({"invocation": HIGHER}, DENY, Reason.OUT_OF_SCOPE),
    "binding tampered": ({"binding": bytes(32)}, DENY, Reason.BINDING_MISMATCH),
    "replayed": ({"consumed": 1}, DENY, Reason.REPLAYED),
    "policy version mismatch": ({"policy_version": 6}, DENY, Reason.POLICY_VERSION),
    "validity window over": ({"now": LATER}, DENY, Reason.EXPIRED),
}


@rows("name", CASES)
def test_reference_case(name: str) -> None:
    given, outcome, reason = CASES[name]
    decision = ask(**given)
    assert (decision.outcome, decision.reason) == (outcome, reason)


def test_the_outcomes_are_those_of_the_design() -> None:
    assert [outcome for _, outcome, _ in CASES.values()] == [ALLOW] + [FALLBACK] * 5 + [DEFER] * 2 + [DENY] * 6


def test_an_admission_is_bounded_by_the_first_thing_to_go_stale() -> None:
    """Height and position hold for 500 ms and are 10 ms old; the deadline is 2 s, the validity 10 min."""
    assert ask().valid_until_us == NOW.monotonic_us + 490_000


@pytest.mark.parametrize(
    ("context", "now", "until"),
    [
        ({"released_us": NOW.monotonic_us - 1_900_000}, NOW, NOW.monotonic_us + 100_000),
        ({"released_us": NOW.monotonic_us + 3_600 * S}, NOW, NOW.monotonic_us + 490_000),
        ({}, replace(NOW, utc_us=flat.ISSUED + 10 * MIN - 50_000), NOW.monotonic_us + 30_000),
        ({"released_us": NOW.monotonic_us - 1_995_000}, NOW, NOW.monotonic_us + 5_000),
    ],
)
def test_an_admission_is_bounded_by_deadline_and_validity(context: dict[str, Any], now: flat.Now, until: int) -> None:
    decision = ask(now=now, **context)
    assert (decision.outcome, decision.valid_until_us) == (ALLOW, until)


def test_only_fallback_names_a_target() -> None:
    assert (ask(binding=bytes(32)).link, ask(binding=bytes(32)).target) == (None, None)
    wind = ask(values={WIND: 12 * M})
    assert (wind.link, wind.target) == (0, flat.CHAIN[0])
    no_fix = ask(values={WIND: 12 * M, FIX: 2})  # hover and return need a fix
    assert (no_fix.link, no_fix.target) == (2, flat.CHAIN[2])


def test_a_matching_degrade_names_the_target() -> None:
    low = ask(values={BATTERY: 2_000})
    assert (low.reason, low.link, low.target) == (Reason.STATE_VIOLATED, DEGRADE, flat.RULES[6].target)


def test_a_decision_names_the_clause_that_decided_with_its_span() -> None:
    decision = ask(values={BATTERY: 3_000})
    assert decision.step == 6
    assert decision.clause == flat.ENOUGH_CHARGE
    assert (decision.clause.start, decision.clause.end) == (100, 114)


def test_each_step_of_the_mission_is_admitted_in_its_turn() -> None:
    mission = prepare_mission(flat.MISSION, POLICY)
    assert isinstance(mission, tuple)
    assert [invocation.invocation.skill for invocation in mission] == [flat.TAKEOFF, flat.GOTO, INSPECT, flat.HOME]
    for invocation in mission:
        on_ground = {flat.HEIGHT: 0, POSITION_X: 0, flat.POSITION_Y: 0} if invocation.invocation.step == 0 else {}
        decision = decide(invocation, flat.state(on_ground), POLICY, flat.context(invocation.invocation), NOW)
        assert (decision.outcome, decision.step) == (ALLOW, 8)
