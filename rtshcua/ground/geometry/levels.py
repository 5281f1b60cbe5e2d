"""Survey paths at several heights, and with the nose towards the middle of the path, in integers.

The heights are evenly spaced. A closed path is flown once at each height, and the vehicle climbs where it begins. An
open one is flown to and fro.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

from rtshcua.ground.geometry.polygons import Point, doubled_area, sides
from rtshcua.model.flat.mission import ALONG, TURN

#: the least distance of two heights, mm: the vehicle counts as arrived within 1.5 m of a height
LEAST_STEP: Final = 2_000
#: the patterns with a middle, or a face, to look at
INWARD: Final = ("perimeter", "orbit", "around", "face")
#: arc tangents of 1, 1/2, 1/4, ... in 1/2**`_SHIFT` of 1/100 degree
_ARCS: Final = (
    1207959552000, 713100162638, 376782541584, 191260701262, 96001494876, 48047547032, 24029636310, 12015551407,
    6007867372, 3003945145, 1501974005, 750987182, 375493613, 187746809, 93873405, 46936703, 23468351, 11734176,
    5867088, 2933544, 1466772, 733386, 366693, 183346, 91673, 45837, 22918, 11459,
)  # fmt: skip
_SHIFT: Final = 28
#: the vector is scaled by this first, because each halving loses a bit
_SPARE: Final = 32


class LevelledPath(NamedTuple):
    """The points of a path, and for each its height in mm and its heading in 1/100 degree; empty as in a `Plan`."""

    points: tuple[Point, ...]
    heights: tuple[int, ...] = ()
    headings: tuple[int, ...] = ()


def heights_between(lowest: int, highest: int, every: int) -> tuple[int, ...]:
    """Return evenly spaced heights from the lowest to the highest, at most `every` (above 0) apart."""
    count = -(-(highest - lowest) // every)
    return tuple(lowest + (highest - lowest) * number // count for number in range(count + 1)) if count else (lowest,)


def levelled(points: Sequence[Point], heights: Sequence[int], headings: Sequence[int] = ()) -> LevelledPath:
    """Return a path that is flown once at each height, or at the altitude of its step if there is none. `headings` are
    those of one round, or empty.
    """
    closed = points[0] == points[-1]
    way: list[Point] = []
    turns: list[int] = []
    for number in range(len(heights) or 1):
        onward = closed or number % 2 == 0
        way += points if onward else points[::-1]
        turns += headings if onward else headings[::-1]
    return LevelledPath(tuple(way), tuple(height for height in heights for _ in points), tuple(turns))


def inward(points: Sequence[Point]) -> tuple[int, ...]:
    """Return the heading at each point of a closed path to its middle."""
    x, y = middle(points)
    return tuple(bearing(x - east, y - north) for east, north in points)


def middle(points: Sequence[Point]) -> Point:
    """Return the centroid of the area within a closed path; of a path without an area, the middle of its corners."""
    area = 3 * doubled_area(points)
    if area == 0:
        return sum(x for x, _ in points) // len(points), sum(y for _, y in points) // len(points)
    sums = [0, 0]
    for (ax, ay), (bx, by) in sides(points):
        cross = ax * by - bx * ay
        sums[0] += (ax + bx) * cross
        sums[1] += (ay + by) * cross
    return sums[0] // area, sums[1] // area


def bearing(east: int, north: int) -> int:
    """Return the direction of a vector, 1/100 degree clockwise from north, to the nearest; `ALONG` for none.

    The vector is turned by ever smaller arcs until it points north (CORDIC).
    """
    if (east, north) == (0, 0):
        return ALONG
    x, y, turned = east << _SPARE, north << _SPARE, 0
    if y < 0:
        x, y, turned = -x, -y, (TURN // 2) << _SHIFT
    for number, arc in enumerate(_ARCS):
        if x > 0:
            x, y, turned = x - (y >> number), y + (x >> number), turned + arc
        else:
            x, y, turned = x + (y >> number), y - (x >> number), turned - arc
    return ((turned + (1 << _SHIFT - 1)) >> _SHIFT) % TURN
