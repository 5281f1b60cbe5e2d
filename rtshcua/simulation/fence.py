"""The geofence as the vehicle keeps it: polygons and circles on the plane around home, and a ceiling. Metres."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, inf
from typing import Self

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.simulation.place import Home, Point
from rtshcua.simulation.plan import Item

INCLUDED = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
EXCLUDED = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
ROUND_INCLUDED = mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION
ROUND_EXCLUDED = mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION
RETURN_POINT = mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT
POLYGONS = (INCLUDED, EXCLUDED)
CIRCLES = (ROUND_INCLUDED, ROUND_EXCLUDED)
COMMANDS = frozenset({*POLYGONS, *CIRCLES, RETURN_POINT})
_FEWEST_VERTICES = 3

Place = tuple[float, float]
"""Metres north and east of home."""


@dataclass(frozen=True, slots=True)
class Polygon:
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
class Circle:
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
class Area:
    """Where flying is allowed: inside what is included, outside of what is excluded."""

    included: tuple[Polygon | Circle, ...] = ()
    excluded: tuple[Polygon | Circle, ...] = ()
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
    def of(cls, items: Sequence[Item], home: Home, every: bool) -> Self:
        """The area that uploaded items draw; the items are well formed (`problem` found none)."""
        included: list[Polygon | Circle] = []
        excluded: list[Polygon | Circle] = []
        at = 0
        while at < len(items):
            item = items[at]
            count = int(item.p1) if item.command in POLYGONS else 1
            shape: Polygon | Circle
            if item.command in POLYGONS:
                shape = Polygon(tuple(home.local(vertex.x, vertex.y) for vertex in items[at : at + count]))
            else:
                shape = Circle(home.local(item.x, item.y), item.p1)
            if item.command in (INCLUDED, ROUND_INCLUDED):
                included.append(shape)
            elif item.command in (EXCLUDED, ROUND_EXCLUDED):
                excluded.append(shape)
            at += count
        return cls(tuple(included), tuple(excluded), every)


def problem(items: Sequence[Item]) -> bool:
    """Whether the items draw no fence: vertices too few or of mixed count, a circle without a radius."""
    at = 0
    while at < len(items):
        item = items[at]
        if item.command in CIRCLES:
            if not 0 < item.p1 < inf:
                return True
            at += 1
        elif item.command in POLYGONS:
            if not _FEWEST_VERTICES <= item.p1 < inf:
                return True
            vertices = items[at : at + int(item.p1)]
            if len(vertices) < int(item.p1) or any((v.command, v.p1) != (item.command, item.p1) for v in vertices):
                return True
            at += len(vertices)
        elif item.command == RETURN_POINT:
            at += 1
        else:
            return True
    return False


@dataclass(frozen=True, slots=True)
class Limits:
    """A fence in force: an area, and how high flying is allowed, in metres above home."""

    area: Area = Area()
    ceiling: float = inf

    def holds(self, point: Point) -> bool:
        """Whether flying is allowed there."""
        return point.up <= self.ceiling and self.area.holds(point.north, point.east)
