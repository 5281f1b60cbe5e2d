"""Statistics of raw results, by tables calculated by hand."""

from statistics import median

import pytest
from msgspec.structs import replace

from reference.evaluation_results import flight
from rtshcua.evaluation.design import DEADLINES_US, EvaluationPoint
from rtshcua.evaluation.measures import (
    Averaged,
    Distribution,
    FlightTable,
    averaged,
    distribution,
    end_to_end,
    p95,
    percentile,
    remaining,
    validation,
)
from rtshcua.evaluation.results import PointFlight, StepTiming


def timed(
    mode: str, seed: int, *took_ns: int, deadline_us: int = DEADLINES_US[0], mission: str = "short"
) -> PointFlight:
    """A flight whose invocations took these times end to end, a tenth of which in `enforce`."""
    steps = [
        StepTiming(
            step=step, outcome="allow", reason="admitted", validation_ns=took // 10, end_to_end_ns=took, dispatch_ns=1
        )
        for step, took in enumerate(took_ns)
    ]
    return replace(flight(mission, deadline_us, mode, seed), invocations=tuple(steps))


@pytest.mark.parametrize(
    ("values", "percent", "expected"),
    [
        ([7], 1, 7), ([7], 99, 7), ([1, 2, 3, 4], 50, 2), ([4, 3, 2, 1], 75, 3), ([4, 3, 2, 1], 76, 4),
        (list(range(1, 101)), 95, 95), (list(range(1, 101)), 99, 99), (list(range(1, 21)), 95, 19),
        (list(range(1, 20)), 95, 19), ([1, 2], 0, 1), ([1, 2], 100, 2),
    ],
)  # fmt: skip
def test_percentile_is_the_nearest_rank(values: list[int], percent: int, expected: int) -> None:
    assert percentile(values, percent) == expected


def test_distribution_of_values() -> None:
    assert distribution(range(200, 0, -1)) == Distribution(200, 100.5, 190, 198, 200)
    assert distribution([]) is None


def test_average_has_the_least_and_the_greatest() -> None:
    assert averaged([1.0, 5.0, 3.0]) == Averaged(3.0, 1.0, 5.0, 3)
    assert averaged([]) is None


def test_invocations_that_were_not_dispatched_have_no_end_to_end_latency() -> None:
    sent = StepTiming(step=0, outcome="allow", reason="a", validation_ns=10, end_to_end_ns=100, dispatch_ns=20)
    held = StepTiming(step=1, outcome="defer", reason="b", validation_ns=11, end_to_end_ns=None, dispatch_ns=None)
    one = replace(flight("short", 100_000, "none", 1), invocations=(sent, held))
    assert ([*end_to_end(one)], [*validation(one)], [*remaining(one)]) == ([100], [10, 11], [70])


def test_cell_average_is_over_the_deadlines_and_not_over_the_invocations() -> None:
    table = FlightTable(
        [
            timed("software", 1, 10, 20, 30),
            timed("software", 2, 40),
            timed("software", 1, 100, deadline_us=DEADLINES_US[1]),
            timed("process", 1, 9_000),
            timed("software", 1, 9_000, mission="standard"),
        ]
    )
    assert table.average("software", "short", end_to_end, p95) == Averaged(70.0, 40.0, 100.0, 2)
    assert table.average("software", "short", end_to_end, median) == Averaged(62.5, 25.0, 100.0, 2)
    assert table.average("optee", "short", end_to_end, median) is None
    assert table.spread("software", EvaluationPoint("short", DEADLINES_US[0]), end_to_end) == (
        Distribution(4, 25.0, 40, 40, 40)
    )


def test_a_repeated_flight_counts_once_by_its_first_line() -> None:
    """A flight cannot be flown again until it is quick."""
    table = FlightTable([timed("none", 1, 30), timed("none", 1, 10)])
    assert [each.invocations[0].end_to_end_ns for each in table.flights("none")] == [30]


def test_differences_are_paired_by_seed() -> None:
    point = EvaluationPoint("short", DEADLINES_US[0])
    table = FlightTable(
        [
            *(timed("software", seed, took) for seed, took in ((1, 100), (2, 200), (3, 1_000), (9, 1))),
            *(timed("optee", seed, took) for seed, took in ((3, 1_050), (1, 110), (2, 230), (8, 5_000))),
        ]
    )
    assert (
        table.added("optee", "software", point, end_to_end, median) == 30
    )  # of 10, 30 and 50; seeds 8 and 9 have no pair
    assert table.added("optee", "software", point, validation, median) == 3
    assert table.added("process", "software", point, end_to_end, median) is None
    assert table.added_average("optee", "software", "short", end_to_end, median) == Averaged(30, 30, 30, 1)
    assert table.added_average("optee", "software", "standard", end_to_end, median) is None
    assert table.added("software", "optee", point, end_to_end, median) == -30
    assert table.added("optee", "process", point, end_to_end, median) is None


def test_flatness_needs_all_three_missions() -> None:
    two = [timed("none", 1, 20), timed("none", 1, 30, mission="standard")]
    assert FlightTable(two).flatness("none") is None
    assert FlightTable([*two, timed("none", 1, 24, mission="extended")]).flatness("none") == 1.5
