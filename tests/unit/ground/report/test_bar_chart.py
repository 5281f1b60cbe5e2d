"""Bars, whiskers and axes are where their values are."""

from itertools import pairwise

import pytest

from rtshcua.ground.drawing.bar_chart import (
    CHART_WIDTH,
    ChartBar,
    ChartGroup,
    StackedPart,
    StackedRow,
    bar_chart,
    stacked_chart,
)


def drawn(*values: float | None, logarithmic: bool = False) -> tuple[list[float], dict[str, float]]:
    """The ends of the bars, and the marks of the axis by their text."""
    bars = tuple(ChartBar("x", value, "v", "ours") for value in values)
    chart = bar_chart("t", "d", [ChartGroup("g", bars)], logarithmic)
    return [each.box.x + each.box.width for each in chart.bars], {words: x for x, words in chart.marks}


@pytest.mark.parametrize("logarithmic", [False, True])
def test_a_bar_ends_at_the_mark_of_its_value(logarithmic: bool) -> None:
    (one, ten, hundred), marks = drawn(1, 10, 100, logarithmic=logarithmic)
    assert hundred == pytest.approx(marks["100"])
    if logarithmic:
        assert list(marks) == ["1", "10", "100"]
        assert ten == pytest.approx(marks["10"])
        assert hundred - ten == pytest.approx(ten - marks["1"])
    else:
        assert (ten - marks["0"]) * 10 == pytest.approx(hundred - marks["0"])
    assert one <= ten <= hundred


@pytest.mark.parametrize("logarithmic", [False, True])
@pytest.mark.parametrize("values", [(), (None,), (0.0,), (5.0,), (0.003, 181.0), (-2.0, 3.0), (1e-9, 1e9)])
def test_every_value_is_within_the_page(values: tuple[float | None, ...], logarithmic: bool) -> None:
    ends, marks = drawn(*values, logarithmic=logarithmic)
    assert all(0 <= x <= CHART_WIDTH for x in (*ends, *marks.values()))
    assert len(marks) >= 2
    assert all(before < after for before, after in pairwise(marks.values()))


def test_whiskers_and_hatching() -> None:
    published = ChartBar("paper", 10.0, "10 ms", "published", 5.0, 20.0)
    chart = bar_chart("t", "d", [ChartGroup("g", (published, ChartBar("ours", 1.0, "1 ms", "ours")))])
    paper, ours = chart.bars
    assert paper.whisker is not None
    low, high = paper.whisker
    assert low < paper.box.x + paper.box.width < high < paper.told_x
    assert paper.hatch
    assert (ours.whisker, ours.hatch) == (None, "")
    assert ours.box.y > paper.box.y + paper.box.height


def test_parts_of_a_stacked_bar_lie_side_by_side_to_one_scale() -> None:
    rows = [
        StackedRow("a", (StackedPart("allow", 30, "allow 30"), StackedPart("wrong", 10, "deny 10"))),
        StackedRow("b", (StackedPart("deny", 20, "deny 20"), StackedPart("defer", 0, "defer 0"))),
    ]
    chart = stacked_chart("t", "d", rows)
    allow, wrong, deny, defer = chart.parts
    assert allow.box.x + allow.box.width == pytest.approx(wrong.box.x)
    assert wrong.box.x + wrong.box.width == pytest.approx(CHART_WIDTH - 10)
    assert deny.box.width == pytest.approx(2 * wrong.box.width)
    assert (bool(wrong.hatch), bool(allow.hatch)) == (True, False)
    assert (allow.told, defer.told) == ("allow 30", "")
    assert stacked_chart("t", "d", []).parts == ()
