"""Exact predicates over polygons with integer corners, in any plane unit."""

from collections.abc import Iterable, Sequence

#: corners as (x, y)
Corner = tuple[int, int]


def doubled_area(corners: Sequence[Corner]) -> int:
    """Twice the signed area: above zero where the corners go counter-clockwise."""
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(corners, [*corners[1:], corners[0]], strict=True))


def counter_clockwise(corners: Sequence[Corner]) -> list[Corner]:
    """The same polygon with its inside on the left, beginning at the same corner."""
    return list(corners) if doubled_area(corners) > 0 else [corners[0], *reversed(corners[1:])]


def crossing(corners: Sequence[Corner]) -> tuple[int, int] | None:
    """The numbers of two edges that meet where they should not, or None for a simple polygon. Edge i goes from corner i
    to the next.
    """
    met = tangled([corners])
    return None if met is None else (met[0][1], met[1][1])


def tangled(rings: Sequence[Sequence[Corner]]) -> tuple[tuple[int, int], tuple[int, int]] | None:
    """Two edges, each as the numbers of its ring and of its first corner, that meet where they should not; None where
    all rings are simple and have no point in common.

    Neighbours may share their corner only, all others nothing. Edges are swept by their west ends, so that only those
    are compared whose extents overlap.
    """
    names = [(number, i) for number, ring in enumerate(rings) for i in range(len(ring))]
    edges = [(rings[number][i], rings[number][(i + 1) % len(rings[number])]) for number, i in names]
    order = sorted(range(len(edges)), key=lambda i: min(edges[i][0][0], edges[i][1][0]))
    active: list[int] = []
    for i in order:
        a, b = edges[i]
        if a == b:
            number, at = names[i]
            return (number, at), (number, (at + 1) % len(rings[number]))
        west = min(a[0], b[0])
        active = [j for j in active if max(edges[j][0][0], edges[j][1][0]) >= west]
        south, north = min(a[1], b[1]), max(a[1], b[1])
        for j in active:
            c, d = edges[j]
            if max(c[1], d[1]) < south or min(c[1], d[1]) > north:
                continue
            one, other = min(i, j), max(i, j)
            if _meet_badly(edges[one], edges[other], names[one], names[other], len(rings[names[one][0]])):
                return names[one], names[other]
        active.append(i)
    return None


def _meet_badly(
    one: tuple[Corner, Corner],
    other: tuple[Corner, Corner],
    first: tuple[int, int],
    second: tuple[int, int],
    count: int,
) -> bool:
    """Whether two edges meet other than as neighbours do; `count` is the number of corners of the first one's ring."""
    if first[0] == second[0]:
        i, j = first[1], second[1]
        if (i + 1) % count == j:
            return _folds(one, other)
        if (j + 1) % count == i:
            return _folds(other, one)
    return meet(*one, *other)


def _folds(first: tuple[Corner, Corner], second: tuple[Corner, Corner]) -> bool:
    """Whether an edge runs back over the one before it."""
    a, b = first
    _, c = second
    turned = _side(a, b, c) == 0
    return turned and (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]) < 0


def meet(a: Corner, b: Corner, c: Corner, d: Corner) -> bool:
    """Whether the closed segments a-b and c-d have a point in common."""
    s0, s1, s2, s3 = _side(a, b, c), _side(a, b, d), _side(c, d, a), _side(c, d, b)
    if ((s0 > 0) != (s1 > 0)) and ((s2 > 0) != (s3 > 0)) and 0 not in (s0, s1, s2, s3):
        return True
    return (
        (s0 == 0 and _between(a, b, c))
        or (s1 == 0 and _between(a, b, d))
        or (s2 == 0 and _between(c, d, a))
        or (s3 == 0 and _between(c, d, b))
    )


def _side(a: Corner, b: Corner, p: Corner) -> int:
    """Above zero where p lies left of a-b, zero on its line."""
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])


def _between(a: Corner, b: Corner, p: Corner) -> bool:
    """Whether p, which is on the line of a-b, is within its extent."""
    return min(a[0], b[0]) <= p[0] <= max(a[0], b[0]) and min(a[1], b[1]) <= p[1] <= max(a[1], b[1])


def contains(corners: Sequence[Corner], p: Corner) -> bool:
    """Whether p is strictly inside a simple polygon."""
    return contained((corners,), p)


def contained(rings: Iterable[Sequence[Corner]], p: Corner) -> bool:
    """Whether p is strictly inside an area: an odd number of edges of its rings lies east of it, and none on it."""
    inside = False
    for corners in rings:
        for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
            side = _side(a, b, p)
            if side == 0 and _between(a, b, p):
                return False
            if (a[1] > p[1]) != (b[1] > p[1]) and (side > 0) == (b[1] > a[1]):
                inside = not inside
    return inside
