"""Checks of zones, derived zone tables, the projection, and the rings that bound an area. Each ring must be simple
and no two may touch; outer rings run counter-clockwise, holes clockwise.

A line sweeps the plane from south to north (along it from west to east), and the edges that it crosses are kept in
order. Two edges can only meet after they have become neighbours, so comparing neighbours finds any intersection
(Shamos and Hoey 1976). At the start of a ring, the number of edges west of it shows whether its interior must be
inside the area. The cost grows as n log n with the number of corners, whatever the outline.
"""

from collections.abc import Generator, Iterator, Sequence

from rtshcua.decision.checks.indexes import at, index, within
from rtshcua.decision.outline import Corner, Leg
from rtshcua.decision.outline import rings as outline
from rtshcua.decision.tree import windows_problem
from rtshcua.model.flat import zone as flat
from rtshcua.model.flat.limits import DAY, MAX_TABLES, MAX_TOTAL_VERTICES, MAX_VALUE, MAX_ZONES
from rtshcua.model.flat.policy import Policy

MEET = "edges cross or touch"
FEW_CORNERS = 3


def rings(given: Sequence[Sequence[Corner]]) -> Iterator[str]:
    """The first problem of an area's rings, or None."""
    short = (f"ring {number} has {len(ring)} corners" for number, ring in enumerate(given) if len(ring) < FEW_CORNERS)
    problem = next(short, None) or _Sweep(given).problem()
    if problem is not None:
        yield problem


class _Sweep:
    """The sweep line. Corners are numbered through all rings; an edge has the number of the corner where it begins."""

    def __init__(self, given: Sequence[Sequence[Corner]]) -> None:
        self._corners = [corner for ring in given for corner in ring]
        self._rings = [number for number, ring in enumerate(given) for _ in ring]
        self._before: list[int] = []
        self._edges: list[Leg] = []  # from the end that the sweep reaches first
        for ring in given:
            at = len(self._before)
            self._before += (at + len(ring) - 1, *range(at, at + len(ring) - 1))
            self._edges += (_upward(*a, *b) for a, b in zip(ring, (*ring[1:], ring[0]), strict=True))
        self._crossed: list[int] = []  # the edges that the sweep line crosses, from west to east

    def problem(self) -> str | None:
        """The first problem found, or None."""
        order = sorted(range(len(self._corners)), key=lambda corner: self._corners[corner][::-1])
        last: Corner | None = None
        for number in order:
            x, y = corner = self._corners[number]
            if corner == last:
                return f"two corners are at {x}, {y}"
            last = corner
            incoming, outgoing = self._before[number], number
            begins = self._edges[incoming][:2] == corner, self._edges[outgoing][:2] == corner
            if all(begins):
                problem = self._begin(incoming, outgoing, corner)
            elif any(begins):
                old, new = (incoming, outgoing) if begins[1] else (outgoing, incoming)
                problem = self._go_on(old, new, corner)
            else:
                problem = self._end({incoming, outgoing}, corner)
            if problem is not None:
                return f"ring {self._rings[number]}: {problem} at {x}, {y}"
        return None

    def _begin(self, incoming: int, outgoing: int, corner: Corner) -> str | None:
        at = self._place(corner)
        turn = _turn(self._edges[incoming], self._edges[outgoing])
        if turn == 0 or (at < len(self._crossed) and _side(self._edges[self._crossed[at]], corner) == 0):
            return MEET
        # the area lies between these two edges if an even number of edges is west of them; it is to the left of each
        # edge
        if (turn < 0) != (at % 2 == 0):
            return "the ring has the wrong orientation or is nested wrongly"
        self._crossed[at:at] = (incoming, outgoing) if turn < 0 else (outgoing, incoming)
        return MEET if self._meets(at - 1) or self._meets(at + 1) else None

    def _go_on(self, old: int, new: int, corner: Corner) -> str | None:
        at = self._place(corner)
        other = self._crossed[at : at + 1] != [old]
        self._crossed[at : at + 1] = [new]
        return MEET if other or self._meets(at - 1) or self._meets(at) else None

    def _end(self, ending: set[int], corner: Corner) -> str | None:
        at = self._place(corner)
        others = set(self._crossed[at : at + 2]) != ending
        del self._crossed[at : at + 2]
        return MEET if others or self._meets(at - 1) else None

    def _place(self, corner: Corner) -> int:
        """The number of crossed edges that lie west of a corner."""
        crossed, edges, (x, y) = self._crossed, self._edges, corner
        low, high = 0, len(crossed)
        while low < high:
            middle = (low + high) >> 1
            x0, y0, x1, y1 = edges[crossed[middle]]
            if (x1 - x0) * (y - y0) < (y1 - y0) * (x - x0):
                low = middle + 1
            else:
                high = middle
        return low

    def _meets(self, at: int) -> bool:
        """Whether a crossed edge and its neighbour share a point other than the corner between them."""
        if not 0 <= at < len(self._crossed) - 1:
            return False
        return _meet(self._edges[self._crossed[at]], self._edges[self._crossed[at + 1]])


def _upward(x0: int, y0: int, x1: int, y1: int) -> Leg:
    """An edge from its southern end; from its western end if both have the same height."""
    return (x0, y0, x1, y1) if (y0, x0) < (y1, x1) else (x1, y1, x0, y0)


def _side(edge: Leg, corner: Corner) -> int:
    """Positive where an upward edge passes east of a corner, negative where it passes west."""
    x0, y0, x1, y1 = edge
    return (x1 - x0) * (corner[1] - y0) - (y1 - y0) * (corner[0] - x0)


