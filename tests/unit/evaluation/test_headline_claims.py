"""The headline claims and targets, by results that hold, fail, or are missing."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import pytest
from msgspec.structs import replace

from reference.evaluation_results import case_flights, checks, everything, flight, flights, timings
from rtshcua.evaluation import headline_claims, measures
from rtshcua.evaluation.design import MODES, POINTS
from rtshcua.evaluation.headline_claims import ClaimVerdict, HeadlineClaim, Target, judge
from rtshcua.evaluation.published import FLAT
from rtshcua.evaluation.results import (
    AppendTiming,
    FallbackTiming,
    PointFlight,
    Result,
    StepTiming,
    UnavailableMode,
    VerificationTiming,
)

HELD, MISSED, INCOMPLETE, NOT_MEASURED, NOT_AVAILABLE = ClaimVerdict
POINT = POINTS[4]


@pytest.fixture(autouse=True)
def one_repetition(monkeypatch: pytest.MonkeyPatch) -> None:
    """A complete evaluation has one run of each cell."""
    monkeypatch.setattr(headline_claims, "RUNS", 1)
    monkeypatch.setattr(measures, "RUNS", 1)


def claim(results: Sequence[Result] | Iterator[Result], slug: str) -> HeadlineClaim:
    (found,) = (each for each in judge(results).claims if each.slug == slug)
    return found


def target(results: Sequence[Result] | Iterator[Result], slug: str) -> Target:
    (found,) = (each for each in judge(results).targets if each.slug == slug)
    return found


def test_nothing_is_held_without_results() -> None:
    found = judge([])
    assert {each.verdict for each in (*found.claims, *found.targets)} == {NOT_MEASURED}
    assert not found.failed


def test_everything_is_held_by_complete_results() -> None:
    found = judge(everything(runs=1))
    others = {each.slug: each.verdict for each in found.claims if each.verdict is not HELD}
    assert others == dict.fromkeys(("x1/optee", "x2/optee", "x3/optee"), NOT_AVAILABLE)
    assert not found.failed
    assert all(each.runs == each.planned for each in found.claims if each.verdict is HELD)


@pytest.mark.parametrize(
    "change",
    [
        {"misses": 1}, {"fallbacks": 1}, {"ending": "aborted"}, {"ending": "crashed"}, {"invocations": ()},
    ],
)  # fmt: skip
def test_one_disturbed_flight_fails_its_mode(change: dict[str, Any]) -> None:
    results = [*flights(["software", "none"], runs=1), replace(flight(*POINT, "software", 1), **change)]
    found = judge(results)
    assert [each.slug for each in found.failed] == ["x1/software"]
    assert claim(results, "x1/none").verdict is HELD


def test_a_failure_is_not_undone_by_flying_again() -> None:
    results = [replace(flight(*POINT, "software", 1), misses=1), *flights(["software"], runs=1)]
    found = claim(results, "x1/software")
    assert (found.verdict, found.runs, found.planned) == (MISSED, len(POINTS), len(POINTS))
    assert found.measured.startswith("1 and 0")


def test_counts_of_a_claim_are_those_of_the_times() -> None:
    late = steps_of(flight(*POINT, "software", 1), end_to_end_ns=9_000_000_000)
    fell = steps_of(flight(*POINTS[5], "software", 1), outcome="fallback")
    assert claim([late, fell], "x1/software").measured == "1 and 1; disturbed flights: 2"


def steps_of(flight: PointFlight, **change: Any) -> PointFlight:
    """A flight that says of itself that nothing happened, with its second step changed."""
    first, second, *others = flight.invocations
    return replace(flight, invocations=(first, replace(second, **change), *others))


@pytest.mark.parametrize(
    "contradicted",
    [
        lambda flight: steps_of(flight, end_to_end_ns=1_000 * flight.deadline_us + 1),
        lambda flight: steps_of(flight, end_to_end_ns=None),
        lambda flight: steps_of(flight, outcome="deny"),
        lambda flight: steps_of(flight, step=0),
        lambda flight: replace(flight, invocations=flight.invocations[:-1]),
        lambda flight: replace(flight, invocations=(*flight.invocations, flight.invocations[-1])),
        lambda flight: replace(flight, mission="other", invocations=()),
    ],
)
def test_a_flight_is_judged_by_its_steps_too(contradicted: Callable[[PointFlight], PointFlight]) -> None:
    """Counts of zero do not hide a step that was late, not allowed, or not flown."""
    results = [contradicted(each) if number == 3 else each for number, each in enumerate(flights(["none"], runs=1))]
    assert claim(results, "x1/none").verdict is MISSED


def test_a_check_is_judged_by_the_table_too() -> None:
    results = [
        replace(each, outcome="allow", reason="admitted") if number == 11 else each
        for number, each in enumerate(checks(["none"], runs=1))
    ]
    assert claim(results, "x3/none").verdict is MISSED
    other = [replace(each, case="another") for each in checks(["none"], POINTS[:1], runs=1)]
    assert not any(map(headline_claims.passes, other))


def test_verdict_looks_good_only_where_every_claim_holds() -> None:
    assert judge([]).style == "open"
    assert judge(everything(runs=1)).style == "open"
    assert judge([replace(flight(*POINT, "software", 1), misses=1)]).style == "missed"
    held = tuple(each._replace(verdict=HELD) for each in judge([]).claims)
    assert judge([])._replace(claims=held).style == "held"


def test_a_missing_cell_leaves_a_claim_incomplete() -> None:
    found = claim(list(flights(["software"], POINTS[1:], runs=1)), "x1/software")
    assert (found.verdict, found.runs) == (INCOMPLETE, len(POINTS) - 1)


def test_too_few_repetitions_leave_a_claim_incomplete(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measures, "RUNS", 2)
    monkeypatch.setattr(headline_claims, "RUNS", 2)
    results = [*flights(["software"], runs=2), *checks(["software"], runs=2)]
    assert claim(results, "x1/software").verdict is HELD
    assert claim(results, "x3/software").verdict is HELD
    short = [
        each
        for each in results
        if not (isinstance(each, PointFlight) and each.seed == 2 and each.deadline_us == POINT.deadline_us)
    ]
    assert claim(short, "x1/software").verdict is INCOMPLETE
    assert claim(list(checks(["software"], runs=1)), "x3/software").verdict is INCOMPLETE


def test_the_same_run_twice_does_not_complete_a_cell(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measures, "RUNS", 2)
    monkeypatch.setattr(headline_claims, "RUNS", 2)
    twice = [*flights(["software"], runs=1), *flights(["software"], runs=1), *checks(["software"], runs=1)] * 2
    assert claim(twice, "x1/software").verdict is INCOMPLETE
    assert claim(twice, "x3/software").verdict is INCOMPLETE


def test_a_mode_that_is_not_available_counts_by_its_results_if_it_has_any() -> None:
    absent = UnavailableMode(mode="optee", why="QEMU is missing")
    assert claim([absent], "x1/optee").verdict is NOT_AVAILABLE
    assert target([absent], "isolation").verdict is NOT_AVAILABLE
    assert claim([absent, flight(*POINT, "optee", 1)], "x1/optee").verdict is INCOMPLETE
    assert claim([absent, *flights(["optee"], runs=1)], "x1/optee").verdict is HELD


@pytest.mark.parametrize("change", [{"as_expected": False}, {"agrees": False}])
def test_one_check_that_differs_fails_its_mode(change: dict[str, Any]) -> None:
    results = list(checks(["software", "process"], runs=1))
    results[5] = replace(results[5], **change)
    assert [each.slug for each in judge(results).failed] == ["x3/software"]
    assert claim(results, "x3/process").verdict is HELD
    assert claim(results, "x3/software").measured == "251 of 252"


def test_the_two_further_cases_are_counted_apart() -> None:
    results = [replace(each, agrees=each.case != "validity over") for each in checks(runs=1)]
    found = judge(results)
    assert [each.slug for each in found.failed] == ["x3/extra"]
    assert claim(results, "x3/extra").measured == "105 of 210"
    assert claim(results, "x3/software").planned == 252


def test_a_permit_in_mode_none_is_no_disagreement() -> None:
    results = list(checks(["none"], runs=1))
    assert all(each.permits for each in results)
    assert claim(results, "x3/none").verdict is HELD


def test_a_flown_case_that_does_not_hold_fails() -> None:
    results = list(case_flights())
    assert claim(results, "x3/runtime").verdict is HELD
    results[3] = replace(results[3], holds=False)
    assert claim(results, "x3/runtime").verdict is MISSED
    for missing in ({"aloft": False}, {"flavour": "px4"}, {"case": "normal allow"}):
        some = [replace(each, **missing) for each in case_flights()]
        assert claim(some, "x3/runtime").verdict is INCOMPLETE, missing


def scaled(factor: float) -> list[Result]:
    """Complete flights whose extended mission takes a multiple of the time."""

    def slower(step: StepTiming, mission: str) -> StepTiming:
        return replace(step, end_to_end_ns=round(1e6 * (factor if mission == "extended" else 1)))

    return [
        replace(each, invocations=tuple(slower(step, each.mission) for step in each.invocations))
        for each in flights(["software"], runs=1)
    ]


def test_overhead_that_grows_with_the_mission_fails() -> None:
    assert claim(scaled(FLAT), "x2/software").verdict is HELD
    assert claim(scaled(1 / FLAT), "x2/software").verdict is HELD
    assert claim(scaled(FLAT + 0.01), "x2/software").verdict is MISSED
    assert claim(scaled(FLAT + 0.01)[1:], "x2/software").verdict is INCOMPLETE


def test_evidence_that_takes_longer_than_microseconds_fails() -> None:
    slow = [
        AppendTiming(durability="written", repetition=1, octets=1, appended_ns=(100_001,) * 1000),
        VerificationTiming(way="default", records=1000, repetition=1, took_ns=100_000_000),
    ]
    assert claim(slow, "x6/append").verdict is MISSED
    assert claim(slow, "x6/verification").verdict is HELD


def test_few_logs_leave_evidence_incomplete(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(headline_claims, "RUNS", 2)
    for slug in ("x6/append", "x6/verification"):
        found = claim(list(timings(1)), slug)
        assert (found.verdict, found.runs, found.planned) == (INCOMPLETE, 1, 2)
    for slug in ("append", "verification"):
        found_ = target(list(timings(1)), slug)
        assert (found_.verdict, found_.runs, found_.planned) == (INCOMPLETE, 1, 2)


def test_other_appends_and_logs_of_other_lengths_are_not_compared() -> None:
    others: list[Result] = [
        AppendTiming(durability="buffered", repetition=1, octets=1, appended_ns=(1,) * 1000),
        AppendTiming(durability="written", repetition=1, octets=1, appended_ns=(1,) * 999),
        VerificationTiming(way="fast", records=1000, repetition=1, took_ns=1),
        VerificationTiming(way="default", records=999, repetition=1, took_ns=1),
        VerificationTiming(way="default", records=262_144, repetition=1, took_ns=1),
        VerificationTiming(way="default", records=1000, repetition=1, took_ns=1, cold=True),
    ]
    for slug in ("x6/append", "x6/verification"):
        assert claim(others, slug).verdict is NOT_MEASURED
    for slug in ("append", "verification"):
        assert target(others, slug).verdict is NOT_MEASURED


def test_a_target_is_a_tenth_and_a_missed_one_fails_no_claim() -> None:
    results = [*everything(runs=1)]
    held, missed = target(results, "end-to-end/short"), target(results, "fallback")
    assert (held.verdict, held.limit, held.published, held.stated) == (HELD, 5.57, 55.7, "55.7")
    assert (missed.verdict, missed.stated) == (MISSED, "0.132 to 0.143")
    assert missed.limit == pytest.approx(0.0132)
    assert not judge(results).failed
    assert target(list(timings(1))[1:], "fallback").verdict is INCOMPLETE


def test_the_slowest_condition_counts_for_the_fallback_target() -> None:
    quick = [replace(each, local_ns=10_000) for each in timings(1) if isinstance(each, FallbackTiming)]
    assert target(quick, "fallback").verdict is HELD
    slow = [replace(each, local_ns=13_300 if each.case == "replay" else 10_000) for each in quick]
    assert target(slow, "fallback").verdict is MISSED


def test_isolation_target_is_the_paired_difference() -> None:
    results = list(flights(["software", "optee"], runs=1))
    found = target(results, "isolation")
    assert found.verdict is HELD
    assert found.measured == pytest.approx(5.1, rel=0.3)
    slower = [
        replace(each, invocations=tuple(replace(s, validation_ns=17_400_000) for s in each.invocations))
        if each.mode == "optee"
        else each
        for each in results
    ]
    assert target(slower, "isolation").verdict is MISSED
    assert target(results, "isolation-in-c").verdict is INCOMPLETE
    in_c = [*flights(["process"], runs=1), *slower]
    assert target(in_c, "isolation-in-c").measured == pytest.approx(17.29, abs=0.02)


def test_each_mode_has_its_claims() -> None:
    slugs = {each.slug for each in judge([]).claims}
    assert {f"x1/{mode}" for mode in MODES} <= slugs
    assert "x3/unenforced" not in slugs
