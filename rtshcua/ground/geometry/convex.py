"""Grown and shrunk convex polygons, in integers: the same corners come out on every machine.

Most zones that people draw are convex. `offset` proves the results, and turns to `convolution` for all others.
"""

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import pairwise
from math import isqrt

from rtshcua.ground.geometry.shapes import Outline, Point, edges
from rtshcua.ground.geometry.vectors import dot, scaled

#: a polygon with more corners is left to `convolution`: cutting takes the square of their number
MOST_CORNERS = 64

#: a turn between two edges is rounded in steps of at most 22.5 degrees: the cosine, in thousandths
_STEP = 924

_Exact = tuple[Fraction, Fraction]


def is_convex(outline: Outline) -> bool:
    """Whether a counter-clockwise outline turns left at each corner, and is small enough for this module."""
    if len(outline.corners) > MOST_CORNERS:
        return False
    directions = [(b[0] - a[0], b[1] - a[1]) for a, b in edges(outline)]
    turns = zip(directions, [*directions[1:], directions[0]], strict=True)
    return all(u[0] * v[1] > u[1] * v[0] for u, v in turns)


def rounded(outline: Outline, distance: int) -> list[Point]:
    """Grown, with an inscribed arc around each corner."""
    corners: list[Point] = []
    for corner, before, after in _corners(outline, distance):
        corners += [(corner[0] + x, corner[1] + y) for x, y in (before, *_arc(before, after, distance), after)]
    return corners


def mitred(outline: Outline, distance: int) -> list[Point]:
    """Grown, with the edges prolonged until they meet; a corner of less than 90 degrees is cut off across."""
    corners: list[Point] = []
    for corner, before, after in _corners(outline, distance):
        normals = [before, after]
        if dot(before, after) < 0:
            normals.insert(1, scaled((before[0] + after[0], before[1] + after[1]), distance))
        for a, b in pairwise(normals):
            share = Fraction(distance * distance, distance * distance + dot(a, b))
            corners.append((corner[0] + round((a[0] + b[0]) * share), corner[1] + round((a[1] + b[1]) * share)))
    return corners


def shrunk(outline: Outline, distance: int) -> list[Point]:
    """What is at least `distance` away from every edge; no corners where there is nothing."""
    left: list[_Exact] = [(Fraction(x), Fraction(y)) for x, y in outline.corners]
    for (ax, ay), (bx, by) in edges(outline):
        dx, dy = bx - ax, by - ay
        room = isqrt(distance * distance * (dx * dx + dy * dy) - 1) + 1
        left = _cut(left, dx, dy, dx * ay - dy * ax + room)
        if not left:
            return []
    return [(round(x), round(y)) for x, y in left]


def _cut(corners: Sequence[_Exact], dx: int, dy: int, least: int) -> list[_Exact]:
    """The part of a convex polygon where `dx * y - dy * x >= least`."""
    kept: list[_Exact] = []
    for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
        over_a, over_b = dx * a[1] - dy * a[0] - least, dx * b[1] - dy * b[0] - least
        if over_a >= 0:
            kept.append(a)
        if (over_a > 0 > over_b) or (over_a < 0 < over_b):
            share = over_a / (over_a - over_b)
            kept.append((a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share))
    return kept


def _corners(outline: Outline, distance: int) -> Iterator[tuple[Point, Point, Point]]:
    """Each corner with the outward normals, of length `distance`, of the edges before and after it."""
    normals = [scaled((b[1] - a[1], a[0] - b[0]), distance) for a, b in edges(outline)]
    return zip(outline.corners, [normals[-1], *normals[:-1]], normals, strict=True)


def _arc(before: Point, after: Point, distance: int, halvings: int = 3) -> list[Point]:
    """The vectors between two of length `distance`, at most a step apart."""
    if not halvings or 1000 * dot(before, after) >= _STEP * distance * distance:
        return []
    middle = scaled((before[0] + after[0], before[1] + after[1]), distance)
    left, right = _arc(before, middle, distance, halvings - 1), _arc(middle, after, distance, halvings - 1)
    return [*left, middle, *right]
