"""Zone geometry and times for the judge, in floating point."""

from collections.abc import Sequence
from functools import cache, lru_cache
from itertools import pairwise
from math import hypot, inf, sqrt
from typing import NamedTuple

from rtshcua.model.flat.limits import DAY, WEEK
from rtshcua.model.flat.policy import Policy, VehicleLimits
from rtshcua.model.flat.zone import CIRCLE, POLYGON, SHIFT, Zone

#: the truths that occur at some moment: True, False, or None if the local time is unknown
Answers = frozenset[bool | None]
#: x0, y0, x1, y1 in mm
Edge = tuple[int, int, int, int]
_SLACK_US = 1_000_000


def inside_mm(zone: Zone, x: float, y: float, up: float) -> float:
    """Return how far a point is inside a zone, in mm; negative outside. x is east, y is north of home."""
    level = level_mm(zone, x, y)
    height = min(zone.ceiling - up, up - zone.floor)
    return -hypot(level, height) if level < 0 and height < 0 else min(level, height)


def level_mm(zone: Zone, x: float, y: float) -> float:
    """Return how far a point is inside a zone horizontally, in mm; negative outside."""
    if zone.shape == CIRCLE:
        east, north, square = zone.data
        return sqrt(square) - hypot(x - east, y - north)
    within, nearest = False, inf
    for ax, ay, bx, by in edges(zone):
        if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
            within = not within
        nearest = min(nearest, apart_mm(x, y, ax, ay, bx, by))
    return nearest if within else -nearest


def apart_mm(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Return the distance of a point from a line segment."""
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    along = max(0.0, min(1.0, ((x - ax) * dx + (y - ay) * dy) / square)) if square else 0.0
    return hypot(x - ax - along * dx, y - ay - along * dy)


def edges(zone: Zone) -> tuple[Edge, ...]:
    """Return the edges of all rings of a polygonal zone."""
    return _edges(zone.shape, zone.data)


@lru_cache(maxsize=256)  # a flight needs the edges of a few zones, thousands of times
def _edges(shape: int, data: tuple[int, ...]) -> tuple[Edge, ...]:
    counts, at = ((len(data) // 2,), 0) if shape == POLYGON else (data[1 : 1 + data[0]], 1 + data[0])
    found: list[Edge] = []
    for count in counts:
        ring = [(data[corner], data[corner + 1]) for corner in range(at, at + 2 * count, 2)]
        found += [(ax, ay, bx, by) for (ax, ay), (bx, by) in pairwise([*ring, ring[0]])]
        at += 2 * count
    return tuple(found)


def local_mm(policy: Policy, latitude: int, longitude: int) -> tuple[float, float]:
    """Return east and north of home, in mm, by the policy's projection."""
    projection = policy.projection
    scale = 1 / (1 << SHIFT)
    turned = (longitude - projection.longitude + 1_800_000_000) % 3_600_000_000 - 1_800_000_000
    return turned * projection.east * scale, (latitude - projection.latitude) * projection.north * scale


class ZonesInForce(NamedTuple):
    """The zones to stay inside, and those to stay outside of."""

    inside: tuple[Zone, ...]
    outside: tuple[Zone, ...]


def in_force(policy: Policy, utc_us: int) -> ZonesInForce:
    """Return the airspace's zones that exist at a time. Within a second of a zone's begin or end, an inclusion zone
    counts as existing and an exclusion zone as absent, because no clock is more accurate.
    """
    if policy.airspace is None:
        return ZonesInForce((), ())
    inside, outside = (
        [(zone, exists(zone, policy.vehicle, utc_us - _SLACK_US, utc_us + _SLACK_US)) for zone in zones]
        for zones in (
            [policy.zones[n] for n in policy.airspace.inside],
            [policy.zones[n] for n in policy.airspace.outside],
        )
    )
    return ZonesInForce(
        tuple(zone for zone, answers in inside if answers != {False}),
        tuple(zone for zone, answers in outside if answers == {True}),
    )


def airspace_mm(there: ZonesInForce, x: float, y: float, up: float) -> float:
    """Return how far a point is inside the airspace, in mm; negative outside, infinite without airspace."""
    return min(
        (
            *(inside_mm(zone, x, y, up) for zone in there.inside),
            *(-inside_mm(zone, x, y, up) for zone in there.outside),
        ),
        default=inf,
    )


def is_timed(zone: Zone) -> bool:
    """Return whether a zone exists only at some times."""
    return bool(zone.daily or zone.weekly or zone.dates)


def exists(zone: Zone, vehicle: VehicleLimits, first_us: int, last_us: int) -> Answers:
    """Return whether a zone exists at the moments between two UTC times, inclusive."""
    found: Answers = frozenset({True})
    if zone.dates:
        start, end = zone.dates
        moments = [first_us, last_us, *(each for each in (start, end + 1) if first_us < each <= last_us)]
        found = frozenset(start <= each <= end for each in moments)
    if zone.daily:
        found = both(found, shown(daily(*zone.daily), DAY, vehicle, first_us, last_us))
    elif zone.weekly:
        found = both(found, shown(zone.weekly, WEEK, vehicle, first_us, last_us))
    return found


@cache
def both(left: Answers, right: Answers) -> Answers:
    """Return the possible truths of a conjunction."""
    return frozenset(False if False in (a, b) else None if None in (a, b) else True for a in left for b in right)


def daily(start: int, end: int) -> tuple[int, ...]:
    """Return the times of day from `start` to `end`, inclusive, as half-open windows."""
    after = min(end + 1, DAY)
    return (start, after) if start < after else (0, after, start, DAY) if after < start else (0, DAY)


def shown(windows: Sequence[int], period: int, vehicle: VehicleLimits, first_us: int, last_us: int) -> Answers:
    """Return whether the local time is in one of the windows of the day or the week, at the moments between two UTC
    times; None: the local time is unknown.
    """
    changes = {each for each in vehicle.offsets[::2] if first_us < each <= last_us}
    for offset in {_offset(vehicle, each) for each in (first_us, last_us, *changes)} - {None}:
        assert offset is not None
        for edge in windows:
            change = first_us + 1 + (edge - _MONDAY - offset - first_us - 1) % period
            changes |= {change} if change <= last_us else set()
    return frozenset(_shows(windows, period, vehicle, each) for each in (first_us, *changes))


_MONDAY = 3 * DAY  # 1970 began on a Thursday


def _shows(windows: Sequence[int], period: int, vehicle: VehicleLimits, utc_us: int) -> bool | None:
    offset = _offset(vehicle, utc_us)
    if offset is None:
        return None
    time = (utc_us + offset + _MONDAY) % period
    return any(start <= time < end for start, end in zip(windows[::2], windows[1::2], strict=True))


def _offset(vehicle: VehicleLimits, utc_us: int) -> int | None:
    """Return the offset of local time from UTC; None if unknown."""
    if not vehicle.offsets:
        return vehicle.utc_offset_us
    moments = vehicle.offsets[::2]
    known = [offset for since, offset in zip(moments, vehicle.offsets[1::2], strict=False) if since <= utc_us]
    return known[-1] if known and utc_us < moments[-1] else None
