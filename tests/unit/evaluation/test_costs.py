"""X4 and X6 with small constants: what is measured happened, and each unit has its results."""

from pathlib import Path

import pytest

from rtshcua.adapters.store.verification import VerificationInputs
from rtshcua.evaluation import evidence_costs, fallback_costs
from rtshcua.evaluation.cases import CASES
from rtshcua.evaluation.design import EvaluationPlan, WorkUnit
from rtshcua.evaluation.evidence_costs import DURABILITIES, WAYS
from rtshcua.evaluation.results import AppendTiming, FallbackTiming, VerificationTiming
from rtshcua.ground.audit import trust
from rtshcua.ground.audit.audit import Audit
from rtshcua.model.outcome import Outcome


def test_each_case_that_is_not_allowed_is_a_condition() -> None:
    found = fallback_costs.run(WorkUnit("X4", ("software", 2)))
    first = [each.case for each in found if isinstance(each, FallbackTiming) and each.repetition == 1]
    assert sorted(first) == sorted(case.name for case in CASES[1:])
    assert len(found) == 2 * (len(CASES) - 1)
    for each in found:
        assert isinstance(each, FallbackTiming)
        assert 0 < each.local_ns < each.written_ns
        assert each.synced_ns > 0


def test_other_outcome_ends_the_measurement(monkeypatch: pytest.MonkeyPatch) -> None:
    other = tuple(
        case._replace(outcome=Outcome.DENY) if case.number == 3 else case for case in fallback_costs.TRIGGERED
    )
    monkeypatch.setattr(fallback_costs, "TRIGGERED", other)
    with pytest.raises(RuntimeError, match="low battery"):
        fallback_costs.run(WorkUnit("X4", ("software", 1)))


@pytest.mark.parametrize("durability", DURABILITIES)
def test_each_record_of_a_log_is_an_append(durability: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evidence_costs, "WARM_APPENDS", 2)
    (found,) = evidence_costs.run(WorkUnit("X6", ("append", durability, 20, 1)))
    assert isinstance(found, AppendTiming)
    assert (found.durability, found.repetition, len(found.appended_ns)) == (durability, 1, 20)
    assert 20 * 400 < found.octets < 20 * 700, "the first record, with the bundle, is not among them"


def test_log_is_verified_each_way() -> None:
    found = evidence_costs.run(WorkUnit("X6", ("verification", "", 1_300, 2)))
    assert all(isinstance(each, VerificationTiming) and each.took_ns > 0 for each in found)
    asked = [(each.way, each.repetition) for each in found if isinstance(each, VerificationTiming)]
    assert asked == [(way, number) for number in (1, 2) for way in WAYS]


def test_each_way_is_verified_cold_and_warm(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cold, nothing remembers the bundle of the log."""
    remembered = list[int]()
    verify = evidence_costs.WAYS["default"]

    def looked(path: Path, inputs: VerificationInputs) -> Audit:
        remembered.append(trust._trusted.cache_info().currsize)
        return verify(path, inputs)

    monkeypatch.setitem(evidence_costs.WAYS, "default", looked)
    found = evidence_costs.run(WorkUnit("X6", ("verification", "", 40, 2)))
    asked = [(each.way, each.repetition, each.cold) for each in found if isinstance(each, VerificationTiming)]
    assert asked == [(way, number, cold) for number in (1, 2) for way in WAYS for cold in (True, False)]
    assert remembered == [0, 1, 0, 1]


def test_log_that_is_not_verified_ends_the_measurement(monkeypatch: pytest.MonkeyPatch) -> None:
    write = evidence_costs._Log.write

    def damaged(self: evidence_costs._Log, path: Path, records: int, durability: int) -> tuple[int, ...]:
        took = write(self, path, records, durability)
        path.write_bytes(path.read_bytes().replace(b'"outcome":"defer"', b'"outcome":"allow"', 1))
        return took

    monkeypatch.setattr(evidence_costs._Log, "write", damaged)
    with pytest.raises(RuntimeError, match="`fast` of 40 records"):
        evidence_costs.run(WorkUnit("X6", ("verification", "", 40, 1)))


def test_units_are_those_of_the_paper_and_a_long_log() -> None:
    found = evidence_costs.units(EvaluationPlan())
    assert len(found) == 3 * 30 + 2 + 2
    assert {unit.key[2] for unit in found} == {1_000, 262_144}
    assert {unit.key[2] for unit in evidence_costs.units(EvaluationPlan(runs=1, quick=True))} == {1_000, 5_000}
