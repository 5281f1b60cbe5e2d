"""Paths along lines and around structures, with heights and the direction in which to look.

Coordinates are in mm; headings are in 1/100 degree clockwise from north, from 0 to 35999. All results are integers that
are the same on every machine: angles are computed in decimal arithmetic, as the projection is.
"""

from collections.abc import Sequence
from decimal import Decimal, localcontext
from itertools import pairwise
from math import isqrt
from typing import Final, NamedTuple

from rtshcua.ground.geometry.levels import bearing
from rtshcua.ground.geometry.polygons import Point, Segment, interpolate, meet, scaled
from rtshcua.ground.geometry.projection import CONTEXT, PI, sine_of

#: the fewest legs of an orbit
LEAST_LEGS: Final = 3


class ViewPoint(NamedTuple):
    """A place and a height in mm, and the heading in which to look, in 1/100 degree clockwise from north."""

    x: int
    y: int
    z: int
    facing: int


class CentreLine(NamedTuple):
    """The line through the places of a corridor, and half of its width in mm."""

    points: tuple[Point, ...]
    half: int


def orbit(centre: Point, radius: int, heights: Sequence[int], legs: int) -> list[ViewPoint]:
    """Return closed rounds of straight legs around a circle, counter-clockwise from the east, one at each height.

    The legs touch the circle and never enter it. The vehicle looks at the centre.
    """
    x, y = centre
    with localcontext(CONTEXT):
        step = 2 * PI / max(legs, LEAST_LEGS)
        reach = (radius + 2) / sine_of(PI / 2 - step / 2)  # 2 mm for the rounding of both ends
        angles = [step * number for number in range(max(legs, LEAST_LEGS))]
        turned = [angle if angle <= PI else angle - 2 * PI for angle in angles]
        corners = [
            (_rounded(reach * sine_of(PI / 2 - abs(angle))), _rounded(reach * sine_of(angle))) for angle in turned
        ]
    ring = [*corners, corners[0]]
    return [ViewPoint(x + dx, y + dy, height, bearing(-dx, -dy)) for height in heights for dx, dy in ring]


def _rounded(value: Decimal) -> int:
    return int(value.to_integral_value())


def face_heading(start: Point, end: Point) -> int:
    """Return the heading to a face from its left, in 1/100 degree."""
    return bearing(end[1] - start[1], start[0] - end[0])


def face_scan(face: tuple[Point, Point], distance: int, heights: Sequence[int]) -> list[ViewPoint]:
    """Return passes to and fro along a straight face, one at each height, `distance` to the left of it.

    The vehicle looks at the face, to the right of its line.
    """
    facing = face_heading(*face)
    ends = _beside(*face, distance + 1)  # for the rounding
    return [
        ViewPoint(*end, height, facing)
        for number, height in enumerate(heights)
        for end in (ends[::-1] if number % 2 else ends)
    ]


def parallel_lines(line: CentreLine, inset: int, spacing: int, most: int) -> list[list[Point]] | None:
    """Return lines along a corridor, evenly spaced and at most `spacing` apart, to and fro; None if it is too narrow.

    The first and the last are half a spacing inside of the corridor less `inset` on both sides. At the outside of a
    bend a line has two corners, so that it never leaves the corridor. There are at most `most` lines.
    """
    room = line.half - inset
    if room <= 0:
        return None
    count = line_count(room, spacing, most)
    lines = []
    for number in range(count):
        aside = (2 * number + 1) * room // count - room
        one = _joined([_beside(*leg, aside) for leg in pairwise(line.points)])
        lines.append(one[::-1] if number % 2 else one)
    return lines


def _joined(legs: Sequence[Segment]) -> list[Point]:
    """Return the line along legs, each of which ends where it meets the next one, if it does."""
    corners = [legs[0][0]]
    for (a, b), (c, d) in pairwise(legs):
        along, turned = (b[0] - a[0], b[1] - a[1]), (d[0] - c[0], d[1] - c[1])
        cross = along[0] * turned[1] - along[1] * turned[0]
        if cross and meet(a, b, c, d):
            over = (c[0] - a[0]) * turned[1] - (c[1] - a[1]) * turned[0]
            corners.append((interpolate(a[0], b[0], over, cross), interpolate(a[1], b[1], over, cross)))
        else:
            corners += [b, c]
    return [*corners, legs[-1][1]]


def _beside(a: Point, b: Point, aside: int) -> tuple[Point, Point]:
    """Return a leg moved to its left by `aside` mm, or to its right if negative."""
    sign = 1 if aside >= 0 else -1
    x, y = scaled((sign * (a[1] - b[1]), sign * (b[0] - a[0])), abs(aside))
    return (a[0] + x, a[1] + y), (b[0] + x, b[1] + y)


def line_count(room: int, spacing: int, most: int) -> int:
    """Return the number of lines in a corridor with `room` on both sides of its centre line."""
    return min(max(1, -(-2 * room // spacing)), most)


def reach_of(ring: Sequence[Point], centre: Point) -> int:
    """Return the radius of the smallest circle around a centre that encloses a ring, in whole mm."""
    return max(isqrt((x - centre[0]) ** 2 + (y - centre[1]) ** 2) + 1 for x, y in ring)
