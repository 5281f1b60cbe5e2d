"""Overlay of closed curves in the integer plane: unions, differences, and other rules on windings, in whole mm.

Each curve belongs to a group. The *winding* of a group at a point is the number of times that its curves go around the
point, counter-clockwise. The *arrangement* cuts the edges of all curves where they meet, in exact fractions. The pieces
bound *faces*, each with one winding for each group. The windings are propagated around each node from piece to piece,
so only one point of each connected component is located by a ray.

The boundary of an overlay separates faces inside from faces outside. Rounding its corners moves it by less than 1 mm,
so no point farther than that changes sides. Corners at which boundaries touch are moved apart. If rounding made edges
meet, the result is overlaid with itself again. `RoundedBoundary.moved` bounds the total displacement. Without floats,
the result is the same on every machine.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cmp_to_key
from itertools import pairwise
from math import isqrt

from rtshcua.ground.geometry.polygons import Point, doubled_area, sides, touching_edges

#: windings of the groups, in order
Windings = tuple[int, ...]
Curve = Sequence[Point]
#: a place where pieces meet: integers, or fractions where edges cross
Node = tuple[int | Fraction, int | Fraction]
#: a piece of an edge from its lexicographically lower end to the other
Key = tuple[Node, Node]
_Edge = tuple[Point, Point, int]

#: most meetings of edges; real zones have far fewer, and more would take minutes
MOST_MEETINGS = 1 << 18


class _Crossing(Fraction):
    """A coordinate of a crossing. It caches its hash, which is slow to compute and often needed."""

    __slots__ = ("_hash",)

    def __hash__(self) -> int:  # type: ignore[override]  # typeshed takes it from `Complex`, which has none
        try:
            return self._hash
        except AttributeError:
            self._hash: int = super().__hash__()
            return self._hash


class TooManyPieces(Exception):
    """The curves meet more often than `MOST_MEETINGS`."""


@dataclass(slots=True)
class EdgePiece:
    """A piece of an edge, directed from its lower to its upper end. Crossing it from right to left adds `turns`."""

    direction: Point
    turns: list[int]
    left: Windings = ()
    right: Windings = ()


def faces(groups: Sequence[Sequence[Curve]]) -> Iterator[Windings]:
    """Yield the windings of every face, some more than once."""
    for piece in pieces_of(groups).values():
        yield piece.left
        yield piece.right


def pieces_of(groups: Sequence[Sequence[Curve]]) -> dict[Key, EdgePiece]:
    """Return the pieces between faces of different windings, with the windings on both sides."""
    edges = [(a, b, group) for group, rings in enumerate(groups) for ring in rings for a, b in sides(ring) if a != b]
    pieces: dict[Key, EdgePiece] = {}
    for (a, b, group), cuts in zip(edges, _cuts(edges), strict=True):
        forward = a < b
        direction = (b[0] - a[0], b[1] - a[1]) if forward else (a[0] - b[0], a[1] - b[1])
        nodes: list[Node] = sorted({a, b, *cuts})
        for key in pairwise(nodes):
            piece = pieces.get(key)
            if piece is None:
                piece = pieces[key] = EdgePiece(direction, [0] * len(groups))
            piece.turns[group] += 1 if forward else -1
    pieces = {key: piece for key, piece in pieces.items() if any(piece.turns)}
    _wind(pieces, edges, len(groups))
    return pieces


def _cuts(edges: Sequence[_Edge]) -> list[list[Node]]:
    """Return the points at which each edge meets others, by a sweep over their west ends."""
    found: list[list[Node]] = [[] for _ in edges]
    boxes = [(min(a[0], b[0]), max(a[0], b[0]), min(a[1], b[1]), max(a[1], b[1])) for a, b, _ in edges]
    active: list[int] = []
    met = 0
    for i in sorted(range(len(edges)), key=lambda each: boxes[each][0]):
        west, _, south, north = boxes[i]
        active = [j for j in active if boxes[j][1] >= west]
        for j in active:
            if boxes[j][3] < south or boxes[j][2] > north:
                continue
            for node in _common(edges[i], edges[j]):
                found[i].append(node)
                found[j].append(node)
                met += 1
        if met > MOST_MEETINGS:
            raise TooManyPieces
        active.append(i)
    return found


def _common(one: _Edge, other: _Edge) -> list[Node]:
    """Return the common points of two segments except shared ends; for a common part, its ends."""
    a, b, _ = one
    c, d, _ = other
    ux, uy, vx, vy = b[0] - a[0], b[1] - a[1], d[0] - c[0], d[1] - c[1]
    cross = ux * vy - uy * vx
    wx, wy = c[0] - a[0], c[1] - a[1]
    if cross == 0:
        if ux * wy != uy * wx:
            return []
        low, high = max(min(a, b), min(c, d)), min(max(a, b), max(c, d))
        return [low, high] if low <= high else []
    if a in (c, d) or b in (c, d):
        return []
    t, s = wx * vy - wy * vx, wx * uy - wy * ux
    if cross < 0:
        cross, t, s = -cross, -t, -s
    if not (0 <= t <= cross and 0 <= s <= cross):
        return []
    if t in (0, cross):
        return [b if t else a]
    if s in (0, cross):
        return [d if s else c]
    return [(_Crossing(a[0] * cross + ux * t, cross), _Crossing(a[1] * cross + uy * t, cross))]


def _wind(pieces: dict[Key, EdgePiece], edges: Sequence[_Edge], groups: int) -> None:
    """Set the windings on both sides of every piece."""
    at: dict[Node, list[Key]] = {}
    for key in pieces:
        at.setdefault(key[0], []).append(key)
        at.setdefault(key[1], []).append(key)
    for first, piece in pieces.items():
        if piece.left:
            continue
        _locate(first, piece, edges, groups)
        waiting: list[Node] = list(first)
        seen = set(waiting)
        while waiting:
            node = waiting.pop()
            keys = turned(node, at[node], pieces)
            start = next(number for number, key in enumerate(keys) if pieces[key].left)
            known = pieces[keys[start]]
            here = known.left if keys[start][0] == node else known.right
            for key in (*keys[start + 1 :], *keys[:start]):
                away = key[0] == node
                each = pieces[key]
                there = tuple(w + t if away else w - t for w, t in zip(here, each.turns, strict=True))
                each.left, each.right = (there, here) if away else (here, there)
                here = there
                other = key[1] if away else key[0]
                if other not in seen:
                    seen.add(other)
                    waiting.append(other)


def turned(node: Node, keys: list[Key], pieces: dict[Key, EdgePiece]) -> list[Key]:
    """Return the pieces at a node ordered by direction, counter-clockwise."""
    if len(keys) <= 2:
        return keys

    def away(key: Key) -> Point:
        x, y = pieces[key].direction
        return (x, y) if key[0] == node else (-x, -y)

    def compare(one: Key, other: Key) -> int:
        (ux, uy), (vx, vy) = away(one), away(other)
        upper, lower = (uy, ux) > (0, 0), (vy, vx) > (0, 0)
        if upper != lower:
            return -1 if upper else 1
        cross = ux * vy - uy * vx
        return (cross < 0) - (cross > 0)

    return sorted(keys, key=cmp_to_key(compare))


def _locate(key: Key, piece: EdgePiece, edges: Sequence[_Edge], groups: int) -> None:
    """Set the windings on both sides of a piece by a ray from its middle: upwards, or eastwards if it is vertical."""
    (ax, ay), (bx, by) = key
    x, y = Fraction(ax + bx) / 2, Fraction(ay + by) / 2
    scale = x.denominator * y.denominator
    px, py = int(x * scale), int(y * scale)
    beyond = [0] * groups
    upwards = piece.direction[0] != 0
    for (cx, cy), (dx, dy), group in edges:
        low, high, level = (cx, dx, px) if upwards else (cy, dy, py)
        if (low * scale > level) == (high * scale > level):
            continue
        side = (dx - cx) * (py - cy * scale) - (dy - cy) * (px - cx * scale)  # positive if the place lies left
        rising = high > low
        if side and (side < 0) == (rising if upwards else not rising):
            beyond[group] += (-1 if rising else 1) if upwards else (1 if rising else -1)
    near = tuple(beyond)
    if upwards:  # the place just above is on the left of a piece that goes east
        piece.left, piece.right = near, tuple(w - t for w, t in zip(near, piece.turns, strict=True))
    else:  # the place just east is on the right of a piece that goes north
        piece.left, piece.right = tuple(w + t for w, t in zip(near, piece.turns, strict=True)), near


#: most rounds of overlaying a result with itself
ROUNDS = 3
#: distance by which touching corners are moved apart, mm
PULL = 2
#: largest displacement of a boundary in one round, mm: by rounding, and by rounding and moving apart
ROUNDED, PULLED = 1, 1 + PULL


@dataclass(frozen=True, slots=True)
class RoundedBoundary:
    """Simple rings without a common point: outer rings counter-clockwise, holes clockwise.

    `moved` is the largest distance in mm between their boundary and the exact one.
    """

    rings: tuple[tuple[Point, ...], ...]
    moved: int


def rounded_boundary(groups: Sequence[Sequence[Curve]], inside: Callable[[Windings], bool]) -> RoundedBoundary | None:
    """Return the boundary of the points whose windings `inside` accepts; None if none is in whole millimetres.

    `inside` must refuse windings of 0, so that the area is bounded.
    """
    moved = 0
    for _ in range(ROUNDS):
        rings, pulled = _apart([each for each in map(_rounded, _boundary(groups, inside)) if each])
        moved += PULLED if pulled else ROUNDED
        if touching_edges(rings) is None and nested(rings):
            return RoundedBoundary(tuple(sorted(_from_least(ring) for ring in rings)), moved)
        groups, inside = [rings], _enclosed
    return None


def nested(rings: Sequence[Curve]) -> bool:
    """Whether simple rings without a common point are the boundary of an area.

    Outer rings must be counter-clockwise and lie in a hole or in no ring. Holes must be clockwise and lie in an outer
    ring.
    """
    boxes = [_box(ring) for ring in rings]
    for number, ring in enumerate(rings):
        x, y = ring[0]
        depth = 0
        for other, (west, south, east, north) in enumerate(boxes):
            if other != number and west < x < east and south < y < north:
                depth += _around(rings[other], x, y)
        if (doubled_area(ring) > 0) != (depth == 0) or depth not in (0, 1):
            return False
    return True


def _around(ring: Curve, x: int, y: int) -> int:
    """Return the winding of a ring at a point that is not on it."""
    winding = 0
    for (ax, ay), (bx, by) in sides(ring):
        if (ay > y) != (by > y):
            side = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
            if (side > 0) == (by > ay):
                winding += 1 if by > ay else -1
    return winding


def _enclosed(windings: Windings) -> bool:
    return windings[0] > 0


def _box(ring: Curve) -> tuple[int, int, int, int]:
    xs, ys = zip(*ring, strict=True)
    return min(xs), min(ys), max(xs), max(ys)


def _boundary(groups: Sequence[Sequence[Curve]], inside: Callable[[Windings], bool]) -> list[list[Node]]:
    """Return the exact boundary: rings with the inside on their left.

    Where the boundary touches itself, the rings touch but do not cross.
    """
    pieces = pieces_of(groups)
    known: dict[Windings, bool] = {}

    def holds(windings: Windings) -> bool:
        found = known.get(windings)
        if found is None:
            found = known[windings] = inside(windings)
        return found

    ends: dict[Key, tuple[Node, Node]] = {}
    leaving: dict[Node, list[Key]] = {}
    arriving: dict[Node, list[Key]] = {}
    for key, piece in pieces.items():
        left = holds(piece.left)
        if left != holds(piece.right):
            start, end = ends[key] = key if left else (key[1], key[0])
            leaving.setdefault(start, []).append(key)
            arriving.setdefault(end, []).append(key)
    following: dict[Key, Key] = {}
    for node, keys in leaving.items():
        if len(keys) == 1:
            following[arriving[node][0]] = keys[0]
            continue
        order = turned(node, [*keys, *arriving[node]], pieces)
        for number, key in enumerate(order):  # the inside lies clockwise of an arriving ring
            if ends[key][1] == node:
                following[key] = order[number - 1]
    rings = []
    while following:
        key, onward = following.popitem()
        ring = [ends[key][0]]
        while onward != key:
            ring.append(ends[onward][0])
            onward = following.pop(onward)
        rings.append(ring)
    return rings


def _rounded(ring: Sequence[Node]) -> list[Point]:
    """Return a ring with corners in whole millimetres, without repetitions and spikes; empty if nothing is left."""
    return without_straight([(round(x), round(y)) for x, y in ring])


def without_straight(corners: Sequence[Point]) -> list[Point]:
    """Return the corners without repetitions, spikes, and corners on a straight line between their neighbours."""
    kept = list(corners)
    while True:
        kept = [b for a, b in zip([*kept[-1:], *kept[:-1]], kept, strict=True) if a != b]
        left: list[Point] = []
        for number, b in enumerate(kept):
            a = left[-1] if left else kept[-1]
            c = kept[(number + 1) % len(kept)]
            if (b[0] - a[0]) * (c[1] - b[1]) != (b[1] - a[1]) * (c[0] - b[0]):
                left.append(b)
        if len(left) == len(kept) or len(left) < 3:
            return left if len(left) >= 3 else []
        kept = left


def _apart(rings: Sequence[list[Point]]) -> tuple[list[list[Point]], bool]:
    """Return the rings with repeated corners moved to the inside, and whether there were any."""
    visits: dict[Point, int] = {}
    for ring in rings:
        for corner in ring:
            visits[corner] = visits.get(corner, 0) + 1
    if all(count == 1 for count in visits.values()):
        return list(rings), False
    drawn = []
    for ring in rings:
        around = zip([ring[-1], *ring[:-1]], ring, [*ring[1:], ring[0]], strict=True)
        drawn.append([b if visits[b] == 1 else _drawn(a, b, c) for a, b, c in around])
    return [each for each in map(without_straight, drawn) if each], True


def _drawn(a: Point, b: Point, c: Point) -> Point:
    """Return corner `b` moved by at most `PULL` to the left of a ring that runs from `a` to `c`."""
    (ux, uy), (vx, vy) = _unit(b, a), _unit(b, c)
    x, y = ux + vx, uy + vy
    if (b[0] - a[0]) * (c[1] - b[1]) < (b[1] - a[1]) * (c[0] - b[0]):
        x, y = -x, -y
    length = isqrt(x * x + y * y) + 1
    return b[0] + _part(x, length), b[1] + _part(y, length)


def _unit(a: Point, b: Point) -> Point:
    """Return the direction from a to b, scaled to a length of 2**20."""
    x, y = b[0] - a[0], b[1] - a[1]
    length = isqrt((x * x + y * y) << 20) + 1
    return (x << 30) // length, (y << 30) // length


def _part(value: int, length: int) -> int:
    """Return `PULL * value / length`, rounded to the nearest mm."""
    whole = (2 * PULL * abs(value) + length) // (2 * length)
    return whole if value >= 0 else -whole


def _from_least(ring: list[Point]) -> tuple[Point, ...]:
    first = ring.index(min(ring))
    return (*ring[first:], *ring[:first])
