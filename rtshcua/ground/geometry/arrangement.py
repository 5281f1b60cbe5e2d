"""The faces into which closed curves part the integer plane, and how often each group of curves goes around them.

Every curve belongs to a group; the *winding* of a group at a point is how often its curves go around it,
counter-clockwise. Edges are cut where they meet, in exact fractions; between the pieces lie *faces*, of which each has
one winding of every group. Going around a node from piece to piece carries the windings on, so that only one point of
each connected drawing is located by a ray. No float: the same comes out on every machine.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cmp_to_key
from itertools import pairwise

from rtshcua.ground.geometry.polygons import Corner

#: windings of the groups, in their order
Windings = tuple[int, ...]
Ring = Sequence[Corner]
#: a place where pieces meet: integers, or fractions where edges cross
Node = tuple[int | Fraction, int | Fraction]
#: a piece of an edge from its lexicographically lower end to the other
Key = tuple[Node, Node]
_Edge = tuple[Corner, Corner, int]

#: curves that meet more often are no zone that anybody drew; they would take minutes
MOST_MEETINGS = 1 << 18


class _Crossing(Fraction):
    """A coordinate of a place where edges cross; its hash, which is slow to compute, is asked for often."""

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
class Piece:
    """`turns` is what crossing it from right to left adds to the windings, seen from its lower to its upper end."""

    direction: Corner
    turns: list[int]
    left: Windings = ()
    right: Windings = ()


def faces(groups: Sequence[Sequence[Ring]]) -> Iterator[Windings]:
    """The windings of every face, some of them more than once."""
    for piece in pieces_of(groups).values():
        yield piece.left
        yield piece.right


def pieces_of(groups: Sequence[Sequence[Ring]]) -> dict[Key, Piece]:
    """The pieces that part faces of different windings, with the windings on both sides."""
    edges = [
        (a, b, group)
        for group, rings in enumerate(groups)
        for ring in rings
        for a, b in zip(ring, [*ring[1:], ring[0]], strict=True)
        if a != b
    ]
    pieces: dict[Key, Piece] = {}
    for (a, b, group), cuts in zip(edges, _cuts(edges), strict=True):
        forward = a < b
        direction = (b[0] - a[0], b[1] - a[1]) if forward else (a[0] - b[0], a[1] - b[1])
        nodes: list[Node] = sorted({a, b, *cuts})
        for key in pairwise(nodes):
            piece = pieces.get(key)
            if piece is None:
                piece = pieces[key] = Piece(direction, [0] * len(groups))
            piece.turns[group] += 1 if forward else -1
    pieces = {key: piece for key, piece in pieces.items() if any(piece.turns)}
    _wind(pieces, edges, len(groups))
    return pieces


def _cuts(edges: Sequence[_Edge]) -> list[list[Node]]:
    """Where each edge meets others: a sweep by their west ends."""
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
    """The points that two segments have in common, but for shared ends; of a common stretch, its ends."""
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


def _wind(pieces: dict[Key, Piece], edges: Sequence[_Edge], groups: int) -> None:
    """Give every piece the windings of both sides."""
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


def turned(node: Node, keys: list[Key], pieces: dict[Key, Piece]) -> list[Key]:
    """The pieces at a node in the order of their directions, counter-clockwise."""
    if len(keys) <= 2:
        return keys

    def away(key: Key) -> Corner:
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


def _locate(key: Key, piece: Piece, edges: Sequence[_Edge], groups: int) -> None:
    """The windings on both sides of a piece, by a ray from its middle: upwards, or eastwards from a vertical one."""
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
        side = (dx - cx) * (py - cy * scale) - (dy - cy) * (px - cx * scale)  # above zero where the place lies left
        rising = high > low
        if side and (side < 0) == (rising if upwards else not rising):
            beyond[group] += (-1 if rising else 1) if upwards else (1 if rising else -1)
    near = tuple(beyond)
    if upwards:  # the place just above is on the left of a piece that goes east
        piece.left, piece.right = near, tuple(w - t for w, t in zip(near, piece.turns, strict=True))
    else:  # the place just east is on the right of a piece that goes north
        piece.left, piece.right = tuple(w + t for w, t in zip(near, piece.turns, strict=True)), near
