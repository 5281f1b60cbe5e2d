"""The zones of a policy: declared zones in the local plane, and zones derived from them for conditions.

`grow(zone, margin)` changes the ground plan; floor, ceiling and times stay. A derived zone is never too large in a
condition that permits or must hold, and never too small in one that forbids. Heights above sea level are converted with
the elevation of home. If the elevation has an error, conditions use a derived zone whose band is narrower or wider by
the error.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import msgspec

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.checks.zones import entry_outside
from rtshcua.ground.checker.geojson import DataFiles
from rtshcua.ground.checker.report import Report
from rtshcua.ground.geometry.offset import NoSuchOffset, inner, outer
from rtshcua.ground.geometry.polygons import Point, square
from rtshcua.ground.geometry.shapes import Region, RoundArea, Shape, are_disjoint, bounds, contains, lies_within
from rtshcua.ground.lower.ground_plan import GroundPlans
from rtshcua.ground.lower.tables import ValueSets
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.limits import DAY, WEEK
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, MAX_COORDINATE, Projection, Zone
from rtshcua.model.ir.expression import Coordinates, Quantity
from rtshcua.model.ir.places import VehicleDecl, ZoneDecl
from rtshcua.model.quantity import Datum, Dimension, display


class ZoneHeights:
    """Converts altitudes above sea level with the elevation of a vehicle's home."""

    def __init__(self, vehicle: VehicleDecl | None, report: Report) -> None:
        self._vehicle = vehicle
        self._report = report

    def band(self, zone: ZoneDecl) -> tuple[int, int, int, int]:
        """Return floor and ceiling in mm above home, and the largest error of each."""
        floor, floor_within = (LOWEST, 0) if zone.floor is None else self._above_home(zone.floor, zone)
        ceiling, ceiling_within = (HIGHEST, 0) if zone.ceiling is None else self._above_home(zone.ceiling, zone)
        if zone.floor is not None and zone.ceiling is not None and zone.floor.datum is not zone.ceiling.datum:
            self._crossed(zone, zone.ceiling, ceiling - floor)
        if floor < ceiling and floor + floor_within >= ceiling - ceiling_within:
            self._unsure(zone, ceiling - floor)
        return floor, ceiling, floor_within, ceiling_within

    def _above_home(self, height: Quantity, zone: ZoneDecl) -> tuple[int, int]:
        if height.datum is not Datum.SEA:
            return height.value, 0
        vehicle = self._vehicle
        if vehicle is None or vehicle.elevation is None:
            self._report.add(
                codes.NO_ELEVATION,
                height.span,
                f"`{zone.name.text}` has an altitude above sea, but the elevation of home is not declared",
                help="declare it in the vehicle, as in `elevation 408 m above sea within 5 m`",
                labels=[] if vehicle is None else [(vehicle.name.span, "the vehicle")],
            )
            return height.value, 0
        within = 0 if vehicle.elevation_within is None else vehicle.elevation_within.value
        return min(max(height.value - vehicle.elevation.value, LOWEST), HIGHEST), within

    def _crossed(self, zone: ZoneDecl, ceiling: Quantity, height: int) -> None:
        """Report a ceiling that is not above a floor of another datum; the checker cannot compare these."""
        assert zone.floor is not None
        if height <= 0:
            self._report.add(
                codes.FLOOR_ABOVE_CEILING,
                ceiling.span,
                f"the ceiling of `{zone.name.text}` is not above its floor",
                labels=[(zone.floor.span, f"the floor is {display(-height, Dimension.LENGTH)} higher, or as high")],
            )

    def _unsure(self, zone: ZoneDecl, height: int) -> None:
        assert self._vehicle is not None
        assert self._vehicle.elevation_within is not None
        self._report.add(
            codes.EMPTY_ZONE,
            zone.name.span,
            f"`{zone.name.text}` is {display(height, Dimension.LENGTH)} high, and with the error of the elevation no "
            "height is certainly inside",
            help="make the zone higher than twice the error of the elevation, or measure the elevation more exactly",
            labels=[(self._vehicle.elevation_within.span, "the error of the elevation")],
        )


#: an empty zone, without height, and a zone that contains everything
NOWHERE = Zone("nowhere", CIRCLE, LOWEST, LOWEST, (0, 0, 1))
EVERYWHERE = Zone("everywhere", CIRCLE, LOWEST, HIGHEST, (0, 0, MAX_COORDINATE * MAX_COORDINATE))
#: replaces the ground plan of a zone after a finding
_UNKNOWN = RoundArea((0, 0), 1)


