"""The policy's airspace as a geofence of the autopilot's: a second line of defence, and never narrower than the first.

A fence has neither heights nor times, an excluded area has no holes, and autopilots differ in what several inclusions
mean. What cannot be said exactly is left out, so that the autopilot never takes over where the policy lets the vehicle
be; each such loss is told. How little a fence protects: docs/adr/0019-what-a-vehicle-says.md.
"""

from collections.abc import Iterator, Sequence
from math import isqrt
from typing import Final, NamedTuple

from rtshcua.mavlink import enums
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import AREA, CIRCLE, HIGHEST, Projection, Zone, unproject

INCLUDE_VERTEX: Final = enums.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
EXCLUDE_VERTEX: Final = enums.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
INCLUDE_CIRCLE: Final = enums.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION
EXCLUDE_CIRCLE: Final = enums.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION

Ring = tuple[int, ...]


class FenceHabits(NamedTuple):
    """How an autopilot takes a fence.

    `frame` (MAV_FRAME) goes with each item. `all_inclusions`: the vehicle must be inside every inclusion; else inside
    any of them. `switches` are parameters that must have these bits set for the fence to count.
    """

    frame: int
    all_inclusions: bool
    switches: tuple[tuple[str, int], ...]


class FenceItem(NamedTuple):
    """One MISSION_ITEM_INT: the command, a place in 1e-7 degree, and `param1`: corners of its ring, or radius in m."""

    command: int
    latitude: int
    longitude: int
    parameter: float


class Fence(NamedTuple):
    """What is uploaded, and what of the airspace it does not say, for a person."""

    items: tuple[FenceItem, ...]
    left_out: tuple[str, ...]


def fence_of(policy: Policy, habits: FenceHabits) -> Fence:
    """The fence of a policy's airspace; without items where there is nothing that a fence could say."""
    airspace = policy.airspace
    if airspace is None:
        return Fence((), ("the policy has no airspace",))
    left_out: list[str] = []
    inside = [policy.zones[number] for number in airspace.inside]
    kept = [zone for zone in inside if _can_include(zone, habits, left_out)]
    if not habits.all_inclusions and len(kept) > 1:
        kept.sort(key=_size)
        left_out += [f"`{zone.name}`: this autopilot joins inclusions instead of intersecting" for zone in kept[1:]]
        del kept[1:]
    items = [item for zone in kept for item in _included(zone, policy.projection)]
    for zone in (policy.zones[number] for number in airspace.outside):
        if _can_exclude(zone, left_out):
            items += _excluded(zone, policy.projection)
    return Fence(tuple(items), tuple(left_out))


def _can_include(zone: Zone, habits: FenceHabits, left_out: list[str]) -> bool:
    if zone.floor > 0 or zone.ceiling < HIGHEST:
        left_out.append(f"`{zone.name}`: its heights")
    if zone.daily or zone.dates:
        left_out.append(f"`{zone.name}`: its times")
    parts = sum(_is_outer(ring) for ring in _rings(zone))
    if parts > 1 and habits.all_inclusions:
        left_out.append(
            f"`{zone.name}`: it has {parts} parts, and this autopilot would want the vehicle in all of them"
        )
        return False
    return True


def _can_exclude(zone: Zone, left_out: list[str]) -> bool:
    for there, what in (
        (zone.floor > 0 or zone.ceiling < HIGHEST, "one may fly above or below it"),
        (zone.daily or zone.dates, "it is not always there"),
        (not all(map(_is_outer, _rings(zone))), "it has holes"),
    ):
        if there:
            left_out.append(f"`{zone.name}`: {what}")
            return False
    return True


def _included(zone: Zone, projection: Projection) -> Iterator[FenceItem]:
    if zone.shape == CIRCLE:
        yield _circle(zone, projection, INCLUDE_CIRCLE, outwards=1)
        return
    rings = list(_rings(zone))
    for ring in sorted(rings, key=_is_outer, reverse=True):
        yield from _polygon(ring, projection, INCLUDE_VERTEX if _is_outer(ring) else EXCLUDE_VERTEX)


def _excluded(zone: Zone, projection: Projection) -> Iterator[FenceItem]:
    if zone.shape == CIRCLE:
        yield _circle(zone, projection, EXCLUDE_CIRCLE, outwards=0)
        return
    for ring in _rings(zone):
        yield from _polygon(ring, projection, EXCLUDE_VERTEX)


def _circle(zone: Zone, projection: Projection, command: int, outwards: int) -> FenceItem:
    """A radius in whole centimetres, so that a 32-bit float says the same everywhere."""
    x, y, square = zone.data
    centimetres = isqrt(square) // 10 + outwards
    return FenceItem(command, *unproject(projection, x, y), centimetres / 100)


def _polygon(ring: Ring, projection: Projection, command: int) -> Iterator[FenceItem]:
    corners = len(ring) // 2
    for x, y in zip(ring[::2], ring[1::2], strict=True):
        yield FenceItem(command, *unproject(projection, x, y), float(corners))


def _rings(zone: Zone) -> Iterator[Ring]:
    """The rings of a zone that is no circle, outer ones counter-clockwise."""
    if zone.shape == AREA:
        count = zone.data[0]
        at = 1 + count
        for corners in zone.data[1 : 1 + count]:
            yield zone.data[at : at + 2 * corners]
            at += 2 * corners
    elif zone.shape != CIRCLE:
        yield zone.data


def _twice_area(ring: Sequence[int]) -> int:
    points = list(zip(ring[::2], ring[1::2], strict=True))
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(points, [*points[1:], points[0]], strict=True))


def _is_outer(ring: Ring) -> bool:
    return _twice_area(ring) > 0


def _size(zone: Zone) -> int:
    """Twice the area, in mm^2, near enough to say which zone is the smallest."""
    return 6 * zone.data[2] if zone.shape == CIRCLE else sum(map(_twice_area, _rings(zone)))
