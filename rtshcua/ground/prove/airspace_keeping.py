"""Decide whether a part of a path stays in the airspace, and describe where it leaves it.

The straight paths between two sets of places lie in their convex hull, widened by a box. The hull does not cut into a
zone if its edge does not cross the zone's edges and no ring of the zone lies within the hull. A sweep along the hull's
edge (`decision.zones`) tests the first condition and finds the side of the zone on which the hull is. For the second
condition, one corner of each ring is enough.
"""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from math import isqrt
from typing import TypeAlias

from rtshcua.decision.outline import Box, rings
from rtshcua.decision.prepare import PreparedAirspace
from rtshcua.decision.values import AND, FALSE, NOT, TRUE, Truth
from rtshcua.decision.zones import PlaceSet, PreparedZone, Sweep
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import CIRCLE, Zone, unproject
from rtshcua.model.quantity import Dimension, display

Point: TypeAlias = tuple[int, int]

#: a circumscribed polygon of 16 corners around a circle of radius 1,000: the corners of its first quarter
_QUARTER = ((1_020, 0), (943, 391), (722, 722), (391, 943))


def disc(radius: int) -> list[Point]:
    """Return the corners of a polygon that contains a circle around home; home itself if the radius is 0. In mm."""
    if not radius:
        return [(0, 0)]
    quarter = [(-(-x * radius // 1_000), -(-y * radius // 1_000)) for x, y in _QUARTER]
    turned = [[(x, y), (-y, x), (-x, -y), (y, -x)] for x, y in quarter]
    return [point for points in turned for point in points]


def hull(points: Iterable[Point]) -> list[Point]:
    """Return the corners of the convex hull, counter-clockwise (Andrew's monotone chain)."""
    ordered = sorted(set(points))
    if len(ordered) < 3:
        return ordered
    return [*_half(ordered)[:-1], *_half(ordered[::-1])[:-1]]


def _half(ordered: Sequence[Point]) -> list[Point]:
    chain: list[Point] = []
    for point in ordered:
        while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0:
            chain.pop()
        chain.append(point)
    return chain


def _turn(a: Point, b: Point, c: Point) -> int:
    """Return a positive number if `c` lies left of the line from `a` to `b`, 0 if on it."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


class Landmarks:
    """One point of each ring of a policy's zones. For a circle it is the centre."""

    def __init__(self, policy: Policy) -> None:
        self._zones = policy.zones
        self._found: dict[int, tuple[Point, ...]] = {}

    def zone(self, number: int) -> Zone:
        """Return a zone of the policy."""
        return self._zones[number]

    def of(self, number: int) -> tuple[Point, ...]:
        """Return the points of one zone."""
        if number not in self._found:
            zone = self._zones[number]
            if zone.shape == CIRCLE:
                self._found[number] = ((zone.data[0], zone.data[1]),)
            else:
                self._found[number] = tuple(ring[0] for ring in rings(zone))
        return self._found[number]


class HullSweep(Sweep):
    """A convex hull as a sweep. Its result for a zone holds for every place in the hull."""

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
            return TRUE  # a disc that contains the edge of a hull contains the hull
        if answer in (TRUE, FALSE) and any(map(self._holds, self._landmarks.of(zone.number))):
            return TRUE | FALSE
        return answer

    def _holds(self, place: Point) -> bool:
        """Whether a place is inside the hull or on its edge."""
        corners = self._corners
        if len(corners) < 3:
            return False
        return all(_turn(a, b, place) >= 0 for a, b in pairwise((*corners, corners[0])))


Leg: TypeAlias = tuple[Point, Point]

#: spacing in mm of the places tested on a leg, and their largest number
_EVERY, _MOST = 1_000, 500
_NO_BOX: Box = (0, 0, 0, 0)


def breach_text(policy: Policy, airspace: PreparedAirspace, legs: Sequence[Leg], low: int, high: int) -> str:
    """Describe how a vehicle on these legs would violate the airspace, as a phrase that follows "would".

    Heights are in mm. All zones of the airspace are taken to exist.
    """
    error = policy.vehicle.position_error
    box, within = (-error, -error, error, error), f"come within {_length(error)} of"
    places = list(places_along(legs))

    def near(violation: str, zone: PreparedZone, place: Point) -> str:
        return f"{violation} `{policy.zones[zone.number].name}`, near {place_text(policy, place)}"

    for zone in airspace.inside:
        found = _vertical(policy, zone, low, high)
        if found is not None:
            return found
        for place in places:
            if zone.along(place, box) != TRUE:
                return near(f"{within} the edge of" if zone.along(place, _NO_BOX) == TRUE else "leave", zone, place)
    for zone in airspace.outside:
        touched = [] if zone.between(low, high) == FALSE else [at for at in places if zone.along(at, box) != FALSE]
        for place in touched:
            if zone.along(place, _NO_BOX) != FALSE:
                return near("enter", zone, place)
        if touched:
            return near(within, zone, touched[0])
    return f"{within} the edge of the airspace" if error else "touch the edge of the airspace"


def path_legs(points: Sequence[Point]) -> list[Leg]:
    """Return the legs of a path. A path of one place has one leg of length 0."""
    return list(pairwise(points)) or [(points[0], points[0])]


def place_text(policy: Policy, place: Point) -> str:
    """Format a place as in sources, to 5 decimals of a degree."""
    latitude, longitude = unproject(policy.projection, *place)
    return f"{_degrees(latitude, 'NS')}, {_degrees(longitude, 'EW')}"


def _vertical(policy: Policy, zone: PreparedZone, low: int, high: int) -> str | None:
    name = policy.zones[zone.number].name
    if high >= zone.ceiling:
        return f"fly at {_height(high)}, and the ceiling of `{name}` is {_height(zone.ceiling)}"
    if low <= zone.floor:
        return f"fly at {_height(low)}, and the floor of `{name}` is {_height(zone.floor)}"
    return None


def places_along(legs: Sequence[Leg]) -> Iterator[Point]:
    """Yield places along legs, including their ends, close enough together to locate a violation."""
    for (x0, y0), (x1, y1) in legs:
        count = min(isqrt((x1 - x0) ** 2 + (y1 - y0) ** 2) // _EVERY + 1, _MOST)
        for at in range(count + 1):
            yield x0 + (x1 - x0) * at // count, y0 + (y1 - y0) * at // count


def _degrees(value: int, signs: str) -> str:
    whole = (abs(value) + 50) // 100
    return f"{whole // 100_000}.{whole % 100_000:05} {signs[value < 0]}"


def _length(value: int) -> str:
    return display(value, Dimension.LENGTH)


def _height(value: int) -> str:
    return display(value, Dimension.ALTITUDE)


def keeps(place: PlaceSet, airspace: PreparedAirspace) -> Truth:
    """Whether places are in the airspace. All its zones are taken to exist."""
    truth = TRUE
    for zone in airspace.inside:
        truth = AND[truth][place.inside(zone)]
    for zone in airspace.outside:
        truth = AND[truth][NOT[place.inside(zone)]]
    return truth
