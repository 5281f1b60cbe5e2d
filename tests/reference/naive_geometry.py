"""Exact geometry by its definitions, slow and simple, independent of `rtshcua.decision.zones`."""

from fractions import Fraction
from itertools import combinations, pairwise

from rtshcua.model.flat.zone import AREA, CIRCLE, Zone

Point = tuple[int, int]


def rings(zone: Zone) -> list[list[Point]]:
    """The corners of each ring of a zone that is no circle."""
    numbers = list(zone.data)
    counts = [len(numbers) // 2]
    if zone.shape == AREA:
        counts = [numbers.pop(0) for _ in range(numbers.pop(0))]
    found = [[(numbers.pop(0), numbers.pop(0)) for _ in range(count)] for count in counts]
    assert not numbers
    return found


def edges(zone: Zone) -> list[tuple[Point, Point]]:
    return [edge for ring in rings(zone) for edge in pairwise([*ring, ring[0]])]


def on_segment(p: Point, a: Point, b: Point) -> bool:
    """Whether p is a + t (b - a) for some t in 0..1."""
    (x, y), (ax, ay), (bx, by) = p, a, b
    if (x - ax) * (by - ay) != (y - ay) * (bx - ax):
        return False
    return min(ax, bx) <= x <= max(ax, bx) and min(ay, by) <= y <= max(ay, by)


def well_formed(outlines: list[list[Point]]) -> bool:
    """Edges only share corners with their neighbours, and a ring is a hole if an odd number of others contain it.

    The shoelace formula gives the orientation of each ring.
    """
    if any(len(ring) < 3 or len(set(ring)) < len(ring) for ring in outlines):
        return False
    every = [[(ring[k - 1], ring[k]) for k in range(len(ring))] for ring in outlines]
    for (i, one), (j, other) in combinations([(n, side) for n, sides in enumerate(every) for side in sides], 2):
        shared = set(one) & set(other)
        if i != j and segments_meet(*one, *other):
            return False
        if i == j and not shared and segments_meet(*one, *other):
            return False
        if i == j and shared and (len(shared) > 1 or folded(one, other, shared.pop())):
            return False
    for number, ring in enumerate(outlines):
        around = sum(inside_ring(ring[0], other) for n, other in enumerate(outlines) if n != number)
        area = sum(ax * by - ay * bx for (ax, ay), (bx, by) in pairwise([*ring, ring[0]]))
        if (area > 0) != (around % 2 == 0):
            return False
    return True


def folded(one: tuple[Point, Point], other: tuple[Point, Point], at: Point) -> bool:
    """Whether two segments with a common end have the same direction there."""
    (a,), (b,) = set(one) - {at}, set(other) - {at}
    return on_segment(a, at, b) or on_segment(b, at, a)


def inside_ring(p: Point, ring: list[Point]) -> bool:
    """Whether the ring winds around the point."""
    return in_polygon(p, Zone("ring", AREA, 0, 0, (1, len(ring), *(c for corner in ring for c in corner))))


def in_polygon(p: Point, zone: Zone) -> bool:
    """Whether a ray to the east crosses the outlines an odd number of times; the outlines themselves are outside."""
    if any(on_segment(p, a, b) for a, b in edges(zone)):
        return False
    crossings = 0
    for (ax, ay), (bx, by) in edges(zone):
        if min(ay, by) <= p[1] < max(ay, by):
            # ax + (p[1] - ay) * (bx - ax) / (by - ay) > p[0], times what it is divided by
            past, up = (p[1] - ay) * (bx - ax) - (p[0] - ax) * (by - ay), by > ay
            crossings += past > 0 if up else past < 0
    return crossings % 2 == 1


def in_shape(p: Point, zone: Zone) -> bool:
    if zone.shape == CIRCLE:
        x, y, square = zone.data
        return (p[0] - x) ** 2 + (p[1] - y) ** 2 < square
    return in_polygon(p, zone)


def segments_meet(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Whether a + t (b - a) = c + s (d - c) for some t and s in 0..1."""
    for axis in (0, 1):
        one, other = sorted((a[axis], b[axis])), sorted((c[axis], d[axis]))
        if one[1] < other[0] or other[1] < one[0]:
            return False
    if any((on_segment(a, c, d), on_segment(b, c, d), on_segment(c, a, b), on_segment(d, a, b))):
        return True
    ux, uy, vx, vy = b[0] - a[0], b[1] - a[1], d[0] - c[0], d[1] - c[1]
    cross = ux * vy - uy * vx
    if cross == 0:
        return False
    wx, wy = c[0] - a[0], c[1] - a[1]
    # t and s, both times the square of what they are divided by
    t, s, most = (wx * vy - wy * vx) * cross, (wx * uy - wy * ux) * cross, cross * cross
    return 0 <= t <= most and 0 <= s <= most


def hull(points: list[Point]) -> list[Point]:
    """Gift wrapping: each next corner has all others on its left."""
    points = sorted(set(points))
    if len(points) < 3:
        return points
    wrapped = [points[0]]
    while True:
        at = wrapped[-1]
        best = next(p for p in points if p != at)
        for p in points:
            cross = (best[0] - at[0]) * (p[1] - at[1]) - (best[1] - at[1]) * (p[0] - at[0])
            nearer = (p[0] - at[0]) ** 2 + (p[1] - at[1]) ** 2 > (best[0] - at[0]) ** 2 + (best[1] - at[1]) ** 2
            if p != at and (cross < 0 or (cross == 0 and nearer)):
                best = p
        if best == wrapped[0]:
            return wrapped
        wrapped.append(best)


def widened(a: Point, b: Point, box: tuple[int, int, int, int]) -> list[Point]:
    west, south, east, north = box
    return hull([(x + dx, y + dy) for x, y in (a, b) for dx in (west, east) for dy in (south, north)])


def in_hull(p: Point, outline: list[Point]) -> bool:
    """Whether a point is inside a convex outline or on it."""
    if len(outline) < 3:
        return on_segment(p, outline[0], outline[-1])
    return all(
        (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) >= 0 for a, b in pairwise([*outline, outline[0]])
    )


def touches(outline: list[Point], zone: Zone) -> bool:
    """Whether the boundary of a polygon shares a place with a convex outline or its inside."""
    sides = list(pairwise([*outline, outline[0]]))
    return any(
        in_hull(a, outline) or in_hull(b, outline) or any(segments_meet(a, b, c, d) for c, d in sides)
        for a, b in edges(zone)
    )


def square_distance(p: Point, a: Point, b: Point) -> Fraction:
    """The square of the distance between a point and a segment."""
    square = (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2
    t = Fraction((p[0] - a[0]) * (b[0] - a[0]) + (p[1] - a[1]) * (b[1] - a[1]), square) if square else Fraction(0)
    t = min(max(t, Fraction(0)), Fraction(1))
    x, y = a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])
    return (p[0] - x) ** 2 + (p[1] - y) ** 2


def circle_near(outline: list[Point], zone: Zone) -> Fraction | int:
    """The square of the distance between a circle's centre and a convex outline (0 when it is inside)."""
    centre = (zone.data[0], zone.data[1])
    if in_hull(centre, outline):
        return 0
    return min(square_distance(centre, a, b) for a, b in pairwise([*outline, outline[0]]))


def circle_far(outline: list[Point], zone: Zone) -> int:
    """The square of the distance between a circle's centre and the farthest corner of an outline."""
    return max((x - zone.data[0]) ** 2 + (y - zone.data[1]) ** 2 for x, y in outline)
