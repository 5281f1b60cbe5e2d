"""Check zones: their outline is simple, the floor is below the ceiling, and no zone is defined by itself."""

from collections.abc import Iterator

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.fields import height, on_globe, quantity
from rtshcua.ground.checker.geojson import NoArea
from rtshcua.ground.checker.lookup import find_zone
from rtshcua.ground.checker.report import Report
from rtshcua.ground.geometry.polygons import Point, contained, contains, crossing, touching_edges
from rtshcua.model.flat.zone import MAX_RINGS, MAX_VERTICES, meridian
from rtshcua.model.ir.expression import Coordinates, Reference
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.places import Circle, Combination, Corridor, GeoJson, Polygon, Shape, ZoneDecl
from rtshcua.model.quantity import Dimension

LEAST_WIDTH = 100  # mm


def check_zones(context: CheckContext) -> None:
    """Report every zone with an invalid outline, band or entry."""
    for zone in context.symbols.zones.values():
        height(context, zone.floor)
        height(context, zone.ceiling)
        _heights(context, zone)
        for shape in operands(context, zone):
            match shape:
                case Circle():
                    quantity(context, shape.radius, Dimension.LENGTH)
                    on_globe(context, shape.center)
                case Polygon():
                    _polygon(context, zone, shape)
                case Corridor():
                    _corridor(context, shape)
                case GeoJson():
                    _geojson(context, shape)
        if zone.entry is not None:
            on_globe(context, zone.entry)
    circles(context)


def _heights(context: CheckContext, zone: ZoneDecl) -> None:
    floor, ceiling = zone.floor, zone.ceiling
    if floor is None or ceiling is None or floor.datum is not ceiling.datum:
        return  # of different datum: compared where the elevation of home is known
    if floor.value >= ceiling.value:
        context.report.add(
            codes.FLOOR_ABOVE_CEILING,
            ceiling.span,
            f"the ceiling of `{zone.name.text}` is not above its floor",
            labels=[(floor.span, "the floor is here")],
        )


def _geojson(context: CheckContext, shape: GeoJson) -> None:
    found = context.data.area(shape)
    if isinstance(found, NoArea):
        name = context.data.name(shape)
        context.report.add(found.code, shape.span, f"`{name}` cannot be used: {found.message}", help=found.help)


def _corridor(context: CheckContext, shape: Corridor) -> None:
    before = len(context.report.found)
    quantity(context, shape.width, Dimension.LENGTH, positive=False)
    for point in shape.points:
        on_globe(context, point)
    if len(context.report.found) > before:
        return
    if len(shape.points) < 2:
        context.report.add(
            codes.BAD_CORRIDOR,
            shape.span,
            f"the corridor has {len(shape.points)} point{'' if len(shape.points) == 1 else 's'}; it needs two",
            help="write a `circle` for the area around one point",
        )
    for a, b in zip(shape.points, shape.points[1:], strict=False):
        if _corner(a, a) == _corner(b, a):
            context.report.add(
                codes.BAD_CORRIDOR,
                b.span,
                "the corridor repeats a point",
                help="remove the second one",
                labels=[(a.span, "the same point")],
            )
    if shape.width.value < LEAST_WIDTH:
        context.report.add(
            codes.BAD_CORRIDOR,
            shape.width.span,
            "the corridor has no width" if shape.width.value == 0 else "the corridor is too narrow to fly in",
            help="write the width from edge to edge, at least `10 cm`",
        )


def _polygon(context: CheckContext, zone: ZoneDecl, shape: Polygon) -> None:
    rings = (shape.corners, *shape.holes)
    before = len(context.report.found)
    for ring in rings:
        for corner in ring:
            on_globe(context, corner)
    if len(context.report.found) > before or not all(_ring(context, zone, shape, ring) for ring in rings):
        return
    count = sum(map(len, rings))
    if count > MAX_VERTICES or len(rings) > MAX_RINGS:
        what, most = (f"{count} corners", MAX_VERTICES) if count > MAX_VERTICES else (f"{len(rings)} rings", MAX_RINGS)
        context.report.add(codes.TOO_MANY, shape.span, f"the polygon has {what}; the limit is {most}")
        return
    if not _holes(context, zone, shape):
        return
    placed = [_corners(shape, ring) for ring in rings]
    if zone.entry is not None and zone.shape is shape and not contained(placed, _corner(zone.entry, shape.corners[0])):
        entry_outside(context.report, zone)


