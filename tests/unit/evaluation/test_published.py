"""The published figures are consistent with what was derived from them, and with our choices."""

from statistics import fmean

import pytest

from rtshcua.evaluation import cases
from rtshcua.evaluation.check_sections import HOME, OURS
from rtshcua.evaluation.design import DEADLINES_US, MISSIONS, POINTS, RUNS
from rtshcua.evaluation.footprint import COMPANION, HOMES
from rtshcua.evaluation.published import CASES, CHOICES, FIGURES, FOOTPRINT, FOOTPRINT_TOTAL, PUBLISHED_MODES, Origin


def value(key: str) -> float:
    return FIGURES[key].low


def test_every_figure_has_an_origin_and_ends_in_order() -> None:
    assert len(FIGURES) > 50
    assert all(each.low <= each.high and each.origin in Origin for each in FIGURES.values())
    assert FIGURES["x2/validation/optee"].text == "180.7 to 185.4"
    assert FIGURES["x1/p95/extended/software"].text == "135.0"
    assert FIGURES["x3/checks"].text == "7,560"


def test_the_published_counts_are_those_of_the_design() -> None:
    assert value("x1/points") == len(POINTS) == len(MISSIONS) * len(DEADLINES_US)
    assert value("x1/cells") == len(POINTS) * len(PUBLISHED_MODES)
    assert value("x1/runs") == value("x1/cells") * RUNS
    assert value("x3/cases") == sum(not case.extra for case in CASES)
    assert value("x3/checks") == value("x3/cases") * len(POINTS) * RUNS


def test_derived_differences_follow_from_the_published_figures() -> None:
    for mission in MISSIONS:
        for kind, key in (("median", "x2/median"), ("p95", "x1/p95")):
            difference = value(f"{key}/{mission}/optee") - value(f"{key}/{mission}/software")
            assert value(f"x5/{kind}/{mission}") == pytest.approx(difference)
    for kind in ("median", "p95"):
        mean = fmean(value(f"x5/{kind}/{mission}") for mission in MISSIONS)
        assert value(f"x5/end-to-end-{kind}") == value(f"x5/derived-{kind}") == pytest.approx(mean, abs=0.05)


def test_derived_sums_follow_from_the_published_footprint() -> None:
    assert value("x7/lines-summed") == sum(each.code_lines for each in FOOTPRINT)
    assert value("x7/memory-summed") == pytest.approx(sum(each.memory_kb for each in FOOTPRINT))
    artifacts = sum(each.artifact_kb for each in FOOTPRINT)
    assert value("x7/artifact-summed") == pytest.approx(artifacts)
    assert value("x7/artifact-shared") == pytest.approx(artifacts - 8.29)
    assert value("x7/artifact-unexplained") == pytest.approx(artifacts - 8.29 - FOOTPRINT_TOTAL.artifact_kb)
    assert value("x6/throughput-derived") == pytest.approx(1e6 / value("x6/verification"), abs=10)


def test_cases_are_those_that_are_measured() -> None:
    measured = [(each, False) for each in cases.CASES] + [(each, True) for each in cases.EXTRAS]
    assert [(each.number, each.name, each.outcome, each.reason, each.extra) for each in CASES] == [
        (each.number, each.name, each.outcome.name.lower(), each.reason, extra) for each, extra in measured
    ]


def test_components_that_are_measured_have_the_published_names() -> None:
    measured = {each.name for each in COMPANION} | {each.name for each in HOMES}
    assert {OURS.get(each.component, each.component) for each in FOOTPRINT} <= measured
    assert all(each.name.startswith(HOME) for each in HOMES)
    assert not any(each.name.startswith(HOME) for each in COMPANION)


def test_choices_have_unique_anchors() -> None:
    anchors = [each.anchor for each in CHOICES]
    assert len(anchors) == len(set(anchors))
