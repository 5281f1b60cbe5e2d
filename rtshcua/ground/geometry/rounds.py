"""Discs as convex polygons with integer corners, within the disc or around it, and what is drawn with them.

The corners come from halving a quarter turn with integer roots: the same on every machine.
"""

from collections.abc import Sequence
from functools import cache
from itertools import pairwise

from rtshcua.ground.geometry.distance import far
from rtshcua.ground.geometry.shapes import Point, Ring
from rtshcua.ground.geometry.vectors import scaled

#: halvings of a quarter turn: 128 corners, between which an arc is at most 0.031 % of the radius from its chord
FINE = 5
#: 64 corners: 0.121 %; 16 corners: 1.93 %
COARSE, ROUGH = 4, 2
_SCALE = 1 << 40


def within_disc(center: Point, radius: int, halvings: int = FINE) -> Ring:
    """A polygon within a disc, counter-clockwise; no edge is further than 0.031 % of the radius and 2 mm inside."""
    return _moved(_hull([_shrunk(each, radius) for each in _corners(halvings)]), center)


@cache
def around_disc(radius: int, halvings: int = COARSE) -> Ring:
    """A polygon around a disc at the origin: its corners are 0.13 % of the radius and a few mm further out, 2 % if it
    is rough.
    """
    reach = radius + radius // (800 if halvings > ROUGH else 50) + 2
    while True:
        ring = tuple(_hull([_shrunk(each, reach) for each in _corners(halvings)]))
        if all(far((0, 0), edge, radius) for edge in pairwise((*ring, ring[0]))):
            return ring
        reach += 1 + radius // 10_000


def _shrunk(unit: Point, radius: int) -> Point:
    """A corner on a circle, rounded towards its centre."""
    x, y = abs(unit[0]) * radius // _SCALE, abs(unit[1]) * radius // _SCALE
    return (x if unit[0] >= 0 else -x), (y if unit[1] >= 0 else -y)


@cache
def _corners(halvings: int) -> tuple[Point, ...]:
    """The corners of a regular polygon in a circle of radius `_SCALE`, counter-clockwise from east."""
    quarter: list[Point] = [(_SCALE, 0), (0, _SCALE)]
    for _ in range(halvings):
        halved = [quarter[0]]
        for a, b in pairwise(quarter):
            halved += [scaled((a[0] + b[0], a[1] + b[1]), _SCALE), b]
        quarter = halved
    quarter.pop()
    return (
        *quarter,
        *((-y, x) for x, y in quarter),
        *((-x, -y) for x, y in quarter),
        *((y, -x) for x, y in quarter),
    )


def _hull(points: Sequence[Point]) -> list[Point]:
    """The strictly convex hull, counter-clockwise (Andrew's monotone chain); one point for a single place."""
    ordered = sorted(set(points))
    if len(ordered) < 3:
        return ordered
    chains: list[list[Point]] = []
    for each in (ordered, ordered[::-1]):
        chain: list[Point] = []
        for point in each:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0:
                chain.pop()
            chain.append(point)
        chains.append(chain[:-1])
    return chains[0] + chains[1]


def _turn(a: Point, b: Point, c: Point) -> int:
    return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])


def _moved(ring: Sequence[Point], by: Point) -> Ring:
    return tuple((x + by[0], y + by[1]) for x, y in ring)
