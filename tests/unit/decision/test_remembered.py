"""The cache of the last situation changes no answer: between states, moments, invocations or policies."""

from random import Random
from typing import Any

import pytest
from msgspec.structs import replace

from reference import flat_case as flat
from reference.asking import STEP, loaded, ready
from reference.flat_case import BATTERY, FIX, HEIGHT, LINK, NOW, POSITION_X, POSITION_Y, WIND, M
from rtshcua.decision.decide import decide
from rtshcua.decision.fallbacks import START, choose_contingency, choose_fallback, link_admissible, look_ahead
from rtshcua.decision.running_conditions import holding, watch
from rtshcua.decision.zones import PreparedZone
from rtshcua.model.flat.situation import Now, State

CONTEXT = flat.context()
VALUES: dict[int, tuple[int | None, ...]] = {
    BATTERY: (8_000, 2_000, 1_000, None),
    FIX: (3, 2, None),
    LINK: (9_000, 100),
    WIND: (1_000, None),
    HEIGHT: (20 * M, 26 * M, 130 * M, None),
    POSITION_X: (0, 88 * M, 600 * M, None),
    POSITION_Y: (0, 300 * M, 450 * M),
}


def questions(chance: Random) -> tuple[State, Now, int]:
    values = {slot: chance.choice(given) for slot, given in VALUES.items() if chance.random() < 0.5}
    later_us = chance.choice((0, 0, 1, 600_000_000))
    now = replace(NOW, monotonic_us=NOW.monotonic_us + later_us, utc_us=NOW.utc_us + later_us)
    return flat.state(values), now, chance.choice((START, -1, 0, 1))


def answers(policy: Any, state: State, now: Now, after: int) -> list[Any]:
    step, last = ready_of[id(policy)]
    return [
        choose_fallback(step, state, policy, now, after),
        choose_fallback(last, state, policy, now, after),
        choose_contingency(state, policy, now, after),
        [link_admissible(link, state, policy, now, phase) for link in policy.contingency for phase in (-1, 0)],
        tuple(watch(step, state, policy, now)),
        tuple(watch(last, state, policy, now)),
        holding(step, state, policy, now),
        decide(step, state, policy, CONTEXT, now),
    ]


ready_of: dict[int, Any] = {}


def prepared() -> Any:
    policy = loaded()
    ready_of[id(policy)] = (ready(STEP, policy), ready(flat.INVOCATIONS[-1], policy))
    return policy


@pytest.mark.unmeasured
def test_cached_answers_match_fresh_policy() -> None:
    chance = Random(3)
    asked = prepared()
    for _ in range(60):
        state, now, after = questions(chance)
        if chance.random() < 0.5:
            look_ahead(ready_of[id(asked)][0], state, asked, now)
        for _ in range(chance.choice((1, 2))):
            assert repr(answers(asked, state, now, after)) == repr(answers(prepared(), state, now, after))


def test_equal_situations_are_evaluated_once(monkeypatch: pytest.MonkeyPatch) -> None:
    policy = prepared()
    (step, _), looked = ready_of[id(policy)], []
    along = PreparedZone.along

    def counted(zone: PreparedZone, path: Any, box: Any) -> int:
        looked.append(zone.number)
        return along(zone, path, box)

    monkeypatch.setattr(PreparedZone, "along", counted)
    look_ahead(step, flat.state(), policy, NOW)
    assert looked
    looked.clear()
    low = flat.state({BATTERY: 2_000})  # the same place: where the degrade rule's target leads is known
    assert choose_fallback(step, low, policy, NOW) is choose_fallback(step, flat.state({BATTERY: 2_000}), policy, NOW)
    assert looked == []
