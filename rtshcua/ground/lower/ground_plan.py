"""The ground plans of declared zones, in whole millimetres of the local plane.

A circle that is a zone by itself is exact. In a union or a difference, and for the ends and bends of a corridor, a
circle is replaced by an inscribed polygon of 128 corners, which differs from it by at most 0.031 % of the radius and
2 mm. Unions and differences are computed in exact fractions. Their corners are rounded, which moves an outline by at
most 1 mm, or by up to 9 mm where it touches itself or comes within a millimetre of itself.

A union is the area inside the common outline: two shapes with a common edge form one area.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.geojson import DataFiles, GeoRing
from rtshcua.ground.checker.report import Report
from rtshcua.ground.geometry.offset import within_disc
from rtshcua.ground.geometry.overlay import Curve, TooManyPieces, Windings, nested, rounded_boundary
from rtshcua.ground.geometry.polygons import Point, Ring, counter_clockwise, scaled, touching_edges
from rtshcua.ground.geometry.shapes import Polygonal, RoundArea, Shape, SimplePolygon, corners, polygonal
from rtshcua.model.flat.zone import MAX_COORDINATE, MAX_RINGS, MAX_VERTICES, Projection, project
from rtshcua.model.ir.expression import Coordinates
from rtshcua.model.ir.places import Circle, Combination, Corridor, GeoJson, Polygon, ZoneDecl
from rtshcua.model.ir.places import Shape as Declared


class GroundPlans:
    """Computes the ground plan of each zone, once. A zone with a finding has none."""

    def __init__(self, projection: Projection, zones: Mapping[str, ZoneDecl], data: DataFiles, report: Report) -> None:
        self._projection = projection
        self._zones = zones
        self._data = data
        self._report = report
        self._known: dict[str, Shape | None] = {}

    def of(self, zone: ZoneDecl) -> Shape | None:
        """Return the ground plan of a zone, or None after a finding."""
        name = zone.name.text
        if name not in self._known:
            self._known[name] = self._shape(zone.shape, zone)
        return self._known[name]

    def place(self, coordinates: Coordinates) -> Point | None:
        """Return a place in the local plane. Reports it and returns None if it is too far from home."""
        return self._projected(coordinates.longitude, coordinates.latitude, coordinates.span)

    def _projected(self, longitude: int, latitude: int, span: Span) -> Point | None:
        x, y = project(self._projection, latitude, longitude)
        if max(abs(x), abs(y)) <= MAX_COORDINATE:
            return x, y
        self._report.add(
            codes.TOO_FAR,
            span,
            "this place is more than 500 km from the vehicle's home",
            help="check the order: latitude first, then longitude",
        )
        return None

    def _shape(self, shape: Declared, zone: ZoneDecl) -> Shape | None:
        """Return a part of a zone. A reference is the ground plan of the zone that it names."""
        match shape:
            case Circle():
                center = self.place(shape.center)
                return None if center is None else RoundArea(center, shape.radius.value)
            case Polygon():
                return self._polygon(shape, zone)
            case Corridor():
                return self._corridor(shape, zone)
            case GeoJson():
                return self._geojson(shape, zone)
            case Combination():
                return self._combination(shape, zone)
            case _:
                return self.of(self._zones[shape.name])

    def _polygon(self, shape: Polygon, zone: ZoneDecl) -> Polygonal | None:
        rings: list[Ring] = []
        for number, written in enumerate((shape.corners, *shape.holes)):
            placed = [self.place(corner) for corner in written]
            found = [corner for corner in placed if corner is not None]
            if len(found) < len(placed):
                return None
            rings.append(_turned(found, hole=number > 0))
        if touching_edges(rings) is not None or not nested(rings):
            self._report.add(
                codes.BAD_POLYGON,
                zone.name.span,
                f"the edges of `{zone.name.text}` touch each other after its corners are rounded to millimetres",
            )
            return None
        return polygonal(tuple(rings))

    def _corridor(self, shape: Corridor, zone: ZoneDecl) -> Polygonal | None:
        """Return the union of a disc around each place and the rectangles between them."""
        placed = [self.place(point) for point in shape.points]
        points = [point for point in placed if point is not None]
        if len(points) < len(placed):
            return None
        half = shape.width.value // 2
        curves: list[Curve] = [within_disc(point, half) for point in points]
        for (ax, ay), (bx, by) in pairwise(points):
            x, y = scaled((by - ay, ax - bx), half)  # to the right of the corridor's axis
            curves.append(((ax + x, ay + y), (bx + x, by + y), (bx - x, by - y), (ax - x, ay - y)))
        return self._outlined([curves], lambda windings: windings[0] > 0, shape.span, zone)

    def _geojson(self, shape: GeoJson, zone: ZoneDecl) -> Polygonal | None:
        """Return the union of all polygons without their holes. RFC 7946 allows rings to touch each other."""
        area = self._data.area(shape)
        if not isinstance(area, tuple):
            return None
        groups: list[list[Curve]] = []
        for polygon in area:
            rings: list[Curve] = []
            for number, ring in enumerate((polygon.outer, *polygon.holes)):
                found = list(self._all(ring, shape.span))
                if len(found) < len(ring):
                    return None
                rings.append(_turned(found, hole=number > 0))
            groups.append(rings)
        together = [tuple(ring) for rings in groups for ring in rings]
        if touching_edges(together) is None and nested(together):
            return self._bounded(tuple(together), shape.span, zone)
        return self._outlined(groups, lambda windings: max(windings) > 0, shape.span, zone)

    def _all(self, ring: GeoRing, span: Span) -> Iterator[Point]:
        """Yield the corners in the local plane, up to the first that is too far from home."""
        for longitude, latitude in ring:
            point = self._projected(longitude, latitude, span)
            if point is None:
                return
            yield point

    def _combination(self, shape: Combination, zone: ZoneDecl) -> Polygonal | None:
        operands = [self._shape(each, zone) for each in shape.shapes]
        found = [_polygonal(each) for each in operands if each is not None]
        if len(found) < len(operands):
            return None

        def inside(windings: Windings) -> bool:
            if shape.operator == "union":
                return max(windings) > 0
            return windings[0] > 0 and max(windings[1:], default=0) <= 0

        return self._outlined([each.rings for each in found], inside, shape.span, zone)

    def _outlined(
        self, groups: Sequence[Sequence[Curve]], inside: Callable[[Windings], bool], span: Span, zone: ZoneDecl
    ) -> Polygonal | None:
        try:
            made = rounded_boundary(groups, inside)
        except TooManyPieces:
            made = None
        if made is None:
            self._report.add(
                codes.ZONE_SHAPE,
                span,
                f"the outline of `{zone.name.text}` cannot be computed in whole millimetres",
                help="let its parts overlap, or keep them some centimetres apart",
            )
            return None
        if not made.rings:
            self._report.add(
                codes.EMPTY_ZONE,
                span,
                f"`{zone.name.text}` is empty",
                help="the shapes that are subtracted must leave a part of the first shape"
                if span != zone.shape.span or isinstance(zone.shape, Combination)
                else None,
            )
            return None
        return self._bounded(made.rings, span, zone)

    def _bounded(self, rings: tuple[Ring, ...], span: Span, zone: ZoneDecl) -> Polygonal | None:
        """Return the shape. Reports it and returns None if it exceeds a limit."""
        count = sum(map(len, rings))
        if count > MAX_VERTICES or len(rings) > MAX_RINGS:
            many, most = (
                (f"{count:,} corners", MAX_VERTICES) if count > MAX_VERTICES else (f"{len(rings)} rings", MAX_RINGS)
            )
            message = f"the outline of `{zone.name.text}` has {many}, but at most {most:,} fit on board"
            self._report.add(codes.TOO_MANY, span, message)
            return None
        shape = polygonal(rings)
        if any(max(abs(x), abs(y)) > MAX_COORDINATE for x, y in corners(shape)):
            self._report.add(
                codes.TOO_FAR, span, f"`{zone.name.text}` extends more than 500 km from the vehicle's home"
            )
            return None
        return shape


def _polygonal(shape: Shape) -> Polygonal:
    return SimplePolygon(within_disc(shape.center, shape.radius)) if isinstance(shape, RoundArea) else shape


def _turned(ring: Sequence[Point], *, hole: bool) -> Ring:
    """Return the ring counter-clockwise, or clockwise for a hole."""
    turned = counter_clockwise(ring)
    return (turned[0], *reversed(turned[1:])) if hole else tuple(turned)
