"""Charts of horizontal bars: with whiskers on a linear or logarithmic axis, or stacked from parts.

Each bar has its label to the left and its value in words to the right, so that a chart needs no legend and prints
without colours. The templates are `bar_chart.svg` and `stacked_chart.svg`.
"""

from collections.abc import Callable, Sequence
from math import ceil, floor, log10
from typing import Final, NamedTuple

from rtshcua.ground.drawing.canvas import LETTER, LINE, LabelBox, hatching

#: px
CHART_WIDTH: Final = 760
_ROW, _BAR, _HEAD, _FOOT, _EDGE, _SPACE, _LEAST = 20, 13, 24, 26, 10, 6, 1.5
#: the steps of a linear axis, as multiples of a power of ten
_STEPS: Final = (1, 2, 5, 10)


class ChartBar(NamedTuple):
    """A bar: its label, its value (None: only words), the words beside it, and its whiskers if it has any.

    `kind` is a class of the style; bars of kind `published` are hatched.
    """

    label: str
    value: float | None
    told: str
    kind: str
    low: float | None = None
    high: float | None = None


class ChartGroup(NamedTuple):
    """Bars under a common name."""

    name: str
    bars: tuple[ChartBar, ...]


class DrawnBar(NamedTuple):
    """A bar on the page; `whisker` has its left and right end."""

    bar: ChartBar
    box: LabelBox
    hatch: str
    whisker: tuple[float, float] | None
    told_x: float


class BarChart(NamedTuple):
    """A chart on the page: `marks` of the axis with their text, `names` of groups with their height."""

    title: str
    description: str
    height: float
    left: float
    marks: tuple[tuple[float, str], ...]
    names: tuple[tuple[float, str], ...]
    bars: tuple[DrawnBar, ...]
    width: int = CHART_WIDTH


def bar_chart(title: str, description: str, groups: Sequence[ChartGroup], logarithmic: bool = False) -> BarChart:
    """Draw groups of bars. A value that a logarithmic axis does not have is drawn at its start."""
    everything = [bar for group in groups for bar in group.bars]
    left = _EDGE + LETTER * max((len(bar.label) for bar in everything), default=0) + _SPACE
    right = CHART_WIDTH - _EDGE - LETTER * max((len(bar.told) for bar in everything), default=0) - _SPACE
    values = [each for bar in everything for each in (bar.value, bar.low, bar.high) if each is not None]
    ends = _decades(values) if logarithmic else _linear(values)

    def at(value: float) -> float:
        share = (log10(max(value, ends[0])) - log10(ends[0])) / (log10(ends[-1]) - log10(ends[0])) if logarithmic else (
            (value - ends[0]) / (ends[-1] - ends[0])
        )  # fmt: skip
        return left + max(share, 0.0) * (right - left)

    drawn: list[DrawnBar] = []
    names: list[tuple[float, str]] = []
    y = float(_EDGE)
    for group in groups:
        names.append((y + LINE, group.name))
        y += _HEAD
        for bar in group.bars:
            drawn.append(_drawn(bar, left, y, at))
            y += _ROW
    marks = tuple((at(each), f"{each:,.10g}") for each in ends)
    return BarChart(title, description, y + _FOOT, left, marks, tuple(names), tuple(drawn))


def _drawn(bar: ChartBar, left: float, y: float, at: Callable[[float], float]) -> DrawnBar:
    end = left if bar.value is None else at(bar.value)
    box = LabelBox(left, y + (_ROW - _BAR) / 2, 0.0 if bar.value is None else max(end - left, _LEAST), _BAR)
    whisker = None if bar.low is None or bar.high is None else (at(bar.low), at(bar.high))
    hatch = hatching(box, CHART_WIDTH, y + _ROW) if bar.kind == "published" else ""
    return DrawnBar(bar, box, hatch, whisker, max(end, whisker[1] if whisker else 0.0) + _SPACE)


def _decades(values: Sequence[float]) -> list[float]:
    """The powers of ten around all positive values, at least two."""
    positive = [each for each in values if each > 0] or [1.0]
    first, last = floor(log10(min(positive))), ceil(log10(max(positive)))
    return [10.0**power for power in range(first, max(last, first + 1) + 1)]


def _linear(values: Sequence[float]) -> list[float]:
    """Round values from at most zero to at least the greatest, about six."""
    low, high = min([0.0, *values]), max([*values, 0.0])
    span = (high - low) or 1.0
    power: float = 10.0 ** floor(log10(span / 6))
    step = next(each * power for each in _STEPS if each * power * 6 >= span)
    first, last = floor(low / step), max(ceil(high / step), 1)
    return [number * step for number in range(first, last + 1)]


class StackedPart(NamedTuple):
    """A part of a stacked bar: a class of the style, its size, and its words."""

    kind: str
    size: int
    told: str


class StackedRow(NamedTuple):
    """A stacked bar."""

    label: str
    parts: tuple[StackedPart, ...]


class DrawnPart(NamedTuple):
    """A part on the page; `told` is empty where the words have no room. A part of kind `wrong` is hatched."""

    part: StackedPart
    box: LabelBox
    hatch: str
    told: str


class StackedChart(NamedTuple):
    """A chart of stacked bars on the page; `labels` with their height."""

    title: str
    description: str
    height: float
    left: float
    labels: tuple[tuple[float, str], ...]
    parts: tuple[DrawnPart, ...]
    width: int = CHART_WIDTH


def stacked_chart(title: str, description: str, rows: Sequence[StackedRow]) -> StackedChart:
    """Draw rows of parts, all to the scale of the longest row."""
    left = _EDGE + LETTER * max((len(row.label) for row in rows), default=0) + _SPACE
    most = max((sum(part.size for part in row.parts) for row in rows), default=0) or 1
    scale = (CHART_WIDTH - _EDGE - left) / most
    parts: list[DrawnPart] = []
    labels: list[tuple[float, str]] = []
    for number, row in enumerate(rows):
        y, x = _EDGE + number * (_ROW + 2.0), left
        labels.append((y + LINE - 2, row.label))
        for part in row.parts:
            box = LabelBox(x, y, part.size * scale, _ROW)
            hatch = hatching(box, CHART_WIDTH, y + _ROW) if part.kind == "wrong" else ""
            parts.append(DrawnPart(part, box, hatch, part.told if LETTER * len(part.told) + 4 < box.width else ""))
            x += box.width
    height = 2 * _EDGE + len(rows) * (_ROW + 2.0)
    return StackedChart(title, description, height, left, tuple(labels), tuple(parts))