class ZoneTable:
    """Zones by name and index. A derived zone is created when it is first used."""

    def __init__(
        self,
        projection: Projection,
        declared: Sequence[ZoneDecl],
        report: Report,
        vehicle: VehicleDecl | None = None,
        data: DataFiles | None = None,
    ) -> None:
        self.projection = projection
        self._report = report
        self._declarations = tuple(declared)
        self.index: Mapping[str, int] = {zone.name.text: number for number, zone in enumerate(declared)}
        by_name = {zone.name.text: zone for zone in declared}
        self._plans = GroundPlans(projection, by_name, data or DataFiles(), report)
        self._heights = ZoneHeights(vehicle, report)
        self._broken: set[int] = set()
        self.regions = [self._region(number, zone) for number, zone in enumerate(declared)]
        self.derived: list[Zone] = []
        self.tables: list[tuple[int, ...]] = []
        self._derived: dict[tuple[int, int, bool], int] = {}
        self._tables: dict[tuple[int, bool], int] = {}
        self._dated: dict[tuple[int, ...], int] = {}

    def flat(self) -> tuple[Zone, ...]:
        """Return all zones in the flat form, the declared ones first."""
        names = (zone.name.text for zone in self._declarations)
        return (*(region.flat(name) for name, region in zip(names, self.regions, strict=True)), *self.derived)

    def place(self, coordinates: Coordinates) -> Point | None:
        """Return a place in the local plane. Reports it and returns None if it is too far from home."""
        return self._plans.place(coordinates)

    def zone(self, name: str, margin: int, *, smaller: bool, span: Span) -> int:
        """Return the index of a declared zone grown (or shrunk) by `margin` mm. `smaller` is the safe side."""
        number = self.index[name]
        if margin == 0 and self.regions[number].sure():
            return number
        key = (number, margin, smaller)
        found = self._derived.get(key)
        if found is None:
            found = self._derived[key] = self._add(self._derive(number, margin, smaller=smaller, span=span))
        return found

    def table(self, margin: int, *, smaller: bool) -> int:
        """Return the index of a table from each declared zone to its derived zone."""
        key = (margin, smaller)
        found = self._tables.get(key)
        if found is None:
            entries = [self._entry(number, margin, smaller=smaller) for number in range(len(self.regions))]
            found = self._tables[key] = len(self.tables)
            self.tables.append(tuple(entries))
        return found

    def within(self, name: str, margin: int, *, smaller: bool, span: Span) -> tuple[int, ...]:
        """Return the declared zones within a zone grown by `margin`, which is taken to exist.

        With `smaller` they are those that certainly lie within it, else those that may.
        """
        outside = self.region(name, margin, smaller=smaller, span=span)
        if outside is None:
            return ()
        return self._which(lambda region: lies_within(region, outside, surely=smaller))

    def disjoint(self, name: str, margin: int, *, smaller: bool, span: Span) -> tuple[int, ...]:
        """Return the declared zones disjoint from a zone grown by `margin`, which is taken to exist.

        With `smaller` they are those that may be disjoint, else those that certainly are.
        """
        other = self.region(name, margin, smaller=smaller, span=span)
        if other is None:
            return tuple(range(len(self.regions)))
        return self._which(lambda region: are_disjoint(region, other, surely=not smaller))

    def region(self, name: str, margin: int, *, smaller: bool, span: Span) -> Region | None:
        """Return a declared zone grown by `margin` as a region. Reports it and returns None if there is none."""
        number = self.index[name]
        if number in self._broken:
            return None
        try:
            return _grown(self.regions[number], margin, smaller=smaller)
        except NoSuchOffset as unshapely:
            self._unshapely(unshapely, number, margin, span)
            return None

    def times(self, name: str, sets: ValueSets) -> Iterator[tuple[Op, int, int]]:
        """Yield instructions that are true while a declared zone exists; none for a zone that always exists."""
        region = self.regions[self.index[name]]
        if region.daily:
            start, end = region.daily
            yield Op.TIME_IN, start, end
        if region.weekly:
            yield Op.WEEK_IN, sets.of(region.weekly), 0
        if region.dates:
            found = self._dated.get(region.dates)
            if found is None:
                zone = msgspec.structs.replace(EVERYWHERE, dates=region.dates)
                found = self._dated[region.dates] = self._add(zone)
            yield Op.POSITION_IN, found, 0

    def _which(self, holds: Callable[[Region], bool]) -> tuple[int, ...]:
        return tuple(number for number, region in enumerate(self.regions) if holds(region))

    def _region(self, number: int, zone: ZoneDecl) -> Region:
        shape = self._plans.of(zone)
        if shape is None:
            self._broken.add(number)
            shape = _UNKNOWN
        elif zone.entry is not None:
            entry = self.place(zone.entry)
            if entry is not None and not _contains(shape, entry):
                entry_outside(self._report, zone)
        daily, weekly = _hours(zone)
        dates = () if zone.dates is None else (zone.dates.start_us, zone.dates.end_us)
        return Region(shape, *self._heights.band(zone), daily=daily, dates=dates, weekly=weekly)

    def _derive(self, number: int, margin: int, *, smaller: bool, span: Span) -> Zone:
        name = self._declarations[number].name.text
        region = self.region(name, margin, smaller=smaller, span=span)
        sure = None if region is None else region.banded(smaller=smaller)
        return NOWHERE if sure is None else sure.flat(derived_name(name, margin, smaller=smaller))

    def _entry(self, number: int, margin: int, *, smaller: bool) -> int:
        """Return the index of a derived zone for a table. If there is none, the zone makes the condition fail."""
        if margin == 0 and self.regions[number].sure():
            return number
        key = (number, margin, smaller)
        found = self._derived.get(key)
        if found is None:
            try:
                region = _grown(self.regions[number], margin, smaller=smaller).banded(smaller=smaller)
                name = derived_name(self._declarations[number].name.text, margin, smaller=smaller)
                zone = NOWHERE if region is None else region.flat(name)
            except NoSuchOffset as unshapely:
                zone = NOWHERE if smaller or unshapely.reason == "nothing" else EVERYWHERE
            found = self._derived[key] = self._add(zone)
        return found

    def _add(self, zone: Zone) -> int:
        self.derived.append(zone)
        return len(self.regions) + len(self.derived) - 1

    def _unshapely(self, unshapely: NoSuchOffset, number: int, margin: int, span: Span) -> None:
        zone = self._declarations[number]
        done = f"{'grown' if margin > 0 else 'shrunk'} by {display(abs(margin), Dimension.LENGTH)}"
        labels = [(zone.name.span, "the zone is declared here")]
        if unshapely.reason == "nothing":
            self._report.add(codes.ZONE_VANISHES, span, f"`{zone.name.text}` is empty when it is {done}", labels=labels)
            return
        problem = {
            "far": "it extends more than 500 km from home",
            "corners": "its outline has more corners than fit on board",
            "unproved": "its outline cannot be computed in whole millimetres",
        }[unshapely.reason]
        self._report.add(
            codes.ZONE_SHAPE,
            span,
            f"when `{zone.name.text}` is {done}, {problem}",
            help="declare a zone of the wanted shape instead",
            labels=labels,
        )


