"""The instances of a mission with parameters share work: each common part is computed once."""

from collections import Counter

import pytest

from reference.sources import findings, program
from rtshcua.decision.prepare import prepare_invocation
from rtshcua.ground.geometry import survey
from rtshcua.ground.geometry.shapes import RoundArea
from rtshcua.ground.prove import proof_context
from rtshcua.model.flat.mission import Invocation

POLICY = """
policy p version 1 {
  permit takeoff, goto by role pilot through operator when altitude <= 35 m
  permit hover, return_home, emergency_land by any
  contingency return_home, emergency_land
}
"""
MISSION = """
mission m(
  height: altitude in 12 m .. 30 m = 18 m,
  pace:   speed in 2 m/s .. 5 m/s = 3 m/s,
  pause:  duration in 2 s .. 20 s = 5 s,
  last:   duration in 2 s .. 20 s = 5 s,
) under p@1 on quad {
  proposed by operator mere for role pilot
  phase departure {
    takeoff(height)
    goto(47.3980 N, 8.5460 E, height, speed = pace)
    hover(pause)
    hover(last)
    return_home()
  }
}
"""


def test_steps_with_equal_arguments_are_prepared_once(monkeypatch: pytest.MonkeyPatch) -> None:
    prepared: Counter[tuple[int, tuple[int, ...]]] = Counter()

    def counted(invocation: Invocation, *others: object) -> object:
        prepared[invocation.step, invocation.arguments] += 1
        return prepare_invocation(invocation, *others)  # type: ignore[arg-type]

    monkeypatch.setattr(proof_context, "prepare_invocation", counted)
    assert findings(program(POLICY, MISSION)) == ()
    assert set(prepared.values()) == {1}
    assert len(prepared) <= 3 + 3 * 3 + 3 + 3 + 1, "of 64 missions with 5 steps each"


def test_area_is_shrunk_once() -> None:
    survey._inset.cache_clear()
    square = RoundArea((0, 0), 40_000)
    for height in range(10_000, 20_000, 1_000):
        assert survey.survey(square, "grid", height, 2_000, None)
    assert survey._inset.cache_info().misses == 1
