"""X4 in flight: a frame that reveals trouble is followed by a fallback, and a frame that does not is found."""

from itertools import product

import pytest

from rtshcua.evaluation import fallback_costs, fallback_flights
from rtshcua.evaluation.cases import BY_NAME, CASES
from rtshcua.evaluation.design import EvaluationPlan
from rtshcua.evaluation.fallback_flights import FLOWN, REVEALING, reactions, revealed_by
from rtshcua.model.outcome import Outcome


@pytest.mark.parametrize("case", FLOWN)
def test_fallback_follows_the_frame(case: str) -> None:
    (found,) = reactions(case, "software", 1)
    assert (found.case, found.mode, found.repetition) == (case, "software", 1)
    assert 0 < found.took_ns < 60_000_000_000


@pytest.mark.slow
def test_frame_without_trouble_is_followed_by_no_fallback(monkeypatch: pytest.MonkeyPatch) -> None:
    fine = {"low battery": ("BATTERY_STATUS", {"battery_remaining": 90})}
    monkeypatch.setattr(fallback_flights, "REVEALING", fine)
    with pytest.raises(RuntimeError, match="low battery: no fallback was dispatched"):
        reactions("low battery", "software", 1)


def test_each_case_is_revealed_or_has_a_reason_why_not() -> None:
    for case in CASES:
        revealed, why_not = revealed_by(case.name)
        assert bool(revealed) is (case.name in FLOWN) is not bool(why_not)
    assert {BY_NAME[name].outcome for name in FLOWN} == {Outcome.FALLBACK}
    assert all(name in BY_NAME for name in REVEALING)


def test_flights_of_each_mode_that_enforces_are_planned() -> None:
    found = [unit.key for unit in fallback_costs.units(EvaluationPlan()) if unit.key[0] == fallback_costs.REACTION]
    assert {key[1:3] for key in found} == set(product(FLOWN, fallback_costs.ENFORCED))
    assert {runs for *_, runs in found} == {30}
