"""Tests whether a place, or everything along a path, is inside a zone. Exact, in integers, without division.

A zone is an open set: its boundary (that of a hole too), floor and ceiling are outside. A *sweep* is a path of
straight legs, each widened by a box. A point is a path of one place with an empty box, and a set of places is one
place with a box; the path of a vehicle is widened by its position error. A sweep that touches a boundary counts as
being on both sides of it, so that it is refused whichever side is required.

Bounds for 64-bit arithmetic: coordinates and box sides are within 2**29 mm (`MAX_COORDINATE`), hence differences
within 2**30, cross products within 2**61 and their sums with the box's within 2**62.
"""

from collections.abc import Sequence
from math import isqrt
from typing import NamedTuple, TypeAlias

from rtshcua.decision.outline import Bands, Box, Slabs, edges
from rtshcua.decision.times import LocalTime, Times, timed
from rtshcua.decision.values import ABSENT, AND, FALSE, PRESENT, TRUE, UNKNOWN, Truth, Value
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, Zone

NO_BOX: Box = (0, 0, 0, 0)
#: the margin around a place within which a zone is compared in advance, mm: the distance of a second or two of
#: flight
AROUND = 10_000
_UTC = LocalTime(0)


class Disc:
    """All places nearer to a centre than a radius."""

    __slots__ = ("_radius", "_square", "_x", "_y")

    def __init__(self, data: tuple[int, ...]) -> None:
        self._x, self._y, self._square = data
        self._radius = isqrt(self._square - 1) + 1

    def contains(self, x: int, y: int) -> bool:
        """Whether a place is inside."""
        dx, dy = x - self._x, y - self._y
        return dx * dx + dy * dy < self._square

    def compared(self, y0: int, y1: int, box: Box) -> int:
        """The number of edges compared with a leg: none."""
        return 0

    def clear(self, x0: int, y0: int, x1: int, y1: int, box: Box) -> bool:
        """Whether the widened leg is completely inside, or completely outside by a margin of at most 3 mm."""
        west, south, east, north = box
        if self._holds(x0, y0, box) and self._holds(x1, y1, box):  # a disc is convex
            return True
        reach_x, reach_y = max(-west, east), max(-south, north)
        reach = self._radius + isqrt(reach_x * reach_x + reach_y * reach_y) + 1
        return self._outside(x0, y0, x1, y1, reach)

    def throughout(self, west: int, south: int, east: int, north: int) -> bool | None:
        """Whether all of a box is inside; None where parts of it are on both sides.

        True for outside only where `clear` is true of every leg in the box whose own box reaches no further than
        `AROUND`. Its reach counts half as much again at most, where the leg passes the centre: the length of 2 mm
        is rounded up to 3.
        """
        if self._holds(west, south, (0, 0, east - west, north - south)):
            return True
        reach = self._radius + isqrt(2 * AROUND * AROUND) + 2
        dx, dy = max(west - self._x, self._x - east, 0), max(south - self._y, self._y - north, 0)
        return False if 4 * (dx * dx + dy * dy) > 9 * reach * reach else None

    def _holds(self, x: int, y: int, box: Box) -> bool:
        """Whether a widened place is inside: its corner farthest from the centre is."""
        west, south, east, north = box
        dx, dy = x - self._x, y - self._y
        dx, dy = max(dx + east, -dx - west), max(dy + north, -dy - south)
        return dx * dx + dy * dy < self._square

    def _outside(self, x0: int, y0: int, x1: int, y1: int, radius: int) -> bool:
        """Whether the leg stays farther than `radius` from the centre; its length is rounded up, for safety."""
        ux, uy, vx, vy = x1 - x0, y1 - y0, self._x - x0, self._y - y0
        along, square = ux * vx + uy * vy, ux * ux + uy * uy
        if along <= 0:
            return vx * vx + vy * vy > radius * radius
        if along >= square:
            wx, wy = self._x - x1, self._y - y1
            return wx * wx + wy * wy > radius * radius
        return abs(ux * vy - uy * vx) > radius * (isqrt(square) + 1)


