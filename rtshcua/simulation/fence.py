"""The vehicle's geofence and its breach detection. Metres.

A fence has polygons and circles on the plane around home, and a ceiling. The flavour decides when the fence is in
force and how the vehicle reacts to a breach.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import hypot, inf
from typing import Self

from rtshcua.simulation.mission_protocol import (
    EXCLUDED,
    FENCE,
    INCLUDED,
    POLYGONS,
    ROUND_EXCLUDED,
    ROUND_INCLUDED,
    PlanItem,
    Plans,
)
from rtshcua.simulation.place import HomePosition, Point
from rtshcua.simulation.vehicle import Multirotor

Place = tuple[float, float]
"""Metres north and east of home."""


@dataclass(frozen=True, slots=True)
class FencePolygon:
    """A polygon by its vertices; it may be concave."""

    vertices: tuple[Place, ...]

    def holds(self, north: float, east: float) -> bool:
        """Return whether the place is inside (even-odd rule)."""
        inside = False
        (a_north, a_east) = self.vertices[-1]
        for b_north, b_east in self.vertices:
            if (a_east > east) != (b_east > east):
                crossing = a_north + (east - a_east) / (b_east - a_east) * (b_north - a_north)
                inside ^= north < crossing
            a_north, a_east = b_north, b_east
        return inside

    def edge(self, north: float, east: float) -> float:
        """Return the distance to the nearest edge."""
        nearest = inf
        (a_north, a_east) = self.vertices[-1]
        for b_north, b_east in self.vertices:
            d_north, d_east = b_north - a_north, b_east - a_east
            length = d_north * d_north + d_east * d_east
            along = ((north - a_north) * d_north + (east - a_east) * d_east) / length if length else 0.0
            along = min(1.0, max(0.0, along))
            nearest = min(nearest, hypot(north - a_north - along * d_north, east - a_east - along * d_east))
            a_north, a_east = b_north, b_east
        return nearest


@dataclass(frozen=True, slots=True)
class FenceCircle:
    """A circle on the plane."""

    centre: Place
    radius: float

    def holds(self, north: float, east: float) -> bool:
        """Return whether the place is inside."""
        return hypot(north - self.centre[0], east - self.centre[1]) < self.radius

    def edge(self, north: float, east: float) -> float:
        """Return the distance to the edge."""
        return abs(hypot(north - self.centre[0], east - self.centre[1]) - self.radius)


@dataclass(frozen=True, slots=True)
class FenceArea:
    """The area where flying is allowed: inside the included shapes, outside the excluded ones."""

    included: tuple[FencePolygon | FenceCircle, ...] = ()
    excluded: tuple[FencePolygon | FenceCircle, ...] = ()
    every: bool = False
    """Whether a place must be inside every included shape; otherwise one is enough."""

    def holds(self, north: float, east: float) -> bool:
        """Return whether flying is allowed there."""
        if any(shape.holds(north, east) for shape in self.excluded):
            return False
        inside = [shape.holds(north, east) for shape in self.included]
        return not inside or (all(inside) if self.every else any(inside))

    def outside_by(self, north: float, east: float) -> float:
        """Return the distance to the nearest violated edge; 0 where flying is allowed."""
        if self.holds(north, east):
            return 0.0
        broken = [shape.edge(north, east) for shape in self.excluded if shape.holds(north, east)]
        broken += [shape.edge(north, east) for shape in self.included if not shape.holds(north, east)]
        return min(broken)

    @classmethod
    def of(cls, items: Sequence[PlanItem], home: HomePosition, every: bool) -> Self:
        """Return the area of uploaded items, which must be well formed (see `draws_no_fence`)."""
        included: list[FencePolygon | FenceCircle] = []
        excluded: list[FencePolygon | FenceCircle] = []
        at = 0
        while at < len(items):
            item = items[at]
            count = int(item.p1) if item.command in POLYGONS else 1
            shape: FencePolygon | FenceCircle
            if item.command in POLYGONS:
                shape = FencePolygon(tuple(home.local(vertex.x, vertex.y) for vertex in items[at : at + count]))
            else:
                shape = FenceCircle(home.local(item.x, item.y), item.p1)
            if item.command in (INCLUDED, ROUND_INCLUDED):
                included.append(shape)
            elif item.command in (EXCLUDED, ROUND_EXCLUDED):
                excluded.append(shape)
            at += count
        return cls(tuple(included), tuple(excluded), every)


@dataclass(frozen=True, slots=True)
class FenceLimits:
    """A fence in force: an area, and height limits in metres above home."""

    area: FenceArea = FenceArea()
    ceiling: float = inf
    floor: float = -inf
    """Applies to targets only: on the ground every vehicle is below it."""
    return_under: float = inf
    """The greatest height above home of a return."""
    across: float = inf
    """The greatest distance from home, in addition to the areas."""

    def holds(self, point: Point) -> bool:
        """Return whether flying is allowed there."""
        near = hypot(point.north, point.east) <= self.across
        return point.up <= self.ceiling and near and self.area.holds(point.north, point.east)


LOADED_US = 100_000
"""How long the fence is inactive after an upload or a parameter change. Targets that arrive in that time are not
checked, as recorded from both autopilots."""
CHECK_US = 200_000


@dataclass(frozen=True, slots=True)
class Breach:
    """A violated limit: the flavour's name of it, and the horizontal distance outside, in metres."""

    name: str
    by: float = 0.0


