"""Whether one region lies within another, or has no point in common with it. Exact: integers and fractions."""

from fractions import Fraction
from itertools import pairwise

from rtshcua.ground.checker.polygons import contains
from rtshcua.ground.compiler.distance import Edge, far
from rtshcua.ground.compiler.shapes import Disc, Outline, Point, Region, Shape, bounds, edges

#: a point with rational coordinates, scaled to integers: x, y and their common denominator
_Scaled = tuple[int, int, int]


def lies_within(inner: Region, outer: Region) -> bool:
    """Whether every point of the open set `inner` is one of `outer`; a common boundary does no harm."""
    if inner.floor < outer.floor or inner.ceiling > outer.ceiling:
        return False
    (w, s, e, n), (west, south, east, north) = bounds(inner.shape), bounds(outer.shape)
    if w < west or s < south or e > east or n > north:
        return False
    return _flat_within(inner.shape, outer.shape)


def _flat_within(inner: Shape, outer: Shape) -> bool:
    if isinstance(outer, Disc):
        if isinstance(inner, Disc):
            room = outer.radius - inner.radius
            return room >= 0 and _square(inner.center, outer.center) <= room * room
        return all(_square(corner, outer.center) <= outer.radius * outer.radius for corner in inner.corners)
    if isinstance(inner, Disc):
        corners = outer.corners
        return contains(corners, inner.center) and all(far(inner.center, edge, inner.radius) for edge in edges(outer))
    return all(_side(piece, outer) >= 0 for piece in _pieces(inner, outer))


def have_nothing_in_common(one: Region, other: Region) -> bool:
    """Whether two open sets are disjoint; touching boundaries do no harm."""
    if one.floor >= other.ceiling or one.ceiling <= other.floor:
        return True
    (w, s, e, n), (west, south, east, north) = bounds(one.shape), bounds(other.shape)
    if w >= east or e <= west or s >= north or n <= south:
        return True
    return _flat_disjoint(one.shape, other.shape)


def _flat_disjoint(one: Shape, other: Shape) -> bool:
    if isinstance(one, Disc):
        if isinstance(other, Disc):
            reach = one.radius + other.radius
            return _square(one.center, other.center) >= reach * reach
        apart = all(far(one.center, edge, one.radius) for edge in edges(other))
        return apart and not contains(other.corners, one.center)
    if isinstance(other, Disc):
        return _flat_disjoint(other, one)
    first, second = [_side(p, other) for p in _pieces(one, other)], [_side(p, one) for p in _pieces(other, one)]
    if max(first) > 0 or max(second) > 0:
        return False
    return min(first) < 0 or min(second) < 0  # all pieces on the boundary: the same polygon


def _pieces(one: Outline, other: Outline) -> list[_Scaled]:
    """A point in the middle of each piece into which the edges of `other` cut those of `one`."""
    found: list[_Scaled] = []
    cutting = edges(other)
    for (ax, ay), (bx, by) in edges(one):
        cuts = sorted({Fraction(0), Fraction(1)}.union(*(_cuts(((ax, ay), (bx, by)), each) for each in cutting)))
        for low, high in pairwise(cuts):
            t = (low + high) / 2
            scale = t.denominator
            found.append((ax * scale + (bx - ax) * t.numerator, ay * scale + (by - ay) * t.numerator, scale))
    return found


def _cuts(edge: Edge, by: Edge) -> set[Fraction]:
    """Where along `edge`, from 0 to 1, the segment `by` meets it; the ends of what they share."""
    (ax, ay), (bx, by_) = edge
    (cx, cy), (dx, dy) = by
    if (
        max(cx, dx) < min(ax, bx)
        or min(cx, dx) > max(ax, bx)
        or max(cy, dy) < min(ay, by_)
        or min(cy, dy) > max(ay, by_)
    ):
        return set()
    ux, uy, vx, vy = bx - ax, by_ - ay, dx - cx, dy - cy
    cross = ux * vy - uy * vx
    if cross:
        t = Fraction((cx - ax) * vy - (cy - ay) * vx, cross)
        s = Fraction((cx - ax) * uy - (cy - ay) * ux, cross)
        return {t} if 0 <= t <= 1 and 0 <= s <= 1 else set()
    if (cx - ax) * uy != (cy - ay) * ux:
        return set()
    square = ux * ux + uy * uy
    ends = (Fraction((x - ax) * ux + (y - ay) * uy, square) for x, y in by)
    return {t for t in ends if 0 < t < 1}


def _side(point: _Scaled, outline: Outline) -> int:
    """1 where a point is inside, 0 on the boundary, -1 outside."""
    x, y, scale = point
    corners = [(cx * scale, cy * scale) for cx, cy in outline.corners]
    if contains(corners, (x, y)):
        return 1
    for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
        on_line = (b[0] - a[0]) * (y - a[1]) == (b[1] - a[1]) * (x - a[0])
        if on_line and min(a[0], b[0]) <= x <= max(a[0], b[0]) and min(a[1], b[1]) <= y <= max(a[1], b[1]):
            return 0
    return -1


def _square(a: Point, b: Point) -> int:
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2