class RingArea:
    """The inside of the rings of a polygon, or of areas with holes."""

    __slots__ = ("clear", "compared", "contains")

    def __init__(self, zone: Zone) -> None:
        legs = tuple(edges(zone))
        self.contains = Slabs(legs).contains
        bands = Bands(legs)
        self.clear, self.compared = bands.clear, bands.compared

    def throughout(self, west: int, south: int, east: int, north: int) -> bool | None:
        """Whether all of a box is inside; None where parts of it are on both sides."""
        if not self.clear(west, south, west, south, (0, 0, east - west, north - south)):
            return None
        return bool(self.contains(west, south))


class PreparedZone:
    """A zone prepared for queries. `number` is its index in the policy; `times` is None if it always exists."""

    __slots__ = ("banded", "ceiling", "floor", "number", "shape", "times", "vicinity")

    def __init__(self, number: int, zone: Zone, local: LocalTime = _UTC) -> None:
        self.number = number
        self.floor, self.ceiling = zone.floor, zone.ceiling
        self.banded = (zone.floor, zone.ceiling) != (LOWEST, HIGHEST)
        self.shape: Disc | RingArea = Disc(zone.data) if zone.shape == CIRCLE else RingArea(zone)
        self.times = Times(zone, local) if timed(zone) else None
        self.vicinity = Vicinity(self)

    def along(self, path: tuple[int, ...], box: Box) -> Truth:
        """Whether the places of a sweep are inside, whatever their height."""
        shape = self.shape
        if len(path) > 2:
            for at in range(0, len(path) - 2, 2):
                if not shape.clear(path[at], path[at + 1], path[at + 2], path[at + 3], box):
                    return TRUE | FALSE
        elif box != NO_BOX and not shape.clear(path[0], path[1], path[0], path[1], box):
            return TRUE | FALSE
        return TRUE if shape.contains(path[0], path[1]) else FALSE

    def between(self, low: int, high: int, gap: int = PRESENT) -> Truth:
        """Whether the heights `low`..`high` (mm above home), which may be missing, lie between floor and ceiling. A
        zone with neither does not read the height.
        """
        if not self.banded:
            return TRUE
        if gap == ABSENT:
            return UNKNOWN
        if low > self.floor and high < self.ceiling:
            truth = TRUE
        else:
            truth = FALSE if high <= self.floor or low >= self.ceiling else TRUE | FALSE
        return truth | UNKNOWN if gap else truth


#: west, south, the least height, east, north, the greatest height; mm
Bounds: TypeAlias = tuple[int, int, int, int, int, int]


class Vicinity:
    """A box around the places of the last queries, and the zone's answer for every place in it, if there is a single
    one. This avoids repeated comparisons with the outline for a vehicle in flight. No answer depends on it.
    """

    __slots__ = ("_answer", "_bounds", "_compared", "_zone")

    def __init__(self, zone: PreparedZone) -> None:
        self._zone = zone
        self._bounds: Bounds = (0, 0, 0, -1, -1, -1)  # nothing is in it
        self._answer: Truth | None = None
        self._compared = False

    def answer(self, bounds: Bounds) -> Truth | None:
        """The zone's answer for every place within these bounds; None where the place itself must be compared.

        The box is compared only once a second place lies in it, because places far apart gain nothing from it.
        """
        west, south, low, east, north, high = bounds
        near = self._bounds
        if west < near[0] or south < near[1] or low < near[2] or east > near[3] or north > near[4] or high > near[5]:
            self._bounds = (west - AROUND, south - AROUND, low - AROUND, east + AROUND, north + AROUND, high + AROUND)
            self._answer, self._compared = None, False
        elif not self._compared:
            self._answer, self._compared = self._compare(), True
        return self._answer

    def _compare(self) -> Truth | None:
        west, south, low, east, north, high = self._bounds
        vertical = self._zone.between(low, high)
        if vertical == FALSE:
            return FALSE
        inside = self._zone.shape.throughout(west, south, east, north)
        truth = FALSE if inside is False else vertical if inside else TRUE | FALSE
        return truth if truth in (TRUE, FALSE) else None


class Sweep:
    """A path widened by a box (see the module). It caches each zone's answer, which depends on nothing else:
    `evaluate.within` handles the times of the zone.
    """

    __slots__ = ("_answers", "box", "path")

    def __init__(self, path: tuple[int, ...], box: Box) -> None:
        self.path, self.box = path, box
        self._answers: dict[int, Truth] = {}

    def within(self, zone: PreparedZone) -> Truth:
        """Whether the places of this sweep are inside the zone, whatever their height."""
        answer = self._answers.get(zone.number)
        if answer is None:
            answer = self._answers[zone.number] = zone.along(self.path, self.box)
        return answer


