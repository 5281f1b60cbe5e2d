"""A map: zones around home, what the airspace makes of them, and the way of a mission."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from rtshcua.ground.report.drawing.canvas import (
    ROUND,
    Canvas,
    Extent,
    canvas,
    extent_of,
    extent_of_places,
    number,
    path,
)
from rtshcua.ground.report.drawing.hatch import hatching
from rtshcua.ground.report.drawing.labels import Box, Label, Labels
from rtshcua.ground.report.drawing.zone_labels import box_of, by_size, fills, label_zones
from rtshcua.ground.report.model import Chapter, MissionTold, ZoneTold
from rtshcua.model.quantity import Dimension, display

#: a detail is drawn of zones that are smaller than this on the whole map, px
_TINY = 30


@dataclass(frozen=True, slots=True)
class Outlined:
    """A zone's outline in mm, and how it is drawn; `hatch` are lines on the page, to be seen within the outline only.

    Not a pattern: of one that is scaled by a matrix, viewers of PDF make nothing.
    """

    kind: str
    title: str
    d: str
    hatch: str


@dataclass(frozen=True, slots=True)
class Plan:
    """A map; `bar` is the length of the scale bar in px, and what that is."""

    title: str
    width: int
    height: int
    matrix: str
    outlines: tuple[Outlined, ...]
    home: tuple[float, float]
    home_radius: float
    ways: tuple[str, ...]
    stops: tuple[tuple[float, float], ...]
    labels: tuple[Label, ...]
    bar: tuple[float, str]
    unlabelled: tuple[str, ...]
    around: tuple[str, ...]  # zones that the whole map lies in
    on: Canvas  # how the plane lies on the page

    def at(self, x: int, y: int) -> tuple[float, float]:
        """Where a place lies on the page."""
        return self.on.at(x, y)


def plans(chapter: Chapter) -> tuple[Plan, ...]:
    """The map of all zones, and one of the small ones where they would be lost on it."""
    home = _home(chapter)
    whole = home
    for zone in chapter.zones:
        whole = whole.around(extent_of(zone.ground))
    drawn = [_plan("The zones", chapter, chapter.zones, whole)]
    scale = canvas(whole).scale
    small = [zone for zone in chapter.zones if extent_of(zone.ground).size * scale < _TINY]
    if small:
        near = home
        for zone in small:
            near = near.around(extent_of(zone.ground))
        if near.size * 2 < whole.size:
            drawn.append(_plan("The small zones", chapter, chapter.zones, near))
    return tuple(drawn)


def mission_plan(chapter: Chapter, mission: MissionTold) -> Plan:
    """The map of a mission's way, with the zones that it comes near."""
    places = [chapter.home, *(place for step in mission.steps for place in step.path)]
    extent = extent_of_places(places)
    extent = extent.around(_home(chapter))
    declared = [zone for zone in chapter.zones if not zone.derived]
    return _plan(f"The way of {mission.name}", chapter, declared, extent, mission)


def _home(chapter: Chapter) -> Extent:
    (x, y), r = chapter.home, max(chapter.home_within, 1_000)
    return Extent(x - r, y - r, x + r, y + r)


def _plan(
    title: str, chapter: Chapter, zones: Sequence[ZoneTold], extent: Extent, mission: MissionTold | None = None
) -> Plan:
    on = canvas(extent)
    labels = Labels(on.width, on.height)
    bar = _bar(on)
    labels.reserve(Box(8, on.height - 34, bar[0] + 16, 30))  # the scale bar
    labels.reserve(Box(on.width - 40, 4, 36, 52))  # the north arrow
    home = on.at(*chapter.home)
    labels.reserve(Box(home[0] - 8, home[1] - 8, 16, 16))
    stops = _stops(on, mission)
    for x, y in stops:
        labels.reserve(Box(x - 5, y - 5, 10, 10))
    way = [] if mission is None else _way(on, chapter, mission)
    beneath = list(_boxes(way))
    labels.place("home", "home", (home[0], home[1] + 18), avoid=beneath)
    for (x, y), numbers in stops.items():
        labels.place(_numbers(numbers), "stop", (x + 14, y - 12), avoid=beneath)
    unlabelled = label_zones(on, labels, zones, beneath)
    return Plan(
        title=title,
        width=on.width,
        height=on.height,
        matrix=on.matrix,
        outlines=tuple(_outlined(on, zone) for zone in by_size(zones)),
        home=home,
        home_radius=chapter.home_within * on.scale,
        ways=(" ".join(f"{number(x)},{number(y)}" for x, y in way),) if way else (),
        stops=tuple(stops),
        labels=tuple(labels.placed),
        bar=bar,
        unlabelled=unlabelled,
        around=tuple(zone.name for zone in zones if fills(on, zone.ground)),
        on=on,
    )


def _outlined(on: Canvas, zone: ZoneTold) -> Outlined:
    kind = "derived" if zone.derived else zone.use or "other"
    said = {"allowed": "the airspace is inside of it", "forbidden": "the airspace is outside of it"}.get(zone.use, "")
    words = ", ".join(
        part for part in (zone.name, zone.shape.replace("`", ""), zone.band.replace("`", ""), said) if part
    )
    lines = hatching(box_of(on, zone.ground), on.width, on.height) if kind == "forbidden" else ""
    return Outlined(kind, words, path(zone.ground), lines)


def _way(on: Canvas, chapter: Chapter, mission: MissionTold) -> list[tuple[float, float]]:
    return [on.at(*place) for place in (chapter.home, *(place for step in mission.steps for place in step.path))]


def _boxes(way: Sequence[tuple[float, float]]) -> Iterator[Box]:
    """Small boxes along a way, so that labels can keep off it."""
    for (ax, ay), (bx, by) in pairwise(way):
        count = int(max(abs(bx - ax), abs(by - ay)) / 6) + 1
        for part in range(count + 1):
            yield Box(ax + (bx - ax) * part / count - 2, ay + (by - ay) * part / count - 2, 4, 4)


def _stops(on: Canvas, mission: MissionTold | None) -> dict[tuple[float, float], list[int]]:
    """Where steps end, and which do there; a step without a way of its own ends where the one before did."""
    found: dict[tuple[float, float], list[int]] = {}
    at: tuple[int, int] | None = None
    for step in () if mission is None else mission.steps:
        at = step.path[-1] if step.path else at
        x, y = on.at(*(at or (0, 0)))
        near = next((stop for stop in found if abs(stop[0] - x) + abs(stop[1] - y) < 8), (x, y))
        found.setdefault(near, []).append(step.number)
    return found


def _numbers(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers))


def _bar(on: Canvas) -> tuple[float, str]:
    """A round length of at most a fifth of the drawing: 1, 2 or 5 of a power of ten."""
    most = on.width / 5 / on.scale
    length = max((step for step in ROUND if step <= most), default=1)
    return length * on.scale, display(length, Dimension.LENGTH)
