"""Zones."""

from typing import Any, Literal

from rtshcua.diagnostics.codes import BAD_PERIOD
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.build.base import Part
from rtshcua.ground.language.build.literals import DAYS, whole_day
from rtshcua.ground.language.build.signals import Signals
from rtshcua.model.ir.expression import Coordinates, Quantity, TimeOfDay
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.places import (
    Circle,
    Combination,
    Corridor,
    Daily,
    Dates,
    GeoJson,
    Polygon,
    Shape,
    ZoneDecl,
)

DAILY, DATES = "active (times of day)", "active (dates)"


class Zones(Signals):
    """Where things are."""

    def circle(self, span: Span, center: Coordinates, radius: Quantity) -> Circle:
        """`circle(47.3977 N, 8.5456 E, 120 m)`."""
        return Circle(span=span, center=center, radius=radius)

    def ring(self, span: Span, *corners: Coordinates) -> tuple[Coordinates, ...]:
        """The corners of a polygon or of a hole in it."""
        return corners

    def hole(self, span: Span, corners: tuple[Coordinates, ...]) -> tuple[Coordinates, ...]:
        """`hole (47.3 N, 8.5 E, ...)`."""
        return corners

    def polygon(self, span: Span, corners: tuple[Coordinates, ...], *holes: tuple[Coordinates, ...]) -> Polygon:
        """`polygon(47.3 N, 8.5 E, ...) hole (...)`."""
        return Polygon(span=span, corners=corners, holes=holes)

    def corridor(self, span: Span, *parts: Any) -> Corridor:
        """`corridor(47.3 N, 8.5 E, 47.4 N, 8.5 E, width 40 m)`: places, and the width."""
        *points, width = parts
        return Corridor(span=span, points=tuple(points), width=width)

    def combination(self, span: Span, operator: Literal["union", "difference"], *shapes: Shape) -> Node:
        """`union(shape, ...)`, `difference(shape, ...)`."""
        made = Combination(span=span, operator=operator, shapes=shapes)
        return self.nested(made, *shapes, help="declare the inner ones as zones of their own, and name them here")

    def geojson(self, span: Span, path: str, feature: str | None) -> GeoJson:
        """`from "site.geojson" feature "bridge"`."""
        return GeoJson(span=span, path=path, feature=feature)

    def floor(self, span: Span, altitude: Quantity) -> Part:
        """`floor 0 m`."""
        return Part("floor", span, altitude)

    def ceiling(self, span: Span, altitude: Quantity) -> Part:
        """`ceiling 60 m above home`."""
        return Part("ceiling", span, altitude)

    def entry(self, span: Span, place: Coordinates) -> Part:
        """`entry 47.3982 N, 8.5466 E`."""
        return Part("entry", span, place)

    def daily(self, span: Span, start: TimeOfDay, end: TimeOfDay, days: tuple[int, ...] | None) -> Part:
        """`active 08:00 .. 18:00`, `active 08:00 .. 18:00 on monday .. friday`."""
        if start.value == end.value:
            help = "leave `active` out if the zone is there all day"
            self.report(BAD_PERIOD, "the zone would be active for no time at all", span, help)
        return Part(DAILY, span, Daily(span=span, start=start, end=end, days=days or ()))

    def on_days(self, span: Span, days: tuple[int, ...]) -> Part:
        """`active on saturday, sunday`."""
        start, end = whole_day(span)
        if len(days) == len(DAYS):
            help = "leave `active` out if the zone is always there"
            self.report(BAD_PERIOD, "the zone would be active on all days of the week", span, help)
        return Part(DAILY, span, Daily(span=span, start=start, end=end, days=days))

    def dates(self, span: Span, start: int, end: int) -> Part:
        """`active "2026-05-01T08:00Z" .. "2026-05-02T18:00Z"`."""
        if self.sound and start >= end:
            self.report(BAD_PERIOD, "the zone's time ends before it begins", span, "write the earlier moment first")
        return Part(DATES, span, Dates(span=span, start_us=start, end_us=end))

    def zone(self, span: Span, name: Name, shape: Shape, *given: Part) -> None:
        """`zone bridge_a = polygon(...) floor 0 m ceiling 60 m entry ...`."""
        self.undotted(name, "zone")
        found = {key: part.value for key, part in self.parts("zone", name, given).items()}
        self.declare(
            ZoneDecl(
                span=span,
                name=name,
                shape=shape,
                floor=found.get("floor"),
                ceiling=found.get("ceiling"),
                entry=found.get("entry"),
                daily=found.get(DAILY),
                dates=found.get(DATES),
            ),
            name,
        )
