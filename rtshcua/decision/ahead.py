"""The predicted path: every place where a vehicle may be before it stands still, if it is told to stop now.

Since its state was measured it flew on as it did (the older the state, the further); told to stop, it goes on so for
its declared reaction, and then loses its declared braking of its speed. With v the velocity over ground, |v| its
length, t the age of what was measured and the reaction together, and a the braking, it comes to stand v*t + v*|v|/(2a)
from where it was measured, on the straight line there. All is rounded away from the vehicle and widened by its position
error like a planned volume. A vehicle that declares no braking is taken to be where it was measured.
"""

from collections.abc import Sequence
from math import isqrt
from typing import NamedTuple

from rtshcua.decision.places import Place, Sweep
from rtshcua.decision.prepared import PreparedPolicy
from rtshcua.decision.values import PRESENT, Value
from rtshcua.decision.volume import UNKNOWN_VOLUME, Volume, distance
from rtshcua.model.flat.limits import MAX_SPEED

SECOND = 1_000_000  # us


class Ahead(NamedTuple):
    """A predicted path, as a volume, and how long it takes to stand still from now on, at most, in us."""

    volume: Volume
    lasts_us: int


UNKNOWN_AHEAD = Ahead(UNKNOWN_VOLUME, 0)


def ahead(slots: Sequence[Value], ages: Sequence[int], policy: PreparedPolicy) -> Ahead:
    """The predicted path in one situation, and the ages of its slots; nothing is known where a signal of it is."""
    known, vehicle = policy.tables.known, policy.policy.vehicle
    x, _, x_gap, _ = slots[known.x]
    y, _, y_gap, _ = slots[known.y]
    height, _, height_gap, _ = slots[known.height]
    if x_gap != PRESENT or y_gap != PRESENT or height_gap != PRESENT:
        return UNKNOWN_AHEAD
    if not vehicle.braking:
        return Ahead(policy.still.volume(slots, known), 0)
    east, _, east_gap, _ = slots[known.east]
    north, _, north_gap, _ = slots[known.north]
    down, _, down_gap, _ = slots[known.down]
    if east_gap != PRESENT or north_gap != PRESENT or down_gap != PRESENT:
        return UNKNOWN_AHEAD
    speed = _root(east * east + north * north + down * down)
    if speed > MAX_SPEED:
        return UNKNOWN_AHEAD
    age_us = max(
        ages[known.x], ages[known.y], ages[known.height], ages[known.east], ages[known.north], ages[known.down]
    )
    goes_us, braking = age_us + vehicle.reaction_us, vehicle.braking
    part, whole = 2 * braking * goes_us + speed * SECOND, 2 * braking * SECOND
    to_x, to_y = x + _away(east * part, whole), y + _away(north * part, whole)
    to_height = height + _away(-down * part, whole)
    reach = vehicle.position_error + 1  # what the ends were rounded by bends the line by less than 1 mm
    low, high = min(height, to_height), max(height, to_height)
    sweep = Sweep((x, y, to_x, to_y), (-reach, -reach, reach, reach))
    farthest = max(distance(x, y), distance(to_x, to_y))
    volume = Volume(Place(((sweep, low, high),), 0), (low, high, PRESENT, None), (farthest, farthest))
    return Ahead(volume, goes_us - age_us - (-speed * SECOND // braking))


def _root(square: int) -> int:
    """The square root, rounded up."""
    return isqrt(square - 1) + 1 if square else 0


def _away(numerator: int, denominator: int) -> int:
    """A quotient rounded away from zero."""
    return -(-numerator // denominator) if numerator >= 0 else numerator // denominator
