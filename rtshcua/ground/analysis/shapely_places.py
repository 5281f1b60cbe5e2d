"""Places within what is left of zones without others, found with floats: each is only a guess, to be verified."""

from collections.abc import Iterator, Sequence

import shapely

from rtshcua.decision.outline import rings
from rtshcua.ground.geometry.polygons import Point
from rtshcua.model.flat.zone import CIRCLE, Zone

#: straight pieces of a quarter circle
_QUARTER = 64


def places(inside: Sequence[Zone], outside: Sequence[Zone]) -> Iterator[Point]:
    """One place in each part, the largest part first."""
    left = _plan(inside[0])
    for zone in inside[1:]:
        left = left.intersection(_plan(zone))
    for zone in outside:
        left = left.difference(_plan(zone))
    parts = [part for part in shapely.get_parts(left) if part.area > 0]
    for part in sorted(parts, key=lambda each: -float(each.area)):
        point = part.representative_point()
        yield round(point.x), round(point.y)


def _plan(zone: Zone) -> shapely.Geometry:
    if zone.shape == CIRCLE:
        x, y, square = zone.data
        return shapely.Point(x, y).buffer(square**0.5, quad_segs=_QUARTER)
    plan = shapely.Polygon()
    for ring in rings(zone):  # a hole takes away from what is around it, a part in a hole adds
        plan = plan.symmetric_difference(shapely.Polygon(ring))
    return plan