#: a sweep at heights `low`..`high`, mm above home
Part: TypeAlias = tuple[Sweep, int, int]


class PlaceSet:
    """A set of places: the union of its parts, of which there is at least one. `located` and `high` say whether
    position and height may be missing; either may suffice to show that the places are outside a zone. `fixed` is
    another set that belongs to it, with the same gaps: its answers stay the same for many sets. `whole` is the path
    whose legs the parts are, one after the other.

    It also caches each zone's answer, so that an unchanged planned volume is not compared again.
    """

    __slots__ = ("_answers", "_bounds", "_fixed", "_own", "_whole", "high", "located", "parts")

    def __init__(
        self, parts: tuple[Part, ...], located: int = PRESENT, high: int = PRESENT, fixed: "PlaceSet | None" = None,
        whole: Sweep | None = None,
    ) -> None:  # fmt: skip
        self._own, self._fixed, self._whole = parts, fixed, whole
        self.parts: tuple[Part, ...] = parts if fixed is None else parts + fixed.parts
        self.located, self.high = located, high
        self._answers: dict[int, Truth] = {}
        self._bounds = None if located or high or len(self.parts) > 1 else _bounds(*parts[0])

    def inside(self, zone: PreparedZone) -> Truth:
        """Whether the places are inside a zone, at a time when it exists."""
        answer = self._answers.get(zone.number)
        if answer is None:
            if self._bounds is not None:
                answer = zone.vicinity.answer(self._bounds)
            if answer is None:
                answer = self._inside(zone)
            self._answers[zone.number] = answer
        return answer

    def _inside(self, zone: PreparedZone) -> Truth:
        if self._whole is not None:
            return self._along(zone, self._whole.within(zone))
        truth, located = 0 if self._fixed is None else self._fixed.inside(zone), self.located
        for sweep, low, high in self._own:
            vertical = zone.between(low, high, self.high)
            if vertical == FALSE:
                truth |= FALSE
            elif located == ABSENT:
                truth |= AND[vertical][UNKNOWN]
            else:
                truth |= AND[vertical][sweep.within(zone) | (UNKNOWN if located else 0)]
        return truth

    def _along(self, zone: PreparedZone, whole: Truth) -> Truth:
        """The same for the legs of a path, which may be thousands. Where all of the path is on one side, so is each
        leg; elsewhere their answers are not cached, as that of this set is.
        """
        mixed, gap = whole == TRUE | FALSE, UNKNOWN if self.located else 0
        most = TRUE | FALSE | (UNKNOWN if self.located or self.high else 0)
        truth = 0
        for sweep, low, high in self._own:
            vertical = zone.between(low, high, self.high)
            if vertical == FALSE:
                truth |= FALSE
            elif self.located == ABSENT:
                truth |= AND[vertical][UNKNOWN]
            else:
                truth |= AND[vertical][(zone.along(sweep.path, sweep.box) if mixed else whole) | gap]
            if truth == most:
                break
        return truth


def _bounds(sweep: Sweep, low: int, high: int) -> Bounds | None:
    """The bounds of a part; None where its box is too wide for `Disc.throughout`."""
    west, south, east, north = box = sweep.box
    if max(map(abs, box)) > AROUND:
        return None
    x, y = sweep.path[::2], sweep.path[1::2]
    return (min(x) + west, min(y) + south, low, max(x) + east, max(y) + north, high)


NOWHERE = PlaceSet(((Sweep((0, 0), NO_BOX), 0, 0),), ABSENT, ABSENT)


class WellKnown(NamedTuple):
    """The state slots of position (x, y), height, battery, velocity, and measured drain. A quantity without a signal
    has the slot after the last, which is always missing.
    """

    x: int
    y: int
    height: int
    battery: int
    north: int = -1
    east: int = -1
    down: int = -1
    drain: int = -1


def here(slots: Sequence[Value], known: WellKnown) -> PlaceSet:
    """The vehicle's present place, as far as the state has it."""
    west, east, x_gap, _ = slots[known.x]
    south, north, y_gap, _ = slots[known.y]
    low, high, height_gap, _ = slots[known.height]
    sweep = Sweep((west, south), (0, 0, east - west, north - south))
    return PlaceSet(((sweep, low, high),), max(x_gap, y_gap), height_gap)
