"""How a way leaves the airspace, and where: in words."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import isqrt
from typing import TypeAlias

from rtshcua.decision.outline import Box
from rtshcua.decision.prepare import PreparedAirspace
from rtshcua.decision.values import FALSE, TRUE
from rtshcua.decision.zones import PreparedZone
from rtshcua.ground.prove.fan import Point
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import unproject
from rtshcua.model.quantity import Dimension, display

Leg: TypeAlias = tuple[Point, Point]

#: a leg is looked at every metre, but at no more places than this
_EVERY, _MOST = 1_000, 500
_NO_BOX: Box = (0, 0, 0, 0)


def breach(policy: Policy, airspace: PreparedAirspace, legs: Sequence[Leg], low: int, high: int) -> str:
    """What a vehicle would do on these legs, at heights in mm, that the airspace does not allow, as if all its zones
    existed; to stand after "would".
    """
    error = policy.vehicle.position_error
    box = (-error, -error, error, error)
    for zone in airspace.inside:
        found = _vertical(policy, zone, low, high)
        if found is not None:
            return found
        place = next((each for each in places_along(legs) if zone.along(each, box) != TRUE), None)
        if place is not None:
            exact = zone.along(place, _NO_BOX) == TRUE
            return (f"come within {_length(error)} of the edge of" if exact else "leave") + _at(policy, zone, place)
    for zone in airspace.outside:
        if zone.between(low, high) == FALSE:
            continue
        near = [each for each in places_along(legs) if zone.along(each, box) != FALSE]
        if near:
            entered = next((each for each in near if zone.along(each, _NO_BOX) != FALSE), None)
            return (f"come within {_length(error)} of" if entered is None else "enter") + _at(
                policy, zone, entered or near[0]
            )
    return f"come within {_length(error)} of the edge of the airspace" if error else "touch the edge of the airspace"


def path_legs(points: Sequence[Point]) -> list[Leg]:
    """The legs of a path; where it is one place, that alone."""
    return list(pairwise(points)) or [(points[0], points[0])]


def position(policy: Policy, place: Point) -> str:
    """A place as it is written in sources, to 5 decimals."""
    latitude, longitude = unproject(policy.projection, *place)
    return f"{_degrees(latitude, 'NS')}, {_degrees(longitude, 'EW')}"


def _vertical(policy: Policy, zone: PreparedZone, low: int, high: int) -> str | None:
    name = policy.zones[zone.number].name
    if high >= zone.ceiling:
        return f"fly at {_height(high)} where `{name}` has its ceiling at {_height(zone.ceiling)}"
    if low <= zone.floor:
        return f"be down to {_height(low)} where `{name}` has its floor at {_height(zone.floor)}"
    return None


def places_along(legs: Sequence[Leg]) -> Iterator[Point]:
    """Places on some legs, their ends among them, near enough to each other to say where something is."""
    for (x0, y0), (x1, y1) in legs:
        count = min(isqrt((x1 - x0) ** 2 + (y1 - y0) ** 2) // _EVERY + 1, _MOST)
        for at in range(count + 1):
            yield x0 + (x1 - x0) * at // count, y0 + (y1 - y0) * at // count


def _at(policy: Policy, zone: PreparedZone, place: Point) -> str:
    return f" `{policy.zones[zone.number].name}`, near {position(policy, place)}"


def _degrees(value: int, signs: str) -> str:
    whole = (abs(value) + 50) // 100
    return f"{whole // 100_000}.{whole % 100_000:05} {signs[value < 0]}"


def _length(value: int) -> str:
    return display(value, Dimension.LENGTH)


def _height(value: int) -> str:
    return display(value, Dimension.ALTITUDE)
