"""The zones of a policy: declared ones in the local plane, and those derived from them for its conditions.

`grow(zone, margin)` works on the ground plan; floor and ceiling stay. Where a condition permits or must hold, the
derived zone is never too large; where it forbids, never too small.
"""

from collections.abc import Callable, Mapping, Sequence

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.polygons import counter_clockwise, crossing
from rtshcua.ground.checker.report import Report
from rtshcua.ground.compiler.offset import Unshapely, inner, outer
from rtshcua.ground.compiler.relations import have_nothing_in_common, lies_within
from rtshcua.ground.compiler.shapes import Disc, Outline, Point, Region, bounds
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, MAX_COORDINATE, Projection, Zone, project
from rtshcua.model.ir.expression import Coordinates
from rtshcua.model.ir.places import Circle, ZoneDecl
from rtshcua.model.quantity import Dimension, display

#: a zone that nothing is inside of, for it has no height, and one that everything is inside of
NOWHERE = Zone("nowhere", CIRCLE, LOWEST, LOWEST, (0, 0, 1))
EVERYWHERE = Zone("everywhere", CIRCLE, LOWEST, HIGHEST, (0, 0, MAX_COORDINATE * MAX_COORDINATE))


class ZoneTable:
    """Zones by name and index; asking for a derived one makes it."""

    def __init__(self, projection: Projection, declared: Sequence[ZoneDecl], report: Report) -> None:
        self.projection = projection
        self._report = report
        self._declarations = tuple(declared)
        self.index: Mapping[str, int] = {zone.name.text: number for number, zone in enumerate(declared)}
        self.regions = [self._region(zone) for zone in declared]
        self.derived: list[Zone] = []
        self.tables: list[tuple[int, ...]] = []
        self._derived: dict[tuple[int, int, bool], int] = {}
        self._tables: dict[tuple[int, bool], int] = {}

    def flat(self) -> tuple[Zone, ...]:
        """All zones, the declared ones first."""
        names = (zone.name.text for zone in self._declarations)
        return (*(region.flat(name) for name, region in zip(names, self.regions, strict=True)), *self.derived)

    def place(self, coordinates: Coordinates) -> Point | None:
        """A place in the local plane; None, and reported, where it is too far from home."""
        x, y = project(self.projection, coordinates.latitude, coordinates.longitude)
        if max(abs(x), abs(y)) <= MAX_COORDINATE:
            return x, y
        self._report.add(
            codes.TOO_FAR,
            coordinates.span,
            "this place is more than 500 km from the vehicle's home",
            help="are latitude and longitude the right way round?",
        )
        return None

    def zone(self, name: str, margin: int, *, smaller: bool, span: Span) -> int:
        """The index of a declared zone grown by `margin` mm, or shrunk; `smaller` says which side is the safe one."""
        number = self.index[name]
        if margin == 0:
            return number
        key = (number, margin, smaller)
        found = self._derived.get(key)
        if found is None:
            found = self._derived[key] = self._add(self._derive(number, margin, smaller=smaller, span=span))
        return found

    def table(self, margin: int, *, smaller: bool) -> int:
        """The index of a table from each declared zone to the one derived from it."""
        key = (margin, smaller)
        found = self._tables.get(key)
        if found is None:
            entries = [self._entry(number, margin, smaller=smaller) for number in range(len(self.regions))]
            found = self._tables[key] = len(self.tables)
            self.tables.append(tuple(entries))
        return found

    def within(self, name: str, margin: int, *, smaller: bool, span: Span) -> tuple[int, ...]:
        """The declared zones that lie within a zone grown by `margin`."""
        outer_region = self.region(name, margin, smaller=smaller, span=span)
        return self._which(lambda region: outer_region is not None and lies_within(region, outer_region))

    def disjoint(self, name: str, margin: int, *, smaller: bool, span: Span) -> tuple[int, ...]:
        """The declared zones that have no point in common with a zone grown by `margin`."""
        other = self.region(name, margin, smaller=smaller, span=span)
        return self._which(lambda region: other is None or have_nothing_in_common(region, other))

    def region(self, name: str, margin: int, *, smaller: bool, span: Span) -> Region | None:
        """A declared zone grown by `margin`, as a region of the plane; None, and reported, where nothing is left."""
        number = self.index[name]
        region = self.regions[number]
        try:
            return _grown(region, margin, smaller=smaller)
        except Unshapely as unshapely:
            self._unshapely(unshapely, number, margin, span)
            return None

    def _which(self, holds: Callable[[Region], bool]) -> tuple[int, ...]:
        return tuple(number for number, region in enumerate(self.regions) if holds(region))

    def _region(self, zone: ZoneDecl) -> Region:
        shape = zone.shape
        floor = LOWEST if zone.floor is None else zone.floor.value
        ceiling = HIGHEST if zone.ceiling is None else zone.ceiling.value
        if isinstance(shape, Circle):
            center = self.place(shape.center) or (0, 0)
            return Region(Disc(center, shape.radius.value), floor, ceiling)
        corners = [self.place(corner) or (0, 0) for corner in shape.corners]
        if crossing(corners) is not None and not self._report.failed():
            self._report.add(
                codes.BAD_POLYGON,
                zone.name.span,
                f"the edges of `{zone.name.text}` touch each other when its corners are rounded to millimetres",
            )
        return Region(Outline(tuple(counter_clockwise(corners))), floor, ceiling)

    def _derive(self, number: int, margin: int, *, smaller: bool, span: Span) -> Zone:
        name = self._declarations[number].name.text
        region = self.region(name, margin, smaller=smaller, span=span)
        return NOWHERE if region is None else region.flat(derived_name(name, margin))

    def _entry(self, number: int, margin: int, *, smaller: bool) -> int:
        """Where a zone cannot be derived, the one that fails what asks for it."""
        if margin == 0:
            return number
        key = (number, margin, smaller)
        found = self._derived.get(key)
        if found is None:
            try:
                region = _grown(self.regions[number], margin, smaller=smaller)
                zone = region.flat(derived_name(self._declarations[number].name.text, margin))
            except Unshapely as unshapely:
                zone = NOWHERE if smaller or unshapely.reason == "nothing" else EVERYWHERE
            found = self._derived[key] = self._add(zone)
        return found

    def _add(self, zone: Zone) -> int:
        self.derived.append(zone)
        return len(self.regions) + len(self.derived) - 1

    def _unshapely(self, unshapely: Unshapely, number: int, margin: int, span: Span) -> None:
        zone = self._declarations[number]
        done = f"{'grown' if margin > 0 else 'shrunk'} by {display(abs(margin), Dimension.LENGTH)}"
        labels = [(zone.name.span, "the zone is declared here")]
        if unshapely.reason == "nothing":
            self._report.add(
                codes.ZONE_VANISHES, span, f"nothing is left of `{zone.name.text}` when it is {done}", labels=labels
            )
            return
        words = {
            "parts": "it falls into parts",
            "holes": "it encloses a hole",
            "far": "it reaches further than 500 km from home",
            "unproved": "its outline cannot be proved in whole millimetres",
        }[unshapely.reason]
        self._report.add(
            codes.ZONE_SHAPE,
            span,
            f"when `{zone.name.text}` is {done}, {words}",
            help="declare a zone of the shape that you mean",
            labels=labels,
        )


def derived_name(name: str, margin: int) -> str:
    """How a derived zone is called."""
    return f"grow({name}, {display(margin, Dimension.LENGTH)})"


def _grown(region: Region, margin: int, *, smaller: bool) -> Region:
    """A region grown by `margin` on the safe side, as long as it stays within the local plane."""
    shape = inner(region.shape, margin) if smaller else outer(region.shape, margin)
    if max(map(abs, bounds(shape))) > MAX_COORDINATE:
        raise Unshapely("far")
    return Region(shape, region.floor, region.ceiling)
