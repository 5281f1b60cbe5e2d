"""What closed curves in the integer plane enclose together: unions, differences, and whatever else a rule on windings
asks for, with whole millimetres for corners.

The boundary is computed in exact fractions (`arrangement`). Rounding its corners moves it by less than 1 mm, hence no
point further than that from it changes sides; where boundaries touch, the corners are drawn apart, and where rounding
made edges meet, the result is laid over itself again. `Outlined.moved` bounds it all.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isqrt

from rtshcua.ground.geometry.arrangement import Key, Node, Ring, Windings, pieces_of, turned
from rtshcua.ground.geometry.polygons import Corner, doubled_area, tangled

#: how often a result is laid over itself
ROUNDS = 3
#: how far corners that touch are drawn apart, mm
PULL = 2
#: what one round moves a boundary by at most, mm: with rounding, and with drawing apart besides
ROUNDED, PULLED = 1, 1 + PULL


@dataclass(frozen=True, slots=True)
class Outlined:
    """Simple rings without a common point: outer ones counter-clockwise, holes clockwise; and how far, in mm, their
    boundary may lie from the true one at most.
    """

    rings: tuple[tuple[Corner, ...], ...]
    moved: int


def outlined(groups: Sequence[Sequence[Ring]], inside: Callable[[Windings], bool]) -> Outlined | None:
    """The boundary of the points whose windings `inside` accepts; None where it cannot be had in whole millimetres.

    Nothing that goes on for ever may be inside: `inside` refuses windings of 0.
    """
    moved = 0
    for _ in range(ROUNDS):
        rings, pulled = _apart([each for each in map(_rounded, _boundary(groups, inside)) if each])
        moved += PULLED if pulled else ROUNDED
        if tangled(rings) is None and nested(rings):
            return Outlined(tuple(sorted(_from_least(ring) for ring in rings)), moved)
        groups, inside = [rings], _enclosed
    return None


def nested(rings: Sequence[Ring]) -> bool:
    """Whether simple rings without a common point are the boundary of an area: outer rings go counter-clockwise and
    holes clockwise, and each outer ring lies in a hole or in nothing, each hole in an outer ring.
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


def _around(ring: Ring, x: int, y: int) -> int:
    """The winding of a ring at a place that is not on it."""
    winding = 0
    for (ax, ay), (bx, by) in zip(ring, [*ring[1:], ring[0]], strict=True):
        if (ay > y) != (by > y):
            side = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
            if (side > 0) == (by > ay):
                winding += 1 if by > ay else -1
    return winding


def _enclosed(windings: Windings) -> bool:
    return windings[0] > 0


def _box(ring: Ring) -> tuple[int, int, int, int]:
    xs, ys = zip(*ring, strict=True)
    return min(xs), min(ys), max(xs), max(ys)


def _boundary(groups: Sequence[Sequence[Ring]], inside: Callable[[Windings], bool]) -> list[list[Node]]:
    """The exact boundary: rings with the inside on their left. Where it touches itself, the rings go around the inside
    on each side of the place, so that they touch and never cross.
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
        for number, key in enumerate(order):  # the inside lies clockwise of where a ring comes from
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


def _rounded(ring: Sequence[Node]) -> list[Corner]:
    """A ring with corners in whole millimetres, without repetitions and without spikes; empty where nothing is left."""
    return without_straight([(round(x), round(y)) for x, y in ring])


def without_straight(corners: Sequence[Corner]) -> list[Corner]:
    """The corners without repetitions and spikes, and without those on a straight line between their neighbours."""
    kept = list(corners)
    while True:
        kept = [b for a, b in zip([*kept[-1:], *kept[:-1]], kept, strict=True) if a != b]
        left: list[Corner] = []
        for number, b in enumerate(kept):
            a = left[-1] if left else kept[-1]
            c = kept[(number + 1) % len(kept)]
            if (b[0] - a[0]) * (c[1] - b[1]) != (b[1] - a[1]) * (c[0] - b[0]):
                left.append(b)
        if len(left) == len(kept) or len(left) < 3:
            return left if len(left) >= 3 else []
        kept = left


def _apart(rings: Sequence[list[Corner]]) -> tuple[list[list[Corner]], bool]:
    """The rings with corners that are visited more than once drawn to the inside, and whether there were any."""
    visits: dict[Corner, int] = {}
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


def _drawn(a: Corner, b: Corner, c: Corner) -> Corner:
    """A corner moved by at most `PULL` to the left of a ring that comes from `a` and goes on to `c`."""
    (ux, uy), (vx, vy) = _unit(b, a), _unit(b, c)
    x, y = ux + vx, uy + vy
    if (b[0] - a[0]) * (c[1] - b[1]) < (b[1] - a[1]) * (c[0] - b[0]):
        x, y = -x, -y
    length = isqrt(x * x + y * y) + 1
    return b[0] + _part(x, length), b[1] + _part(y, length)


def _unit(a: Corner, b: Corner) -> Corner:
    """The direction from a to b, of a length of 2**20."""
    x, y = b[0] - a[0], b[1] - a[1]
    length = isqrt((x * x + y * y) << 20) + 1
    return (x << 30) // length, (y << 30) // length


def _part(value: int, length: int) -> int:
    """`PULL * value / length`, towards zero after half a millimetre is added."""
    whole = (2 * PULL * abs(value) + length) // (2 * length)
    return whole if value >= 0 else -whole


def _from_least(ring: list[Corner]) -> tuple[Corner, ...]:
    first = ring.index(min(ring))
    return (*ring[first:], *ring[:first])
