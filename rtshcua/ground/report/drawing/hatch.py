"""Hatching: what is forbidden is told by lines, not by a colour alone."""

from rtshcua.ground.report.drawing.canvas import number
from rtshcua.ground.report.drawing.labels import Box

#: px between two lines, across
_SPACING = 11


def hatching(box: Box, width: float, height: float) -> str:
    """Lines that rise to the right, over what of a box lies on a page of some size, as the `d` of an SVG path."""
    left, right = max(box.x, 0.0), min(box.x + box.width, width)
    top, bottom = max(box.y, 0.0), min(box.y + box.height, height)
    if left >= right or top >= bottom:
        return ""
    lines = []
    for step in range(int((left + top) // _SPACING), int((right + bottom) // _SPACING) + 1):
        total = step * _SPACING  # x + y is the same all along a line
        x0, x1 = max(left, total - bottom), min(right, total - top)
        if x0 < x1:
            lines.append(f"M{number(x0)} {number(total - x0)}L{number(x1)} {number(total - x1)}")
    return "".join(lines)
