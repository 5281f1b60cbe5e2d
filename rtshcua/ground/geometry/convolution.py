"""Areas grown and shrunk by a convex kernel (Minkowski sum and difference), as a rule on windings for `overlay`.

The *convolution* of a ring with a kernel K runs along the ring, each edge moved by the corner of K that lies furthest
out, and at each corner along K's edges, forwards where the ring turns left and backwards where it turns right. Around a
point x it winds as often as the ring's inside has parts in x - K (Guibas, Ramshaw, Stolfi: A kinetic framework for
computational geometry, 1983), the ring's inside being on its left. K is symmetric, so that x - K is x + K. Hence for

- a counter-clockwise ring: x + K meets its inside where the winding is above zero;
- a clockwise ring: the winding is the number of parts of its *outside* in x + K, less one for all that is far away. So
  x + K lies in the hole where the winding is below zero. Were the whole hole in x + K, the outside would have a hole
  there and count the same; but then the hole has no room for K at all, and is left out.

A connected set that has no point in an area lies in one of its holes, or outside of all outer rings: so an area meets
x + K where x + K meets the inside of an outer ring and lies in none of that ring's holes. To shrink an area is to grow
what is around it: all rings are turned about.
"""

from collections.abc import Sequence

from rtshcua.ground.geometry.arrangement import Windings
from rtshcua.ground.geometry.overlay import Outlined, outlined
from rtshcua.ground.geometry.polygons import doubled_area
from rtshcua.ground.geometry.shapes import Cornered, Point, Ring, parts


def grown(shape: Cornered, kernel: Ring) -> Outlined | None:
    """All places that the kernel reaches from inside the shape; None where that has no outline in whole mm."""
    groups: list[list[list[Point]]] = []
    asked: list[tuple[int, list[int]]] = []
    for outer, holes in parts(shape):
        asked.append((len(groups), []))
        groups.append([_convolution(outer, kernel)])
        for hole in holes:
            if _has_room(hole, kernel):
                asked[-1][1].append(len(groups))
                groups.append([_convolution(hole, kernel)])

    def inside(windings: Windings) -> bool:
        return any(windings[outer] > 0 and all(windings[hole] >= 0 for hole in holes) for outer, holes in asked)

    return outlined(groups, inside)


def shrunk(shape: Cornered, kernel: Ring) -> Outlined | None:
    """All places around which the whole kernel lies in the shape; None as above."""
    groups: list[list[list[Point]]] = []
    asked: list[tuple[int, list[int]]] = []
    for outer, holes in parts(shape):
        if _has_room(outer, kernel):
            asked.append((len(groups), list(range(len(groups) + 1, len(groups) + 1 + len(holes)))))
            groups += [[_convolution(ring[::-1], kernel)] for ring in (outer, *holes)]

    def inside(windings: Windings) -> bool:
        return any(windings[outer] < 0 and all(windings[hole] <= 0 for hole in holes) for outer, holes in asked)

    return outlined(groups, inside)


def _has_room(ring: Ring, kernel: Ring) -> bool:
    """Whether the kernel might lie in a ring: nothing lies in what is smaller than itself."""
    return abs(doubled_area(ring)) > doubled_area(kernel)


def _convolution(ring: Ring, kernel: Ring) -> list[Point]:
    count = len(kernel)
    following = (*ring[1:], ring[0])
    directions = [(b[0] - a[0], b[1] - a[1]) for a, b in zip(ring, following, strict=True)]
    outermost = [_outermost(direction, kernel) for direction in directions]
    points: list[Point] = []
    for i, (x, y) in enumerate(ring):
        (ux, uy), (vx, vy) = directions[i - 1], directions[i]
        at, to = outermost[i - 1], outermost[i]
        step = 1 if ux * vy > uy * vx else -1
        points.append((x + kernel[at][0], y + kernel[at][1]))
        while at != to:
            at = (at + step) % count
            points.append((x + kernel[at][0], y + kernel[at][1]))
    return points


def _outermost(direction: Point, kernel: Sequence[Point]) -> int:
    """The corner of the kernel furthest to the right of a direction; of two, the one that comes first."""
    dx, dy = direction
    reach = [dy * x - dx * y for x, y in kernel]
    first = reach.index(max(reach))
    return len(kernel) - 1 if first == 0 and reach[-1] == reach[0] else first
