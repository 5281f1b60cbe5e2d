"""E0501 to E0504: a zone is a simple polygon or a circle on the globe, with its floor below its ceiling."""

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.fields import height, on_globe, quantity
from rtshcua.ground.checker.polygons import Corner, contains, crossing
from rtshcua.model.flat.zone import MAX_VERTICES
from rtshcua.model.ir.expression import Coordinates
from rtshcua.model.ir.places import Circle, Polygon, ZoneDecl
from rtshcua.model.quantity import Dimension


def check(context: Context) -> None:
    """Report every zone that no vehicle could be inside of, or that has no clear inside."""
    for zone in context.symbols.zones.values():
        height(context, zone.floor)
        height(context, zone.ceiling)
        _heights(context, zone)
        shape = zone.shape
        if isinstance(shape, Circle):
            quantity(context, shape.radius, Dimension.LENGTH)
            on_globe(context, shape.center)
        elif all(on_globe(context, corner) for corner in shape.corners):
            _polygon(context, zone, shape)
        if zone.entry is not None:
            on_globe(context, zone.entry)


def _heights(context: Context, zone: ZoneDecl) -> None:
    if zone.floor is not None and zone.ceiling is not None and zone.floor.value >= zone.ceiling.value:
        context.report.add(
            codes.FLOOR_ABOVE_CEILING,
            zone.ceiling.span,
            f"the ceiling of `{zone.name.text}` is not above its floor",
            labels=[(zone.floor.span, "the floor is here")],
        )


def _polygon(context: Context, zone: ZoneDecl, shape: Polygon) -> None:
    report = context.report
    corners = [_corner(each) for each in shape.corners]
    if len(corners) < 3:
        report.add(
            codes.BAD_POLYGON,
            shape.span,
            f"the polygon has {len(corners)} corner{'' if len(corners) == 1 else 's'}, and needs three",
        )
        return
    if len(corners) > MAX_VERTICES:
        report.add(
            codes.TOO_MANY,
            shape.span,
            f"the polygon has {len(corners)} corners, and at most {MAX_VERTICES} fit on board",
        )
        return
    if corners[0] == corners[-1]:
        report.add(
            codes.BAD_POLYGON,
            shape.corners[-1].span,
            "the last corner repeats the first one",
            help="leave it out: a polygon is closed by itself",
            labels=[(shape.corners[0].span, "the first corner")],
        )
        return
    met = crossing(corners)
    if met is not None:
        i, j = met
        report.add(
            codes.BAD_POLYGON,
            zone.name.span,
            f"the edges of `{zone.name.text}` cross or touch each other",
            help="write the corners in the order in which one walks around the zone",
            labels=[
                (shape.corners[i].span, "the edge that begins here"),
                (shape.corners[j].span, "meets the edge that begins here"),
            ],
        )
    elif zone.entry is not None and not contains(corners, _corner(zone.entry)):
        entry_outside(context, zone)


def entry_outside(context: Context, zone: ZoneDecl) -> None:
    """Report an entry that is not strictly inside of its zone."""
    assert zone.entry is not None
    context.report.add(
        codes.ENTRY_OUTSIDE,
        zone.entry.span,
        f"the entry of `{zone.name.text}` does not lie inside of it",
        help="an entry lies inside, not on the edge: a vehicle must be in the zone when it is there",
        labels=[(zone.shape.span, "the zone is here")],
    )


def _corner(place: Coordinates) -> Corner:
    return place.longitude, place.latitude
