"""Everything that lies on a straight way between two sets of places: their convex hull, widened by a box.

A zone is not cut into by a hull when the hull's edge keeps clear of all of the zone's edges, and no ring of these lies
within the hull. The first is what a sweep along the hull's edge is asked (`decision.zones`), which also says on which
side of the zone the hull is; for the second, one corner of each ring is enough to look at.
"""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import TypeAlias

from rtshcua.decision.outline import Box, rings
from rtshcua.decision.values import FALSE, TRUE, Truth
from rtshcua.decision.zones import PreparedZone, Sweep
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import CIRCLE, Zone

Point: TypeAlias = tuple[int, int]

#: a circumscribed polygon of 16 corners around a circle of radius 1,000: the corners of its first quarter
_QUARTER = ((1_020, 0), (943, 391), (722, 722), (391, 943))


def disc(radius: int) -> list[Point]:
    """The corners of a polygon that holds a circle around home; home alone where the radius is 0."""
    if not radius:
        return [(0, 0)]
    quarter = [(-(-x * radius // 1_000), -(-y * radius // 1_000)) for x, y in _QUARTER]
    turned = [[(x, y), (-y, x), (-x, -y), (y, -x)] for x, y in quarter]
    return [point for points in turned for point in points]


def hull(points: Iterable[Point]) -> list[Point]:
    """The corners of the convex hull, counter-clockwise (Andrew's monotone chain)."""
    ordered = sorted(set(points))
    if len(ordered) < 3:
        return ordered
    return [*_half(ordered)[:-1], *_half(ordered[::-1])[:-1]]


def _half(ordered: Sequence[Point]) -> list[Point]:
    chain: list[Point] = []
    for point in ordered:
        while len(chain) > 1 and _left(chain[-2], chain[-1], point) <= 0:
            chain.pop()
        chain.append(point)
    return chain


def _left(a: Point, b: Point, c: Point) -> int:
    """Above 0 where `c` lies left of the way from `a` to `b`."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


class Landmarks:
    """One place of each ring of the zones of a policy; a circle's is its centre."""

    def __init__(self, policy: Policy) -> None:
        self._zones = policy.zones
        self._found: dict[int, tuple[Point, ...]] = {}

    def zone(self, number: int) -> Zone:
        """A zone of the policy."""
        return self._zones[number]

    def of(self, number: int) -> tuple[Point, ...]:
        """The places of one zone."""
        if number not in self._found:
            zone = self._zones[number]
            if zone.shape == CIRCLE:
                self._found[number] = ((zone.data[0], zone.data[1]),)
            else:
                self._found[number] = tuple(ring[0] for ring in rings(zone))
        return self._found[number]


class Fan(Sweep):
    """A convex hull as a sweep: what it answers of a zone holds for all that is within it."""

    __slots__ = ("_corners", "_landmarks")

    def __init__(self, points: Iterable[Point], box: Box, landmarks: Landmarks) -> None:
        corners = hull(points)
        closed = [*corners, corners[0]] if len(corners) > 1 else corners
        super().__init__(tuple(coordinate for corner in closed for coordinate in corner), box)
        self._corners, self._landmarks = corners, landmarks

    def within(self, zone: PreparedZone) -> Truth:
        """Whether the places of the hull are inside the zone, whatever their height."""
        answer = super().within(zone)
        if answer == TRUE and self._landmarks.zone(zone.number).shape == CIRCLE:
            return TRUE  # a disc that holds the edge of a hull holds the hull
        if answer in (TRUE, FALSE) and any(map(self._holds, self._landmarks.of(zone.number))):
            return TRUE | FALSE
        return answer

    def _holds(self, place: Point) -> bool:
        """Whether a place is within the hull, or on its edge."""
        corners = self._corners
        if len(corners) < 3:
            return False
        return all(_left(a, b, place) >= 0 for a, b in pairwise((*corners, corners[0])))
