"""Drawings of the survey patterns over a sample area, made with the real planner."""

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import hypot
from typing import Final

from rtshcua.ground.drawing.canvas import number
from rtshcua.ground.geometry.shapes import SimplePolygon
from rtshcua.ground.geometry.survey import survey

#: the sample area in mm, counter-clockwise; the altitude and the distance to its edge; its entry
_AREA: Final = ((0, 0), (120_000, 0), (150_000, 55_000), (120_000, 90_000), (0, 90_000))
_HEIGHT, _INSET, _ENTRY = 20_000, 3_000, (5_000, 5_000)
#: px
_WIDTH, _TALL, _MARGIN, _ARROW = 320, 208, 14, 7.0


@dataclass(frozen=True, slots=True)
class Pattern:
    """A drawing: the outline of the area and the path as points, its begin, and arrows as SVG paths."""

    width: int
    height: int
    area: str
    way: str
    start: tuple[float, float]
    arrows: tuple[str, ...]


@cache
def drawn(name: str) -> Pattern:
    """Draw a pattern by its name."""
    way = survey(SimplePolygon(_AREA), name, _HEIGHT, _INSET, _ENTRY)
    assert way is not None
    scale = (_WIDTH - 2 * _MARGIN) / max(x for x, _ in _AREA)

    def at(x: int, y: int) -> tuple[float, float]:
        return _MARGIN + x * scale, _TALL - _MARGIN - y * scale

    points = [at(*each) for each in way]
    legs = list(pairwise(points))
    shown = legs[:: max(1, len(legs) // 5)]
    return Pattern(
        _WIDTH,
        _TALL,
        _line([at(*each) for each in _AREA]),
        _line(points),
        points[0],
        tuple(_arrow(*leg) for leg in shown),
    )


def _line(points: list[tuple[float, float]]) -> str:
    return " ".join(f"{number(x)},{number(y)}" for x, y in points)


def _arrow(start: tuple[float, float], end: tuple[float, float]) -> str:
    """An arrow head in the middle of a leg, as an SVG path."""
    along = hypot(end[0] - start[0], end[1] - start[1])
    dx, dy = (end[0] - start[0]) / along * _ARROW, (end[1] - start[1]) / along * _ARROW
    x, y = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
    tip, left, right = (x + dx, y + dy), (x - dx - dy / 2, y - dy + dx / 2), (x - dx + dy / 2, y - dy - dx / 2)
    return "M" + "L".join(f"{number(px)} {number(py)}" for px, py in (tip, left, right)) + "Z"
