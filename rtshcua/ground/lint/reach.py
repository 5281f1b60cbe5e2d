"""How far a vehicle comes, so that what bounds it no further can be told from what does.

From home it comes no further than it flies at its highest speed on a full battery, and no higher than it climbs in that
time; wherever within its `within` home really is, and a per cent more than that. What holds all of it restricts
nothing; nor does what has nothing in common with it. Everything here errs towards a longer reach, so towards saying
that something is restricted. Lengths in mm.
"""

from math import isqrt
from typing import NamedTuple

from rtshcua.decision.times import timed
from rtshcua.ground.analysis.plane import rings_of
from rtshcua.ground.geometry.shapes import Disc, Region, lies_within, polygonal
from rtshcua.model.flat.policy import Policy, Vehicle
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, Zone

_SECOND = 1_000_000
#: the local plane is true to 1 part in 1,000 within 5 km; a per cent is more than it errs by within what flies
_MARGIN = 100


class Reach(NamedTuple):
    """All places less than `across` from home, and from `down` to `up` above it."""

    across: int
    up: int
    down: int

    def belongs_to(self, zone: Zone) -> bool:
        """Whether it is proved that a zone holds all of it, at all times."""
        if timed(zone) or zone.floor > self.down or zone.ceiling < self.up:
            return False
        if zone.shape == CIRCLE:
            x, y, squared = zone.data
            return isqrt(squared) - isqrt(x * x + y * y) - 1 > self.across
        plan = Region(polygonal(rings_of(zone)), LOWEST, HIGHEST)
        return lies_within(Region(Disc((0, 0), self.across), LOWEST, HIGHEST), plan)

    def misses(self, zone: Zone) -> bool:
        """Whether it is proved that a zone has nothing of it."""
        return zone.floor > self.up or zone.ceiling < self.down or _distance(zone) > self.across


def reach_of(vehicle: Vehicle) -> Reach:
    """Where a vehicle may come. Down it may come faster than it climbs, but not further than it flies."""

    def flown(speed: int) -> int:
        way = -(-speed * vehicle.endurance_us // _SECOND) + vehicle.home_within + vehicle.position_error
        return way + way // _MARGIN

    return Reach(flown(vehicle.speed), flown(vehicle.climb), -flown(max(vehicle.speed, vehicle.climb)))


def is_open(policy: Policy) -> bool:
    """Whether nothing in a policy's airspace restricts where its vehicle comes, or it has none."""
    reach = reach_of(policy.vehicle)
    without = () if policy.airspace is None else policy.airspace.outside
    return is_unbounded(policy) and all(reach.misses(policy.zones[number]) for number in without)


def is_unbounded(policy: Policy) -> bool:
    """Whether a policy has no zone to stay inside of that restricts where its vehicle comes."""
    reach = reach_of(policy.vehicle)
    within = () if policy.airspace is None else policy.airspace.inside
    return all(reach.belongs_to(policy.zones[number]) for number in within)


def region_of(zone: Zone) -> Region:
    """A zone as a region of the plane, without its times; a circle is no smaller than it is."""
    if zone.shape == CIRCLE:
        x, y, squared = zone.data
        return Region(Disc((x, y), isqrt(squared) + 1), zone.floor, zone.ceiling)
    return Region(polygonal(rings_of(zone)), zone.floor, zone.ceiling)


def _distance(zone: Zone) -> int:
    """A distance from home that a zone keeps at least; 0 where home may lie in it."""
    if zone.shape == CIRCLE:
        x, y, squared = zone.data
        return max(0, isqrt(x * x + y * y) - isqrt(squared) - 1)
    corners = [corner for ring in rings_of(zone) for corner in ring]
    xs, ys = [x for x, _ in corners], [y for _, y in corners]
    # the box around it is nearer than the zone is, never further
    dx, dy = max(min(xs), -max(xs), 0), max(min(ys), -max(ys), 0)
    return isqrt(dx * dx + dy * dy)
