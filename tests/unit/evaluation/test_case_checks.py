"""X3 without flights: each answer of `enforce` is that of `decide` and that of the table, and a wrong one is found."""

from collections import Counter
from collections.abc import Sequence
from random import Random
from typing import Any

import pytest
from msgspec.structs import replace

from rtshcua.evaluation import case_checks
from rtshcua.evaluation.case_checks import units
from rtshcua.evaluation.cases import CASES, EXTRAS
from rtshcua.evaluation.design import MODES, POINTS, EvaluationPlan, EvaluationPoint, WorkUnit
from rtshcua.evaluation.modes import unavailable
from rtshcua.evaluation.results import EnforceCheck
from rtshcua.evaluation.worlds import program_at, world
from rtshcua.model.decision import Decision
from rtshcua.model.outcome import Reason
from rtshcua.onboard.enforcement import boundary
from rtshcua.onboard.enforcement.boundary import SoftwareBoundary
from rtshcua.wire.request import Request, decode, encode
from rtshcua.wire.response import encode as encode_response

POINT = EvaluationPoint("standard", 100_000)


def checked(mode: str, *points: EvaluationPoint, runs: int = 2) -> list[EnforceCheck]:
    found = []
    for point in points or (POINT,):
        for result in case_checks.run(WorkUnit("X3", ("check", *point, mode, runs))):
            assert isinstance(result, EnforceCheck)
            found.append(result)
    return found


def different(found: Sequence[EnforceCheck]) -> list[str]:
    return [f"{each.case}: {each.differs}" for each in found if not (each.agrees and each.as_expected)]


def test_table_has_the_published_classes() -> None:
    outcomes = Counter(case.outcome.name for case in CASES)
    assert outcomes == {"ALLOW": 1, "FALLBACK": 5, "DEFER": 2, "DENY": 4}
    assert [case.number for case in (*CASES, *EXTRAS)] == [*range(1, 15)]


def test_units_are_7560_checks_a_mode_and_two_extras() -> None:
    found = [unit for unit in units(EvaluationPlan()) if unit.key[0] == "check"]
    assert len(found) == len(POINTS) * (len(MODES) - 1)
    assert len(POINTS) * len(CASES) * EvaluationPlan().runs == 7_560
    assert len(set(found)) == len(found)


@pytest.mark.parametrize("mode", ["software", "none"])
def test_answers_are_those_of_the_table_and_of_decide(mode: str) -> None:
    found = checked(mode, POINT, EvaluationPoint("short", 1_500_000))
    assert different(found) == []
    assert len(found) == 2 * 2 * (len(CASES) + len(EXTRAS))
    allowed = sum(each.permits for each in found if each.outcome == "allow")
    assert allowed == 2 * 2
    # mode `none` issues a permit whatever was decided
    assert sum(each.permits for each in found) == (len(found) if mode == "none" else allowed)


def test_repetitions_differ_in_what_does_not_count() -> None:
    program = program_at(POINT)
    with world("software", program.policy) as where:
        bundle = case_checks.StruckBundle(where, program)
        asked = [bundle.request(CASES[2], Random(number)) for number in range(20)]
    battery = next(each.slot for each in program.policy.signals if each.name == "battery")
    assert {each.state.values[battery] for each in asked} == {3_000}
    assert len({each.state.values for each in asked}) == len(asked)


def test_wrong_table_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = tuple(case._replace(reason=Reason.ENERGY) if case.number == 5 else case for case in CASES)
    monkeypatch.setattr(case_checks, "CASES", wrong)
    found = checked("software", runs=1)
    assert [each.case for each in found if not each.as_expected] == ["obstacle near"]
    assert all(each.agrees for each in found)


def test_boundary_without_wind_is_found_with_both_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    honest, policy = SoftwareBoundary.enforce, program_at(POINT).policy
    wind = next(each.slot for each in policy.signals if each.name == "wind.speed")

    def calm(self: SoftwareBoundary, request: bytes) -> bytes:
        asked = decode(request, policy.slots, len(policy.monitors))
        assert isinstance(asked, Request)
        values = tuple(0 if slot == wind else value for slot, value in enumerate(asked.state.values))
        return honest(self, encode(replace(asked, state=replace(asked.state, values=values))))

    monkeypatch.setattr(SoftwareBoundary, "enforce", calm)
    (found,) = different(checked("software", runs=1))
    assert found.startswith("wind over limit: allow because admitted, valid until ")
    assert found.endswith(
        "; `decide`: fallback because state/violated at `wind.speed <= 10 m/s` to `hover for 10 s` (link 0)"
    )


def test_boundary_that_allows_for_longer_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def longer(decision: Decision, *more: Any) -> bytes:
        return encode_response(replace(decision, valid_until_us=decision.valid_until_us + 1), *more)

    monkeypatch.setattr(boundary, "encode", longer)
    found = checked("software", runs=1)
    assert [each.case for each in found if each.agrees] == []
    assert all(each.as_expected for each in found)


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["process", "trustzone-m", "optee"])
def test_isolated_boundaries_answer_as_decide_does(mode: str) -> None:
    missing = unavailable(mode)
    if missing is not None:
        pytest.skip(str(missing))
    assert different(checked(mode, runs=3)) == []


@pytest.mark.soak
@pytest.mark.parametrize("mode", ["none", "software", "process"])
def test_all_points_answer_as_decide_does(mode: str) -> None:
    found = checked(mode, *POINTS, runs=30)
    assert different(found) == []
    assert len([each for each in found if each.case in {case.name for case in CASES}]) == 7_560
