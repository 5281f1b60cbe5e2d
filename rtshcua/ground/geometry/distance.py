"""Exact comparisons of distances in the integer plane, without a root and without a float."""

from rtshcua.ground.geometry.polygons import meet
from rtshcua.ground.geometry.shapes import Point

Edge = tuple[Point, Point]


def within(p: Point, edge: Edge, limit: int) -> bool:
    """Whether p is at most `limit` (not negative) from a segment."""
    return _compare(p, edge, limit) <= 0


def apart(one: Edge, other: Edge, limit: int) -> bool:
    """Whether two segments are at least `limit` (above zero) from each other everywhere."""
    if meet(*one, *other):
        return False
    return (
        _compare(one[0], other, limit) >= 0
        and _compare(one[1], other, limit) >= 0
        and _compare(other[0], one, limit) >= 0
        and _compare(other[1], one, limit) >= 0
    )


def far(p: Point, edge: Edge, limit: int) -> bool:
    """Whether p is at least `limit` from a segment."""
    return _compare(p, edge, limit) >= 0


def _compare(p: Point, edge: Edge, limit: int) -> int:
    """The sign of the distance of p from a segment, less `limit`."""
    (ax, ay), (bx, by) = edge
    ux, uy, vx, vy = bx - ax, by - ay, p[0] - ax, p[1] - ay
    along, square = ux * vx + uy * vy, ux * ux + uy * uy
    if along <= 0:
        distance, bound = vx * vx + vy * vy, limit * limit
    elif along >= square:
        wx, wy = p[0] - bx, p[1] - by
        distance, bound = wx * wx + wy * wy, limit * limit
    else:
        cross = ux * vy - uy * vx
        distance, bound = cross * cross, limit * limit * square
    return (distance > bound) - (distance < bound)
