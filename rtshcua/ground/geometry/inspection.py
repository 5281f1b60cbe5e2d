"""Paths along lines and around structures, with heights and the direction in which to look.

Coordinates are in mm; headings are in 1/100 degree clockwise from north, from 0 to 35999. All results are integers that
are the same on every machine: angles are computed in decimal arithmetic, as the projection is.
"""

from collections.abc import Sequence
from decimal import Decimal, localcontext
from itertools import pairwise
from math import isqrt
from typing import Final, NamedTuple

from rtshcua.ground.geometry.polygons import Point, Segment, interpolate, meet, scaled
from rtshcua.ground.geometry.projection import CONTEXT, PI, sine_of
from rtshcua.model.flat.limits import FULL

#: a whole turn, in 1/100 degree
TURN: Final = 36_000
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


def heading(x: int, y: int) -> int:
    """Return the heading of a vector, in 1/100 degree clockwise from north; 0 for none."""
    if x == 0 or y == 0:
        return 0 if x == 0 and y >= 0 else TURN // 2 if x == 0 else TURN // 4 if x > 0 else 3 * TURN // 4
    with localcontext(CONTEXT):
        turned = int((_arctangent(abs(Decimal(x)) / abs(y)) * TURN / (2 * PI)).to_integral_value())
    turned = turned if y > 0 else TURN // 2 - turned
    return (turned if x > 0 else TURN - turned) % TURN


def _arctangent(tangent: Decimal) -> Decimal:
    """Return the angle in radians of a positive tangent, to the precision of the context, by halving and a series."""
    halved = 0
    while tangent > Decimal("0.05"):
        tangent /= 1 + (1 + tangent * tangent).sqrt()
        halved += 1
    term = total = tangent
    n = 1
    while abs(term) > Decimal("1e-38"):
        term *= -tangent * tangent
        n += 2
        total += term / n
    return total * Decimal(2**halved)


def levels(lowest: int, highest: int, spacing: int) -> tuple[int, ...]:
    """Return heights from the lowest to the highest, evenly spaced and at most `spacing` (above 0) apart."""
    count = -(-(highest - lowest) // spacing)
    return (
        tuple(lowest + (highest - lowest) * number // count for number in range(count + 1)) if count > 0 else (lowest,)
    )


def face_levels(lowest: int, highest: int, extent: int, overlap: int) -> tuple[int, ...]:
    """Return the heights of the passes over a face, whose pictures of this extent upwards overlap by a share.

    `extent` is in mm, rounded down, and `overlap` in 1/10000, below 10000.
    """
    return levels(lowest, highest, max(extent * (FULL - overlap) // FULL, 1))


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
    return [ViewPoint(x + dx, y + dy, height, heading(-dx, -dy)) for height in heights for dx, dy in ring]


def _rounded(value: Decimal) -> int:
    return int(value.to_integral_value())


def face_scan(face: tuple[Point, Point], distance: int, heights: Sequence[int]) -> list[ViewPoint]:
    """Return passes to and fro along a straight face, one at each height, `distance` to the left of it.

    The vehicle looks at the face, to the right of its line.
    """
    (ax, ay), (bx, by) = face
    facing = heading(by - ay, ax - bx)
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