@dataclass(frozen=True, slots=True)
class FenceRules:
    """The fence behaviour that depends on the flavour."""

    limits: Callable[[Callable[[str], float], FenceArea], FenceLimits | None]
    """Returns the fence in force, if any, from the parameters (by name) and the uploaded area."""
    name: Callable[[FenceLimits, Point], str]
    """Returns the name of the limit that a point violates."""
    every: bool
    """Whether the vehicle must stay inside every included area."""
    critical: Callable[[Callable[[str], float]], bool]
    """Returns whether HEARTBEAT reports a breach (MAV_STATE_CRITICAL), from the parameters (by name)."""


class FenceWatch:
    """The fence of one vehicle.

    `value` returns a parameter by name, `where` the estimated position, `clock` the microseconds since the start.
    """

    def __init__(
        self, rules: FenceRules, plans: Plans, home: HomePosition, value: Callable[[str], float], where: Callable[[],
            Point],
        clock: Callable[[], int],
    ) -> None:  # fmt: skip
        self._rules = rules
        self._plans = plans
        self._home = home
        self._value = value
        self._where = where
        self._clock = clock
        self._area = FenceArea()
        self._limits: FenceLimits | None = None
        self.return_under = inf
        """The greatest height above home of a return, limited by the fence."""
        self.due_us = LOADED_US
        """When the fence is checked next."""
        self._stale = True
        self.breach: Breach | None = None
        """The current breach, while armed and in the air."""
        self.count = 0
        """The number of breaches so far."""
        plans.listeners.append(self._plan_changed)

    def _plan_changed(self, kind: int) -> None:
        if kind == FENCE:
            self._area = FenceArea.of(self._plans.items(FENCE), self._home, self._rules.every)
            self.settings_changed()

    def settings_changed(self) -> None:
        """Reload the fence, shortly after a parameter was set."""
        self._limits, self.return_under = None, inf
        self._stale = True
        self.due_us = self._clock() + LOADED_US

    @property
    def in_force(self) -> bool:
        """Whether a fence is in force."""
        return self._limits is not None

    @property
    def critical(self) -> bool:
        """Whether HEARTBEAT reports a breach now."""
        return self.breach is not None and self._rules.critical(self._value)

    def allows(self, point: Point) -> bool:
        """Return whether the fence in force allows a target at this point."""
        limits = self._limits
        return limits is None or (limits.floor <= point.up and limits.holds(point))

    def step(self, now_us: int, vehicle: Multirotor) -> Breach | None:
        """Advance to `now_us` and return a breach that began now, if any."""
        if now_us < self.due_us:
            return None
        if self._stale:
            self._stale, self._limits = False, self._rules.limits(self._value, self._area)
            self.return_under = inf if self._limits is None else self._limits.return_under
        self.due_us = now_us + CHECK_US
        limits = self._limits
        point = self._where() if limits is not None and vehicle.armed and vehicle.in_air else None
        if limits is None or point is None or limits.holds(point):
            self.breach = None
            return None
        before = self.breach
        self.breach = Breach(self._rules.name(limits, point), limits.area.outside_by(point.north, point.east))
        if before is not None:
            return None
        self.count += 1
        return self.breach
