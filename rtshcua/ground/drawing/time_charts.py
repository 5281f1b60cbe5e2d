"""Drawings over a common time axis: lines of values with their limits, and lanes of events.

Each drawing says where on it the axis begins and ends (`TimeAxis.span`), so that one cursor serves them all.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import ceil, floor, log10
from typing import Final, NamedTuple

from rtshcua.ground.drawing.canvas import LETTER, WIDTH, number

#: px: the margins beside the axis, the room for its labels, and the size of a lane
LEFT, RIGHT, _TOP, _FOOT, LANE, _PLOT = 106, 58, 12, 24, 24, 120
#: intervals of marks on the time axis, s
_INTERVALS: Final = (1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1_800, 3_600, 7_200, 14_400)
_MOST_MARKS: Final = 9
_STEPS: Final = (1.0, 2.0, 5.0, 10.0)
#: a line is not broken by less than this share of the axis
_BREAK: Final = 40


class TimeAxis(NamedTuple):
    """An axis from one time to another, in us, on a drawing of a width in px."""

    from_us: int
    to_us: int
    width: int = WIDTH

    def at(self, t_us: int) -> float:
        """The place of a time on the page; of one outside of the axis, its nearer end."""
        share = (t_us - self.from_us) / (self.to_us - self.from_us)
        return LEFT + min(max(share, 0.0), 1.0) * (self.width - LEFT - RIGHT)

    @property
    def span(self) -> tuple[float, float, int, int]:
        """The places of the begin and the end on the page, and their times in ms."""
        return LEFT, self.width - RIGHT, self.from_us // 1_000, self.to_us // 1_000

    @property
    def marks(self) -> tuple[tuple[float, str], ...]:
        """Round times with their places and words."""
        span_s, most = (self.to_us - self.from_us) / 1_000_000, _MOST_MARKS * self.width // WIDTH
        step = next((each for each in _INTERVALS if span_s / each <= most), ceil(span_s / most))
        first, last = -(-self.from_us // 1_000_000) // step, self.to_us // 1_000_000 // step
        times = [each * step for each in range(first, last + 1) if each * step * 1_000_000 >= self.from_us]
        return tuple((self.at(1_000_000 * each), clock(each)) for each in times)


def axis_of(from_us: int, to_us: int) -> TimeAxis:
    """The axis of a flight; at least a second long."""
    return TimeAxis(from_us, max(to_us, from_us + 1_000_000))


def clock(seconds: int) -> str:
    """A time since the beginning: `0:42`, `1:02:03`."""
    sign, seconds = "-" * (seconds < 0), abs(seconds)
    hours, minutes = seconds // 3_600, seconds // 60 % 60
    return f"{sign}{hours}:{minutes:02}:{seconds % 60:02}" if hours else f"{sign}{minutes}:{seconds % 60:02}"


class ChartLine(NamedTuple):
    """A line of a chart: its style and words, and its values over time. None breaks it, and so does a time without a
    value that is longer than `gap_us` and than a small part of the axis.
    """

    kind: str
    told: str
    points: Sequence[tuple[int, float | None]]
    gap_us: int = 2_000_000


class ChartLimit(NamedTuple):
    """A limit of the values: `low` means that they must not be below it."""

    value: float
    told: str
    low: bool


def line_gap_us(gap_us: int, axis: TimeAxis) -> int:
    """The time without a value after which a line is broken."""
    return max(gap_us, (axis.to_us - axis.from_us) // _BREAK)


class DrawnLine(NamedTuple):
    """A line on the page, as the `d` of an SVG path."""

    kind: str
    told: str
    d: str


class TimeChart(NamedTuple):
    """A chart on the page. `marks` are places of values with their words, `limits` those in the chart, each with its
    other edge, and `described` the words of all.
    """

    title: str
    description: str
    unit: str
    height: float
    top: float
    bottom: float
    axis: TimeAxis
    marks: tuple[tuple[float, str], ...]
    lines: tuple[DrawnLine, ...]
    limits: tuple[tuple[float, str, float], ...]
    described: tuple[str, ...]


def time_chart(
    title: str, description: str, unit: str, axis: TimeAxis, lines: Sequence[ChartLine],
    limits: Sequence[ChartLimit] = (), labels: Mapping[int, str] | None = None,
) -> TimeChart:  # fmt: skip
    """Draw lines over time. `labels` name the values of an enumeration."""
    values = [value for line in lines for _, value in line.points if value is not None]
    bounds = [limit.value for limit in limits if _is_near(limit.value, values)]
    ticks = list(map(float, sorted(labels))) if labels else _ticks([*values, *bounds])
    low, high = ticks[0], max(ticks[-1], ticks[0] + 1e-9)
    top, bottom = float(_TOP), float(_TOP + _PLOT)

    def at(value: float) -> float:
        return bottom - (value - low) / (high - low) * _PLOT

    stepped = labels is not None
    drawn = (DrawnLine(line.kind, line.told, "".join(_path(axis, line, at, stepped=stepped))) for line in lines)
    shown = (
        (at(limit.value), limit.told, bottom if limit.low else top) for limit in limits if low <= limit.value <= high
    )
    words = [_cut(labels[int(each)], LEFT - 12) if labels else f"{each:,.10g}" for each in ticks]
    return TimeChart(
        title, description, unit, bottom + _FOOT, top, bottom, axis,
        tuple(zip(map(at, ticks), words, strict=True)), tuple(drawn), tuple(shown),
        tuple(limit.told for limit in limits),
    )  # fmt: skip


def _is_near(limit: float, values: Sequence[float]) -> bool:
    """Whether a limit is so near to the values that it is shown with them."""
    if not values:
        return True
    low, high = min(values), max(values)
    span = max(high - low, abs(high) / 4, 1e-9)
    return low - 2 * span <= limit <= high + 2 * span


def _ticks(values: Sequence[float]) -> list[float]:
    """Round values around all of these, about four."""
    low, high = min(values, default=0.0), max(values, default=1.0)
    span = (high - low) or abs(high) / 10 or 1.0
    power: float = 10.0 ** floor(log10(span / 4))
    step = next(each * power for each in _STEPS if each * power * 4.01 >= span)
    first, last = floor(low / step + 1e-9), ceil(high / step - 1e-9)
    last = max(last, first + 1)
    return [round(each * step, 9) for each in range(first, last + 1)]


def _cut(text: str, width: float) -> str:
    letters = int(width / LETTER)
    return text if len(text) <= letters else f"{text[: letters - 1]}…"


def _path(axis: TimeAxis, line: ChartLine, at: Callable[[float], float], *, stepped: bool) -> Iterator[str]:
    gap_us = line_gap_us(line.gap_us, axis)
    before: tuple[int, float] | None = None
    for t_us, value in line.points:
        if value is None:
            before = None
            continue
        x, y = number(axis.at(t_us)), number(at(value))
        if before is None or t_us - before[0] > gap_us:
            yield f"M{x} {y}"
        else:
            yield f"H{x}V{y}" if stepped else f"L{x} {y}"
        before = t_us, value


def thinned(points: Sequence[tuple[int, int | None]], most: int) -> list[tuple[int, int | None]]:
    """At most about `most` points of a series; of each group the least and the greatest value stay, and every change to
    and from unknown.
    """
    if len(points) <= most:
        return list(points)
    size = -(-2 * len(points) // most)
    kept: list[tuple[int, int | None]] = []
    for start in range(0, len(points), size):
        group = points[start : start + size]
        known = [each for each in group if each[1] is not None]
        chosen = {min(known, key=_value), max(known, key=_value)} if known else set()
        unknown = [each for before, each in zip((None, *group), group, strict=False)
                   if each[1] is None and (before is None or before[1] is not None)]  # fmt: skip
        kept += sorted({*chosen, *unknown}, key=lambda each: each[0])
    return kept


def _value(point: tuple[int, int | None]) -> int:
    assert point[1] is not None
    return point[1]


class LaneEvent(NamedTuple):
    """An event of a lane: its time, its end if it lasts, a class of the style, its words, and what it links to."""

    from_us: int
    to_us: int | None
    kind: str
    told: str
    anchor: str = ""


class Lane(NamedTuple):
    """A lane with its events, in order."""

    name: str
    events: Sequence[LaneEvent]


class DrawnEvent(NamedTuple):
    """An event on the page; `width` is 0 for a moment."""

    event: LaneEvent
    x: float
    y: float
    width: float


class LaneChart(NamedTuple):
    """Lanes on the page, with the height of the middle of each."""

    title: str
    description: str
    height: float
    axis: TimeAxis
    names: tuple[tuple[float, str], ...]
    events: tuple[DrawnEvent, ...]


def lane_chart(title: str, description: str, axis: TimeAxis, lanes: Sequence[Lane]) -> LaneChart:
    """Draw lanes of events, the first at the top."""
    names: list[tuple[float, str]] = []
    events: list[DrawnEvent] = []
    for at, lane in enumerate(lanes):
        y = _TOP + (at + 0.5) * LANE
        names.append((y, lane.name))
        for event in lane.events:
            x = axis.at(event.from_us)
            width = 0.0 if event.to_us is None else max(axis.at(event.to_us) - x, 2.0)
            events.append(DrawnEvent(event, x, y, width))
    return LaneChart(title, description, _TOP + len(lanes) * LANE + _FOOT, axis, tuple(names), tuple(events))
