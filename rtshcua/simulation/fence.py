"""The geofence as the vehicle keeps it, and watches it in flight. Metres.

Polygons and circles on the plane around home, and a ceiling. A flavour says when there is a fence, and what a breach
brings.
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
        """Whether the place is inside (even-odd rule)."""
        inside = False
        (a_north, a_east) = self.vertices[-1]
        for b_north, b_east in self.vertices:
            if (a_east > east) != (b_east > east):
                crossing = a_north + (east - a_east) / (b_east - a_east) * (b_north - a_north)
                inside ^= north < crossing
            a_north, a_east = b_north, b_east
        return inside

    def edge(self, north: float, east: float) -> float:
        """How far the nearest edge is."""
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
    """A circle."""

    centre: Place
    radius: float

    def holds(self, north: float, east: float) -> bool:
        """Whether the place is inside."""
        return hypot(north - self.centre[0], east - self.centre[1]) < self.radius

    def edge(self, north: float, east: float) -> float:
        """How far the edge is."""
        return abs(hypot(north - self.centre[0], east - self.centre[1]) - self.radius)


@dataclass(frozen=True, slots=True)
class FenceArea:
    """Where flying is allowed: inside what is included, outside of what is excluded."""

    included: tuple[FencePolygon | FenceCircle, ...] = ()
    excluded: tuple[FencePolygon | FenceCircle, ...] = ()
    every: bool = False
    """Whether a place must be inside all that is included; else one is enough."""

    def holds(self, north: float, east: float) -> bool:
        """Whether flying is allowed there."""
        if any(shape.holds(north, east) for shape in self.excluded):
            return False
        inside = [shape.holds(north, east) for shape in self.included]
        return not inside or (all(inside) if self.every else any(inside))

    def outside_by(self, north: float, east: float) -> float:
        """How far it is to the nearest edge of what is violated; 0 where flying is allowed."""
        if self.holds(north, east):
            return 0.0
        broken = [shape.edge(north, east) for shape in self.excluded if shape.holds(north, east)]
        broken += [shape.edge(north, east) for shape in self.included if not shape.holds(north, east)]
        return min(broken)

    @classmethod
    def of(cls, items: Sequence[PlanItem], home: HomePosition, every: bool) -> Self:
        """The area that uploaded items draw; the items are well formed (`problem` found none)."""
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
    """A fence in force: an area, and how high flying is allowed, in metres above home."""

    area: FenceArea = FenceArea()
    ceiling: float = inf
    floor: float = -inf
    """For targets alone: on the ground every vehicle is below it."""
    return_under: float = inf
    """The height above home under which a return stays."""
    across: float = inf
    """How far from home flying is allowed, whatever the areas say."""

    def holds(self, point: Point) -> bool:
        """Whether flying is allowed there."""
        near = hypot(point.north, point.east) <= self.across
        return point.up <= self.ceiling and near and self.area.holds(point.north, point.east)


LOADED_US = 100_000
"""How long after a change, of the upload or of a setting, there is no fence: targets that come right behind an upload
are not checked, as recorded from both autopilots."""
CHECK_US = 200_000


@dataclass(frozen=True, slots=True)
class Breach:
    """What is violated: the flavour's name of it, and by how much on the plane, in metres."""

    name: str
    by: float = 0.0


@dataclass(frozen=True, slots=True)
class FenceRules:
    """What a flavour does its own way."""

    limits: Callable[[Callable[[str], float], FenceArea], FenceLimits | None]
    """From the parameters (by name) and the uploaded area: the fence in force, if there is one."""
    name: Callable[[FenceLimits, Point], str]
    """What of the fence is violated there."""
    every: bool
    """Whether every included area must be kept to."""
    critical: Callable[[Callable[[str], float]], bool]
    """From the parameters (by name): whether HEARTBEAT tells of a breach (MAV_STATE_CRITICAL)."""


class FenceWatch:
    """The fence of one vehicle.

    `value` gives a parameter's value by its name, `where` tells where the vehicle believes to be, `clock` the
    microseconds since the start.
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
        """The height above home under which a return stays, for the fence's sake."""
        self.due_us = LOADED_US
        """When it is looked at next."""
        self._stale = True
        self.breach: Breach | None = None
        """What is violated now, while armed and in the air."""
        self.count = 0
        """How many breaches there were."""
        plans.listeners.append(self._plan_changed)

    def _plan_changed(self, kind: int) -> None:
        if kind == FENCE:
            self._area = FenceArea.of(self._plans.items(FENCE), self._home, self._rules.every)
            self.settings_changed()

    def settings_changed(self) -> None:
        """A parameter was set; the fence is another one a moment later."""
        self._limits, self.return_under = None, inf
        self._stale = True
        self.due_us = self._clock() + LOADED_US

    @property
    def in_force(self) -> bool:
        """Whether there is a fence."""
        return self._limits is not None

    @property
    def critical(self) -> bool:
        """Whether HEARTBEAT tells of a breach now."""
        return self.breach is not None and self._rules.critical(self._value)

    def allows(self, point: Point) -> bool:
        """Whether the fence that is in force now has nothing against a target there."""
        limits = self._limits
        return limits is None or (limits.floor <= point.up and limits.holds(point))

    def step(self, now_us: int, vehicle: Multirotor) -> Breach | None:
        """Lets time pass; the breach that began now, if one did."""
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