def derived_name(name: str, margin: int, *, smaller: bool) -> str:
    """Return the name of a derived zone: `grow(...)`, or `surely(...)` or `possibly(...)` for a margin of 0."""
    if margin == 0:
        return f"{'surely' if smaller else 'possibly'}({name})"
    return f"grow({name}, {display(margin, Dimension.LENGTH)})"


def _hours(zone: ZoneDecl) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return the windows of the day and of the week of a zone, one of which is empty."""
    hours = zone.daily
    if hours is None:
        return (), ()
    if not hours.days:
        return (hours.start.value % DAY, hours.end.value), ()
    windows = weekly_windows(hours.start.value, hours.end.value, hours.days)
    return (), () if windows == (0, WEEK) else windows


def _contains(shape: Shape, point: Point) -> bool:
    if isinstance(shape, RoundArea):
        return square(point, shape.center) < shape.radius * shape.radius
    return contains(shape, point)


def _grown(region: Region, margin: int, *, smaller: bool) -> Region:
    """Return a region grown by `margin`, rounded to the safe side. Raises `NoSuchOffset`."""
    shape = inner(region.shape, margin) if smaller else outer(region.shape, margin)
    if max(map(abs, bounds(shape))) > MAX_COORDINATE:
        raise NoSuchOffset("far")
    return replace(region, shape=shape)


def weekly_windows(start: int, end: int, days: Iterable[int]) -> tuple[int, ...]:
    """Return windows of the week as in `Zone.weekly`: from `start` to `end` inclusive, possibly over midnight."""
    after = end + 1 if start <= end else end + 1 + DAY
    spans = [(day * DAY + start, day * DAY + after) for day in days]
    within = [(low, min(high, WEEK)) for low, high in spans] + [(0, high - WEEK) for _, high in spans if high > WEEK]
    merged: list[int] = []
    for low, high in sorted(within):
        if merged and low <= merged[-1]:
            merged[-1] = max(merged[-1], high)
        else:
            merged += (low, high)
    return tuple(merged)
