"""Charts over time: one axis for all, broken lines, limits, and thinning that loses no extreme."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.ground.drawing.canvas import WIDTH
from rtshcua.ground.drawing.time_charts import (
    LEFT,
    RIGHT,
    ChartLimit,
    ChartLine,
    Lane,
    LaneEvent,
    axis_of,
    clock,
    lane_chart,
    thinned,
    time_chart,
)

S = 1_000_000
POINTS = st.lists(st.tuples(st.integers(0, 10**9), st.none() | st.integers(-(10**6), 10**6)), max_size=400).map(
    lambda found: sorted(found, key=lambda each: each[0])
)


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0, "0:00"), (42, "0:42"), (61, "1:01"), (3_600, "1:00:00"), (7_384, "2:03:04"), (-5, "-0:05")],
)
def test_clock(seconds: int, text: str) -> None:
    assert clock(seconds) == text


def test_axis_begins_left_and_ends_right() -> None:
    axis = axis_of(-2 * S, 58 * S)
    assert axis.at(-2 * S) == LEFT
    assert axis.at(58 * S) == WIDTH - RIGHT
    assert axis.at(28 * S) == (LEFT + WIDTH - RIGHT) / 2
    assert axis.at(900 * S) == axis.at(58 * S)
    assert [words for _, words in axis.marks] == ["0:00", "0:10", "0:20", "0:30", "0:40", "0:50"]


@given(st.integers(-(10**7), 10**7), st.integers(0, 10**11), st.sampled_from([520, WIDTH]))
def test_marks_are_few_and_on_the_axis(start: int, length: int, width: int) -> None:
    axis = axis_of(start, start + length)._replace(width=width)
    assert len(axis.marks) <= 11
    assert all(LEFT <= x <= width - RIGHT for x, _ in axis.marks)


@given(POINTS, st.integers(4, 100))
def test_thinning_keeps_extremes_and_order(points: list[tuple[int, int | None]], most: int) -> None:
    kept = thinned(points, most)
    assert set(kept) <= set(points)
    assert [t for t, _ in kept] == sorted(t for t, _ in kept)
    values = [value for _, value in points if value is not None]
    if values:
        left = [value for _, value in kept if value is not None]
        assert (min(left), max(left)) == (min(values), max(values))


def test_thinning_is_of_bounded_length() -> None:
    points: list[tuple[int, int | None]] = [(at, at % 97) for at in range(100_000)]
    assert 900 <= len(thinned(points, 1_000)) <= 1_001
    assert thinned(points[:1_000], 1_000) == points[:1_000]


def test_line_breaks_where_a_value_is_unknown_and_where_none_came() -> None:
    points = [(0, 1.0), (S, 2.0), (2 * S, None), (3 * S, 1.0), (90 * S, 1.0)]
    chart = time_chart("battery", "", "%", axis_of(0, 100 * S), [ChartLine("signal", "", points)])
    assert chart.lines[0].d.count("M") == 3


def test_limit_is_shaded_on_the_side_that_is_forbidden() -> None:
    points = [(0, 30.0), (S, 60.0)]
    limits = [ChartLimit(40, "at least 40", low=True), ChartLimit(55, "at most 55", low=False)]
    chart = time_chart("x", "", "%", axis_of(0, S), [ChartLine("signal", "", points)], limits)
    (low, _, low_edge), (high, _, high_edge) = chart.limits
    assert low > high  # a greater value is higher on the page
    assert (low_edge, high_edge) == (chart.bottom, chart.top)


def test_limit_far_from_the_values_is_told_and_not_drawn() -> None:
    limit = ChartLimit(1_000_000, "at most a million", low=False)
    chart = time_chart("x", "", "", axis_of(0, S), [ChartLine("signal", "", [(0, 1.0)])], [limit])
    assert chart.limits == ()
    assert chart.described == ("at most a million",)


def test_enumeration_is_drawn_in_steps_with_its_labels() -> None:
    points = [(0, 1.0), (S, 2.0)]
    labels = {1: "on_ground", 2: "in_air"}
    chart = time_chart("landed", "", "", axis_of(0, 2 * S), [ChartLine("signal", "", points)], labels=labels)
    assert [words for _, words in chart.marks] == ["on_ground", "in_air"]
    assert re.fullmatch(r"M[\d. ]+H[\d.]+V[\d.]+", chart.lines[0].d)


def test_events_are_at_their_times_in_their_lanes() -> None:
    lanes = [Lane("decided", [LaneEvent(S, None, "allow", "a")]), Lane("flown", [LaneEvent(S, 3 * S, "step", "b")])]
    chart = lane_chart("t", "", axis_of(0, 4 * S), lanes)
    moment, bar = chart.events
    assert (moment.x, moment.width) == (bar.x, 0.0)
    assert bar.width == pytest.approx((WIDTH - LEFT - RIGHT) / 2)
    assert moment.y < bar.y
