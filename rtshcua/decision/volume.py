"""The planned volume: every place where a skill may take the vehicle from where it is now.

It is the leg from the present position to the first point of the plan's path, and the path, at all heights between
the present one and the plan's altitude. Where the points have heights of their own, each leg is at the heights
between those of its ends, the first one from the present height, whichever way the vehicle flies there. LAND is the
descent at the present position. HOME climbs to the vehicle's return altitude if it is lower, flies home at that
height or its own, and descends there (`across`). The volume is widened by the vehicle's position error. Zones that a
vehicle takes off from or lands in must therefore have no floor (`LOWEST`): a height of 0 lies *on* a floor of 0, hence
outside.

PX4 1.16 (rtl.cpp, rtl_direct.cpp) and ArduCopter 4.7 (mode_rtl.cpp) fly this way. Both start the way across
shortly before they reach the height, and climb less near home: docs/flying/returns.md.
"""

from collections.abc import Sequence
from itertools import pairwise
from math import isqrt
from typing import NamedTuple

from rtshcua.decision.outline import Box
from rtshcua.decision.values import MISSING, Span, Value
from rtshcua.decision.zones import NOWHERE, Part, PlaceSet, Sweep, WellKnown
from rtshcua.model.flat.contract import Motion, MotionKind
from rtshcua.model.flat.policy import VehicleLimits

HOME = (0, 0)  # the origin of local coordinates
#: a vehicle starts the way home this far below its return altitude, mm: ArduCopter accepts a corner within
#: WPNAV_RADIUS, PX4 a height within NAV_MC_ALT_RAD
SHORT = 2_000
#: a return that begins within this distance of home, mm, or within a third of the height, may be lower: PX4 within
#: RTL_MIN_DIST, ArduCopter by RTL_CONE_SLOPE
NEAR = 10_000
STEEP = 3


class Volume(NamedTuple):
    """A planned volume: its `place`, the heights in it, and the distance of its farthest point from home, mm rounded
    up.

    Without a known start height the place has no heights, and without a known position there is no `farthest`
    (`place.located`).
    """

    place: PlaceSet
    height: Value
    farthest: Span


UNKNOWN_VOLUME = Volume(NOWHERE, MISSING, (0, 0))