def _ring(context: CheckContext, zone: ZoneDecl, shape: Polygon, ring: tuple[Coordinates, ...]) -> bool:
    """Whether a ring of a polygon is simple."""
    report = context.report
    corners = _corners(shape, ring)
    what, whole = ("polygon", shape.span) if ring is shape.corners else ("hole", ring[0].span)
    if len(corners) < 3:
        report.add(
            codes.BAD_POLYGON,
            whole,
            f"the {what} has {len(corners)} corner{'' if len(corners) == 1 else 's'}; it needs three",
        )
        return False
    if corners[0] == corners[-1]:
        report.add(
            codes.BAD_POLYGON,
            ring[-1].span,
            "the last corner repeats the first one",
            help=f"remove it: a {what} closes itself",
            labels=[(ring[0].span, "the first corner")],
        )
        return False
    met = crossing(corners)
    if met is None:
        return True
    i, j = met
    report.add(
        codes.BAD_POLYGON,
        zone.name.span,
        f"the edges of `{zone.name.text}` cross or touch each other",
        help="write the corners in their order along the outline",
        labels=[
            (ring[i].span, "the edge that begins here"),
            (ring[j].span, "meets the edge that begins here"),
        ],
    )
    return False


def _holes(context: CheckContext, zone: ZoneDecl, shape: Polygon) -> bool:
    """Whether all holes are inside the polygon and do not overlap; reports it if not."""
    rings = (shape.corners, *shape.holes)
    placed = [_corners(shape, ring) for ring in rings]
    met = touching_edges(placed)
    if met is not None:
        (one, i), (other, j) = met
        context.report.add(
            codes.BAD_POLYGON,
            zone.name.span,
            f"a hole in `{zone.name.text}` crosses or touches another edge",
            help="cut out an area that overlaps the edge with `difference`",
            labels=[
                (rings[one][i].span, "the edge that begins here"),
                (rings[other][j].span, "meets the edge that begins here"),
            ],
        )
        return False
    for number, hole in enumerate(shape.holes):
        first = placed[1 + number][0]
        around = [each for i, each in enumerate(placed[1:]) if i != number and contains(each, first)]
        if around or not contains(placed[0], first):
            context.report.add(
                codes.BAD_POLYGON,
                hole[0].span,
                "the hole is inside another hole" if around else "the hole is outside its polygon",
                help="a hole must be inside the polygon and outside all other holes",
                labels=[(zone.name.span, "the zone is declared here")],
            )
            return False
    return True


def entry_outside(report: Report, zone: ZoneDecl) -> None:
    """Report an entry that is not strictly inside its zone."""
    assert zone.entry is not None
    report.add(
        codes.ENTRY_OUTSIDE,
        zone.entry.span,
        f"the entry of `{zone.name.text}` is not inside the zone",
        help="move the entry into the zone, away from its edge",
        labels=[(zone.shape.span, "the zone is here")],
    )


def _corners(shape: Polygon, ring: tuple[Coordinates, ...]) -> list[Point]:
    return [_corner(each, shape.corners[0]) for each in ring]


def _corner(place: Coordinates, near: Coordinates) -> Point:
    """A point in the plane of longitudes and latitudes near another, across longitude 180 if that is shorter."""
    return meridian(place.longitude, near.longitude), place.latitude


def parts(shape: Shape) -> Iterator[Shape]:
    """A shape, and all shapes of which it consists."""
    yield shape
    if isinstance(shape, Combination):
        for each in shape.shapes:
            yield from parts(each)


def named(zone: ZoneDecl) -> Iterator[Reference]:
    """The zones that the shape of a zone names."""
    return (each for each in parts(zone.shape) if isinstance(each, Reference))


def operands(context: CheckContext, zone: ZoneDecl) -> Iterator[Shape]:
    """The shapes of a zone, without other zones; reports names of unknown zones."""
    for each in parts(zone.shape):
        if isinstance(each, Reference):
            find_zone(context, Name(span=each.span, text=each.name))
        elif not isinstance(each, Combination):
            yield each


def circles(context: CheckContext) -> None:
    """Report each zone that is defined by itself, once for each cycle."""
    zones = context.symbols.zones
    finished: set[str] = set()
    for start in zones:
        way: list[tuple[str, Iterator[Reference]]] = [(start, named(zones[start]))] if start not in finished else []
        while way:
            name, waiting = way[-1]
            reference = next(waiting, None)
            if reference is None:
                finished.add(name)
                way.pop()
            elif reference.name in (each for each, _ in way):
                _circle(context, reference, [each for each, _ in way])
            elif reference.name in zones and reference.name not in finished:
                way.append((reference.name, named(zones[reference.name])))


def _circle(context: CheckContext, closing: Reference, way: list[str]) -> None:
    around = way[way.index(closing.name) :]
    context.report.add(
        codes.ZONE_CYCLE,
        closing.span,
        f"`{closing.name}` is defined by itself"
        + (f": {' -> '.join(f'`{each}`' for each in (*around, closing.name))}" if around[1:] else ""),
        help="define the zone by shapes, or by zones that do not depend on it",
        labels=[(context.symbols.zones[each].name.span, "declared here") for each in around],
    )
