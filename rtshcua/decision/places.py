"""Sets of places in space: where the vehicle is, may be, or will be along its planned path."""

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

from rtshcua.decision.bands import Box
from rtshcua.decision.truth import AND, FALSE, UNKNOWN, Truth
from rtshcua.decision.values import ABSENT, Value
from rtshcua.decision.zones import PreparedZone


class Sweep:
    """A path widened by a box (see `zones`). It remembers each zone's answer, which depends on nothing else: when
    the zone exists is asked elsewhere (`evaluate.within`)."""

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


class Place:
    """A set of places, the union of its parts; `unknown` is UNKNOWN when the place may be missing, else 0.

    It too remembers each zone's answer, so that a planned volume that did not change is not looked at again.
    """

    __slots__ = ("_answers", "parts", "unknown")

    def __init__(self, parts: tuple[Part, ...], unknown: Truth) -> None:
        self.parts, self.unknown = parts, unknown
        self._answers: dict[int, Truth] = {}

    def inside(self, zone: PreparedZone) -> Truth:
        """Whether the places are inside a zone, at a time at which it exists."""
        answer = self._answers.get(zone.number)
        if answer is None:
            answer = self._answers[zone.number] = self._inside(zone)
        return answer

    def _inside(self, zone: PreparedZone) -> Truth:
        truth = self.unknown
        for sweep, low, high in self.parts:
            vertical = zone.between(low, high)
            truth |= FALSE if vertical == FALSE else AND[vertical][sweep.within(zone)]
        return truth


NOWHERE = Place((), UNKNOWN)


class WellKnown(NamedTuple):
    """The state slots of position (x, y), height, battery and velocity. One that no signal owns is the slot after the
    last, which is missing.
    """

    x: int
    y: int
    height: int
    battery: int
    north: int = -1
    east: int = -1
    down: int = -1


def here(slots: Sequence[Value], known: WellKnown) -> Place:
    """Where the vehicle is now, as far as the state tells."""
    west, east, x_gap, _ = slots[known.x]
    south, north, y_gap, _ = slots[known.y]
    low, high, height_gap, _ = slots[known.height]
    gap = max(x_gap, y_gap, height_gap)
    if gap == ABSENT:
        return NOWHERE
    sweep = Sweep((west, south), (0, 0, east - west, north - south))
    return Place(((sweep, low, high),), UNKNOWN if gap else 0)
