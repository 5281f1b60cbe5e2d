"""Finds limits on the ground: two writable places on both sides of a zone's edge.

The language writes places in 1e-7 degree, about 11 mm to the north and less to the east, so the edge runs between the
points of this lattice. The search examines several rows and takes on each side a place within a millimetre of the other
side, if there is one, so that a test notices if the limit moves by a millimetre.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Final, NamedTuple

from rtshcua.decision.outline import rings
from rtshcua.decision.values import FALSE, TRUE, Truth
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import CIRCLE, MAX_COORDINATE, Projection, Zone, project, unproject

#: a place in local mm
Place = tuple[int, int]
#: whether a condition holds for a place
Holds = Callable[[Place], Truth]

#: the number of rows of the lattice that are searched, and the reach of the search along a row
_ROWS: Final = 48
_REACH: Final = 1 << 14
#: mm: the largest and the first distance from the start of the search
_FAR: Final = 1 << 25
_FIRST: Final = 1_000
#: the number of sides of a ring that are searched, and the distance beside them, in mm
_SIDES: Final = 8
_ASIDE: Final = 300


class ZoneEdge(NamedTuple):
    """A place where a condition holds, and an adjacent one where it does not; local mm, both exactly writable."""

    holds: Place
    fails: Place


class Lattice(NamedTuple):
    """The writable places, with coordinates in 1e-7 degree."""

    projection: Projection

    def near(self, place: Place) -> Place:
        """The coordinates of the writable place nearest to one in local mm."""
        return unproject(self.projection, *place)

    def at(self, number: Place) -> Place:
        """The place in local mm that the language reads for these coordinates."""
        return project(self.projection, *number)


def zone_edge(policy: Policy, holds: Holds, start: Place, zones: tuple[Zone, ...]) -> ZoneEdge | None:
    """Find an edge between the start and a place with another truth of the condition; `zones` guide the search."""
    lattice = Lattice(policy.projection)
    first = lattice.near(start)
    known = holds(lattice.at(first))
    if known not in (TRUE, FALSE):
        return None
    wanted = FALSE if known == TRUE else TRUE
    for target in _elsewhere(start, zones):
        other = lattice.near(target)
        if holds(lattice.at(other)) == wanted:
            pair = _between(lattice, holds, first, other, wanted)
            return None if pair is None else _closest(lattice, holds, pair, known)
    return None


def ring_edges(policy: Policy, holds: Holds, ring: Sequence[Place]) -> Iterator[ZoneEdge]:
    """Yield edges across some sides of one ring of a zone's outline, if the condition differs on both sides."""
    lattice = Lattice(policy.projection)
    for one, other in _beside_sides(ring):
        first, second = lattice.near(one), lattice.near(other)
        known, wanted = holds(lattice.at(first)), holds(lattice.at(second))
        if {known, wanted} == {TRUE, FALSE}:
            pair = _between(lattice, holds, first, second, wanted)
            found = None if pair is None else _closest(lattice, holds, pair, known)
            if found is not None:
                yield found


def _beside_sides(ring: Sequence[Place]) -> Iterator[tuple[Place, Place]]:
    """Yield the places to the right and to the left of the middle of some sides of a ring."""
    for number in range(0, len(ring), max(1, len(ring) // _SIDES)):
        (x1, y1), (x2, y2) = ring[number], ring[(number + 1) % len(ring)]
        x, y, length = (x1 + x2) // 2, (y1 + y2) // 2, max(abs(x2 - x1), abs(y2 - y1), 1)
        right, up = (y2 - y1) * _ASIDE // length, (x1 - x2) * _ASIDE // length
        yield (x + right, y + up), (x - right, y - up)


def _elsewhere(start: Place, zones: tuple[Zone, ...]) -> Iterator[Place]:
    """Yield places where a condition may differ: in the middle of the zones, beside their outlines, and at growing
    distances in eight directions.
    """
    for zone in zones:
        yield middle(zone)
        for ring in () if zone.shape == CIRCLE else rings(zone):
            for one, other in _beside_sides(list(ring)):
                yield from (one, other)
    reach = _FIRST
    while reach <= _FAR:
        for x, y in ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, -1), (-1, 1)):
            place = (start[0] + x * reach, start[1] + y * reach)
            if max(map(abs, place)) < MAX_COORDINATE:
                yield place
        reach *= 2


def middle(zone: Zone) -> Place:
    """A place well inside a zone, or between its parts."""
    if zone.shape == CIRCLE:
        return zone.data[0], zone.data[1]
    corners = next(rings(zone))
    return sum(x for x, _ in corners) // len(corners), sum(y for _, y in corners) // len(corners)


def _between(lattice: Lattice, holds: Holds, one: Place, other: Place, wanted: Truth) -> tuple[Place, Place] | None:
    """Return two adjacent coordinates between two places; only the second has the truth `wanted`."""
    steps = max(abs(other[0] - one[0]), abs(other[1] - one[1]))

    def on_the_way(step: int) -> Place:
        return (one[0] + (other[0] - one[0]) * step // steps, one[1] + (other[1] - one[1]) * step // steps)

    low, high = 0, steps
    while high - low > 1:
        half = (low + high) // 2
        if holds(lattice.at(on_the_way(half))) == wanted:
            high = half
        else:
            low = half
    return (on_the_way(low), on_the_way(high)) if steps else None


def _closest(lattice: Lattice, holds: Holds, pair: tuple[Place, Place], known: Truth) -> ZoneEdge | None:
    """Return the pair along the edge with the places nearest to the other side."""
    best: dict[Truth, tuple[bool, Place]] = {}
    for one, other in _along(lattice, holds, pair, known):
        for number in (one, other):
            place = lattice.at(number)
            truth = holds(place)
            if truth in (TRUE, FALSE) and not best.get(truth, (False, place))[0]:
                best[truth] = (_beside(holds, place, truth), place)
        if len(best) == 2 and all(tight for tight, _ in best.values()):
            break
    return ZoneEdge(best[TRUE][1], best[FALSE][1]) if len(best) == 2 else None


def _along(lattice: Lattice, holds: Holds, pair: tuple[Place, Place], known: Truth) -> Iterator[tuple[Place, Place]]:
    """Yield the pair, and pairs in the adjacent rows and columns as long as the edge is found there."""
    yield pair
    for axis in (0, 1):  # along a row of one latitude, then along a column of one longitude
        for side in (1, -1):
            last = pair
            for number in range(1, _ROWS):
                found = _again(lattice, holds, last, axis, pair[0][axis] + side * number, known)
                if found is None:
                    break
                yield found
                last = found


def _again(
    lattice: Lattice, holds: Holds, last: tuple[Place, Place], axis: int, row: int, known: Truth
) -> tuple[Place, Place] | None:
    """Find the edge in another row, near its place in the last row."""

    def number(along: int) -> Place:
        return (row, along) if axis == 0 else (along, row)

    def otherwise(along: int) -> bool:
        return holds(lattice.at(number(along))) != known

    start = last[0][1 - axis]
    here = otherwise(start)
    reach = 1
    while reach <= _REACH:
        for end in (start + reach, start - reach):
            if otherwise(end) != here:
                low, high = start, end
                while abs(high - low) > 1:
                    half = (low + high) // 2
                    low, high = (low, half) if otherwise(half) != here else (half, high)
                return (number(high), number(low)) if here else (number(low), number(high))
        reach *= 2
    return None


def _beside(holds: Holds, place: Place, truth: Truth) -> bool:
    """Whether a place with another truth is within a millimetre."""
    x, y = place
    return any(holds(each) != truth for each in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)))