def _turn(a: Leg, b: Leg) -> int:
    """Negative where `a` leads further west than `b`."""
    return (a[2] - a[0]) * (b[3] - b[1]) - (a[3] - a[1]) * (b[2] - b[0])


def _meet(a: Leg, b: Leg) -> bool:
    """Whether two upward edges that the sweep line crosses together share a point. A common end from which they lead
    apart does not count. Edges on one straight line overlap.
    """
    start, end = _side(a, b[:2]), _side(a, b[2:])
    if a[:2] == b[:2] or a[2:] == b[2:]:
        return start == end == 0
    if (start > 0 and end > 0) or (start < 0 and end < 0):
        return False
    start, end = _side(b, a[:2]), _side(b, a[2:])
    return not ((start > 0 and end > 0) or (start < 0 and end < 0))


#: 1e-7 degree is about 11 mm at the equator
MAX_FACTOR = 32 << flat.SHIFT


def zones(policy: Policy) -> Iterator[str]:
    """Yield the problems of a policy's geometry."""
    yield from at("projection", _projection(policy.projection))
    yield from within("number of zones", len(policy.zones), 0, MAX_ZONES)
    yield from within("number of declared zones", policy.declared, 0, len(policy.zones))
    yield from within("number of vertices", sum(map(vertices, policy.zones)), 0, MAX_TOTAL_VERTICES)
    for number, zone in enumerate(policy.zones):
        yield from at(f"zone {number}", _zone(zone))
    yield from within("number of tables", len(policy.tables), 0, MAX_TABLES)
    for number, table in enumerate(policy.tables):
        if len(table) != policy.declared:
            yield f"table {number}: {len(table)} entries for {policy.declared} declared zones"
        for entry in table:
            yield from at(f"table {number}", index("zone", entry, len(policy.zones)))


def _projection(projection: flat.Projection) -> Iterator[str]:
    yield from _on_earth(projection.latitude, projection.longitude)
    yield from within("east", projection.east, 1, MAX_FACTOR)
    yield from within("north", projection.north, 1, MAX_FACTOR)


def place(projection: flat.Projection, x: int, y: int) -> Iterator[str]:
    """Yield a problem unless a local place that may be flown to has a latitude and a longitude."""
    yield from at(f"place {x}, {y}", _near(projection, x))
    yield from at(f"place {x}, {y}", _on_earth(*flat.unproject(projection, x, y)))


def _near(projection: flat.Projection, x: int) -> Iterator[str]:
    if abs(x) << flat.SHIFT >= flat.HALF_TURN * projection.east:
        yield "longitude is half around the earth"


def _on_earth(latitude: int, longitude: int) -> Iterator[str]:
    yield from within("latitude", latitude, -900_000_000, 900_000_000)  # 1e-7 degree
    yield from within("longitude", longitude, -flat.HALF_TURN, flat.HALF_TURN)


def vertices(zone: flat.Zone) -> int:
    """A lower bound of the number of vertices, computed before anything else about a zone is known."""
    counts = 1 + min(max(zone.data[0], 0), flat.MAX_RINGS) if zone.shape == flat.AREA and zone.data else 0
    return max(len(zone.data) - counts, 0) // 2


def _zone(zone: flat.Zone) -> Iterator[str]:
    yield from within("floor", zone.floor, flat.LOWEST, flat.HIGHEST)
    yield from within("ceiling", zone.ceiling, zone.floor, flat.HIGHEST)
    if zone.shape == flat.CIRCLE:
        if len(zone.data) != 3:
            yield "a circle has a centre and a squared radius"
        yield from within("squared radius", zone.data[2], 1, flat.MAX_COORDINATE * flat.MAX_COORDINATE)
        coordinates = zone.data[:2]
    elif zone.shape in (flat.POLYGON, flat.AREA):
        start = yield from _counts(zone)
        coordinates = zone.data[start:]
    else:
        yield f"unknown shape {zone.shape}"
    for coordinate in coordinates:
        yield from within("coordinate", coordinate, -flat.MAX_COORDINATE, flat.MAX_COORDINATE)
    if zone.shape != flat.CIRCLE:
        yield from rings(tuple(outline(zone)))
    yield from _times(zone)


def _counts(zone: flat.Zone) -> Generator[str, None, int]:
    """Check the numbers of rings and corners, and return where the coordinates begin."""
    data, start = zone.data, 0
    if zone.shape == flat.AREA:
        count = data[0] if data else 0
        yield from within("number of rings", count, 1, flat.MAX_RINGS)
        start = 1 + count
        for corners in data[1:start]:
            yield from within("number of corners", corners, 3, MAX_TOTAL_VERTICES)
        if len(data) != start + 2 * sum(data[1:start]):
            yield "the number of coordinates does not match the corners of the rings"
    else:
        if len(data) % 2:
            yield "a coordinate is missing"
        yield from within("number of vertices", len(data) // 2, 3, flat.MAX_VERTICES)
    return start


def _times(zone: flat.Zone) -> Iterator[str]:
    if len(zone.daily) not in (0, 2) or len(zone.dates) not in (0, 2):
        yield "a time needs a start and an end"
    if zone.daily and zone.weekly:
        yield "a zone has times of the day or of the week, not both"
    problem = windows_problem(zone.weekly) if zone.weekly else None
    if problem is not None:
        yield problem
    if zone.daily and not (0 <= zone.daily[0] < DAY and 0 <= zone.daily[1] <= DAY):
        yield f"{zone.daily[0]}..{zone.daily[1]} us is not a window of a day"
    if zone.dates and not 0 <= zone.dates[0] <= zone.dates[1] <= MAX_VALUE:
        yield f"{zone.dates[0]}..{zone.dates[1]} us is not an interval of UTC"