class Planner:
    """The planned volumes of one plan. It caches the last start, because the result depends on nothing else."""

    __slots__ = (
        "_altitude", "_distance", "_error", "_heights", "_kind", "_last", "_leg", "_levelled", "_levels", "_near",
        "_path", "_sweep", "_whole",
    )  # fmt: skip

    def __init__(
        self, kind: int, path: tuple[int, ...], altitude: int | None, position_error: int, near: int = 0,
        heights: tuple[int, ...] = (),
    ) -> None:  # fmt: skip
        """`altitude` is None where the start height counts. For HOME it is the height to which the return climbs,
        unless it begins within `near` mm. `heights` are those of the points of the path, if they have their own.
        """
        self._kind, self._altitude, self._near = kind, altitude, near
        self._heights = heights
        self._path = HOME if kind == MotionKind.HOME else path
        self._error: Box = (-position_error, -position_error, position_error, position_error)
        self._whole = Sweep(self._path, self._error) if self._path else None
        self._sweep = None if heights else self._whole
        self._levels = levels(self._path, heights, self._error)
        self._levelled: dict[tuple[int, int], PlaceSet] = {}
        self._distance = max((distance(*self._path[at : at + 2]) for at in range(0, len(self._path), 2)), default=0)
        self._leg: tuple[tuple[int, int, int, int], Sweep, Sweep, Span] | None = None
        self._last: tuple[tuple[Value, Value, Value], Volume] | None = None

    def volume(self, slots: Sequence[Value], known: WellKnown) -> Volume:
        """The volume from the vehicle's present position in a state."""
        start = (slots[known.x], slots[known.y], slots[known.height])
        last = self._last
        if last is not None and last[0] == start:
            return last[1]
        volume = self._from(*start)
        self._last = (start, volume)
        return volume

    def _from(self, x: Value, y: Value, height: Value) -> Volume:
        located, gap = max(x[2], y[2]), height[2]
        start, leg, farthest = self._first_leg(x, y)
        low, high = height[0], height[1]
        parts: list[Part]
        if self._kind == MotionKind.HOME:
            returns = self._altitude or 0
            high = max(high, returns) if returns else high
            least = across(low, returns, near=farthest[0] <= self._near)
            parts = [(leg, least, high)] if least == low else [(start, low, high), (leg, least, high)]
            low = min(low, 0)
        else:
            if self._kind == MotionKind.LAND:
                low = min(low, 0)
            elif self._altitude is not None:
                first = self._heights[0] if self._heights else self._altitude
                low, high = min(low, first), max(high, first)
            parts = [(leg, low, high)]
            if self._heights:
                low, high = min(low, *self._heights), max(high, *self._heights)
        if self._sweep is not None:
            parts.append((self._sweep, low, high))
        place = PlaceSet(tuple(parts), located, gap, self._fixed(located, gap) if self._heights else None)
        return Volume(place, (low, high, gap, None), farthest)

    def _fixed(self, located: int, gap: int) -> PlaceSet:
        """The path at the heights of its points, which keeps its answers."""
        fixed = self._levelled.get((located, gap))
        if fixed is None:
            fixed = self._levelled[located, gap] = PlaceSet(self._levels, located, gap, whole=self._whole)
        return fixed

    def _first_leg(self, x: Value, y: Value) -> tuple[Sweep, Sweep, Span]:
        """The start, anywhere in a box; the leg from there to the path; and the distance from home of the farthest
        point of both.
        """
        west, east, south, north = key = (x[0], x[1], y[0], y[1])
        if self._leg is not None and self._leg[0] == key:
            return self._leg[1:]
        left, bottom, right, top = self._error
        box = (left, bottom, right + east - west, top + north - south)
        start, leg = Sweep((west, south), box), Sweep((west, south, *self._path[:2]), box)
        farthest = max(distance(max(abs(west), abs(east)), max(abs(south), abs(north))), self._distance)
        nearest = farthest
        if west != east or south != north:
            nearest = max(distance(min(max(0, west), east), min(max(0, south), north)), self._distance)
        span = (nearest, farthest)
        self._leg = (key, start, leg, span)
        return start, leg, span


def levels(path: tuple[int, ...], heights: tuple[int, ...], box: Box) -> tuple[Part, ...]:
    """The legs of a path whose points have heights of their own: those one after the other that are between the same
    two heights are one part.
    """
    if len(heights) == 1:
        return ((Sweep(path, box), heights[0], heights[0]),)
    legs = [(min(pair), max(pair)) for pair in pairwise(heights)]
    found: list[Part] = []
    begins = 0
    for number, span in enumerate(legs):
        if number + 1 == len(legs) or legs[number + 1] != span:
            found.append((Sweep(path[2 * begins : 2 * number + 4], box), *span))
            begins = number + 1
    return tuple(found)


def across(low: int, returns: int, *, near: bool) -> int:
    """The least height, mm above home, of a return that begins at `low`. `returns` is the height to which it climbs,
    0 if unknown. Near home it may climb less, or not at all.
    """
    return low if near or not returns else max(low, returns - SHORT)


def near_home(vehicle: VehicleLimits) -> int:
    """The distance, mm, within which a return may be lower than the return altitude, for any true home and position
    error.
    """
    return cone(vehicle.return_altitude) + vehicle.home_within + vehicle.position_error


def cone(returns: int) -> int:
    """The distance from the true home within which a return may be lower than the height to which it climbs; all in
    mm.
    """
    return max(NEAR, -(-returns // STEEP))


def flown_at(motion: Motion, altitude: int, vehicle: VehicleLimits) -> int | None:
    """The `altitude` of a planner: the step's, the return altitude, or None."""
    if motion.kind == MotionKind.HOME:
        return vehicle.return_altitude
    return None if motion.altitude == -1 else altitude


def distance(x: int, y: int) -> int:
    """The distance of a place from home, mm rounded up."""
    square = x * x + y * y
    return isqrt(square - 1) + 1 if square else 0
