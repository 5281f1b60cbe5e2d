"""Maps: the zones around home with their labels and their use in the airspace; and the planned way of a mission with
its margins, the ways home and what was refused, or the flown track.
"""

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from math import hypot
from types import MappingProxyType
from typing import Final, NamedTuple

from rtshcua.ground.drawing.canvas import (
    LINE,
    ROUND,
    WIDTH,
    Canvas,
    DrawnExtent,
    LabelBox,
    Labels,
    MapLabel,
    canvas,
    contains,
    extent_of,
    extent_of_places,
    hatching,
    number,
    path,
    path_on_page,
    told_distance,
)
from rtshcua.ground.drawing.drawn_site import (
    EVENTS,
    NOT_REFUSED,
    FlownWay,
    PlannedLeg,
    PlannedWay,
    RefusedParts,
    Site,
    ZoneOutline,
    ZoneView,
    planned_legs,
)
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.quantity import Dimension, display

#: px: zones smaller than this are kept free of other zones' labels
_SMALL = 130
#: the share of the drawing from which a zone is labelled at its edge
_LARGE = 0.45
#: the most zones that are labelled, without those that a detail shows
MOST_LABELS = 60
#: what follows the name of a zone that exists only at some times
AT_TIMES: Final = " (at times)"
#: the most corners of a zone that are used to place its label
_CORNERS = 200


def by_size(zones: Sequence[ZoneView]) -> list[ZoneView]:
    """The drawing order: the largest zones first, forbidden zones last."""
    return sorted(zones, key=lambda zone: (zone.use == "forbidden", -extent_of(zone.ground).size))


def label_zones(on: Canvas, labels: Labels, zones: Sequence[ZoneView], beneath: Sequence[LabelBox]) -> tuple[str, ...]:
    """Place the labels of the visible zones, the smallest zone first, because it has the least room."""
    boxes = {zone.name: box_of(on, zone.ground) for zone in zones}
    small = {name: box for name, box in boxes.items() if max(box.width, box.height) < _SMALL}
    lost = []
    for zone in reversed(by_size(zones)):
        box = boxes[zone.name]
        if not box.is_on_page(on.width, on.height) or fills(on, zone.ground):
            continue
        others = [*beneath, *(other for name, other in small.items() if name != zone.name)]
        ground = _thinned(zone.ground)
        anchor = _anchor(on, ground, box)
        kind = "derived" if zone.derived else zone.use or "other"

        def own(x: float, y: float, ground: ZoneOutline = ground) -> bool:
            return contains(ground, *on.place(x, y))

        if len(labels.placed) >= MOST_LABELS or not labels.place(_short(zone), kind, anchor, own, others):
            lost.append(zone.name)
    return tuple(lost)


def _thinned(ground: ZoneOutline) -> ZoneOutline:
    """An outline with fewer corners, exact enough to place a label."""
    step = sum(map(len, ground.rings)) // _CORNERS + 1
    return replace(ground, rings=tuple(ring[::step] if len(ring) > 3 * step else ring for ring in ground.rings))


def _short(zone: ZoneView) -> str:
    """The label of a zone: `school + 20 m` for one that a rule grows, `works (at times)` for one with times."""
    times = AT_TIMES if zone.timed else ""
    if not zone.derived:
        return zone.name + times
    base, _, margin = zone.name.removeprefix("grow(").removesuffix(")").partition(", ")
    return f"{base} {'-' if margin.startswith('-') else '+'} {margin.removeprefix('-')}{times}"


def fills(on: Canvas, ground: ZoneOutline) -> bool:
    """Whether the whole map is inside a zone, so that none of its edges is visible."""
    ground = _thinned(ground)
    across = [on.width * part / 16 for part in range(17)]
    down = [on.height * part / 16 for part in range(17)]
    edge = [(x, y) for x in across for y in (0, on.height)] + [(x, y) for y in down for x in (0, on.width)]
    return all(contains(ground, *on.place(x, y)) for x, y in edge)


def box_of(on: Canvas, ground: ZoneOutline) -> LabelBox:
    """The box of an outline on the page."""
    extent = extent_of(ground)
    x, y = on.at(extent.west, extent.north)
    return LabelBox(x, y, (extent.east - extent.west) * on.scale, (extent.north - extent.south) * on.scale)


def _anchor(on: Canvas, ground: ZoneOutline, box: LabelBox) -> tuple[float, float]:
    """A point inside the outline and on the page: its middle, or near its northern edge if it is large."""
    extent = extent_of(ground)
    large = box.width > _LARGE * on.width or box.height > _LARGE * on.height
    shares = (1, 2, 3, 8) if large else (8, 6, 10, 4, 12)
    found: list[tuple[int, tuple[float, float]]] = []
    for share in shares:
        y = extent.north - (extent.north - extent.south) * share // 16
        for west, east in _chords(ground, y):
            x0, at = on.at(west, y)
            x1, _ = on.at(east, y)
            x0, x1 = max(x0, 0.0), min(x1, float(on.width))
            if x1 > x0 and 0 < at < on.height:
                found.append((-round(x1 - x0), ((x0 + x1) / 2, at)))
        if found:
            return min(found)[1]
    x, y_ = box.middle
    return min(max(x, 20.0), on.width - 20.0), min(max(y_, 20.0), on.height - 20.0)


def _chords(ground: ZoneOutline, y: int) -> Iterator[tuple[int, int]]:
    """The interval of a horizontal line that is inside the outline."""
    if ground.centre is not None:
        squared = ground.radius_squared - (y - ground.centre[1]) ** 2
        if squared > 0:
            half = round(squared**0.5)
            yield ground.centre[0] - half, ground.centre[0] + half
        return
    crossed = sorted(
        ax + (bx - ax) * (y - ay) // (by - ay)
        for ring in ground.rings
        for (ax, ay), (bx, by) in zip(ring, (*ring[1:], ring[0]), strict=True)
        if (ay > y) != (by > y)
    )
    yield from zip(crossed[::2], crossed[1::2], strict=False)


#: px: zones smaller than this on the whole map get a detail map
_TINY = 30
#: px: the least width of a band, and the least radius of the circle around home
LEAST_BAND, LEAST_CIRCLE = 2.0, 6
#: mm: images that are said to be farther from home than this do not enlarge a map
MOST_AWAY = 20_000_000
#: the most points of a track that keep labels away
_TRACK = 500
#: how the zones of each kind are drawn
ZONE_KEYS: Final = MappingProxyType(
    {
        "allowed": "full line: the airspace is inside",
        "forbidden": "hatched, broken line: never inside",
        "other": "thin line: other zones",
        "derived": "dotted: grown by a rule",
    }
)

Point = tuple[int, int]


@dataclass(frozen=True, slots=True)
class DrawnZone:
    """A zone's outline in mm, and how it is drawn; `hatch` are lines on the page, to be seen within the outline only.
    `on_page` is the same outline rounded to hundredths of a pixel, for viewers that scale the width of a line too.

    Not a pattern: of one that is scaled by a matrix, viewers of PDF make nothing.
    """

    kind: str
    title: str
    d: str
    on_page: str
    hatch: str


class DrawingKey(NamedTuple):
    """An entry of a legend: a class of the style, and what is drawn that way."""

    kind: str
    words: str


class DrawnMark(NamedTuple):
    """A mark on the page, and its title."""

    x: float
    y: float
    kind: str
    title: str


class DrawnBand(NamedTuple):
    """A thick line, as the `d` of an SVG path on the page, and its width in px."""

    d: str
    width: float


@dataclass(frozen=True, slots=True)
class ZoneMap:
    """A map; `bar` is the length of the scale bar in px, and what that is. `margin` is the band of the position error
    around the way, `stopping` where the vehicle would stop beyond the ends of its legs, and `homeward` the ways home.
    `ways`, `failed`, `flown` and `later` are the points of lines, `images` the places of images.
    """

    title: str
    policy: str
    width: int
    height: int
    on: Canvas
    outlines: tuple[DrawnZone, ...]
    home: tuple[float, float]
    home_radius: float
    margin: DrawnBand | None
    stopping: DrawnBand | None
    homeward: str
    ways: tuple[str, ...]
    failed: tuple[str, ...]
    flown: tuple[str, ...]
    later: tuple[str, ...]
    stops: tuple[tuple[float, float], ...]
    marks: tuple[DrawnMark, ...]
    images: tuple[DrawnMark, ...]
    labels: tuple[MapLabel, ...]
    bar: tuple[float, str]
    keys: tuple[DrawingKey, ...]
    unlabelled: tuple[str, ...]
    around: tuple[str, ...]  # zones that contain the whole map

    @property
    def matrix(self) -> str:
        """The SVG transform of outlines to the page."""
        return self.on.matrix


def zone_maps(site: Site) -> tuple[ZoneMap, ...]:
    """The map of all zones, and a detail map of the small ones if necessary."""
    home = _home(site)
    whole = home
    for zone in site.zones:
        whole = whole.around(extent_of(zone.ground))
    drawn = [_map("The zones", site, site.zones, whole)]
    scale = canvas(whole).scale
    small = [zone for zone in site.zones if extent_of(zone.ground).size * scale < _TINY]
    if small:
        near = home
        for zone in small:
            near = near.around(extent_of(zone.ground))
        if near.size * 2 < whole.size:
            drawn.append(_map("The small zones", site, site.zones, near))
    return tuple(drawn)


def mission_map(
    site: Site, way: PlannedWay, refused: RefusedParts = NOT_REFUSED, flown: FlownWay | None = None, width: int = WIDTH
) -> ZoneMap:
    """The map of a mission's way, with the zones near it, what was refused of it, and where it was flown; `width` px
    wide.
    """
    legs = tuple(planned_legs(way, site))
    places = [site.home, _begin(site, way), *(place for leg in legs for place in (leg.begin[:2], leg.end[:2]))]
    places += [place for line in _stopping(site, legs) for place in line]
    if flown is not None:
        places += [(each.x, each.y) for part in (*flown.parts, *flown.later) for each in part]
        places += [(each.x, each.y) for each in flown.marks]
        places += [(x, y) for x, y, _ in flown.images if max(abs(x), abs(y)) < MOST_AWAY]
    error = site.margins.position_error
    extent = extent_of_places(places)
    extent = DrawnExtent(extent.west - error, extent.south - error, extent.east + error, extent.north + error)
    title = f"The way of {way.name}" if flown is None else f"The planned way of {way.name}, and the flown track"
    return _map(title, site, site.zones, extent.around(_home(site)), _MapWay(legs, way, refused, flown), width)


def _begin(site: Site, way: PlannedWay) -> Point:
    return site.home if way.begin is None else way.begin[:2]


class _MapWay(NamedTuple):
    """What a map shows of a mission."""

    legs: Sequence[PlannedLeg]
    way: PlannedWay
    refused: RefusedParts
    flown: FlownWay | None


def _stopping(site: Site, legs: Sequence[PlannedLeg]) -> Iterator[tuple[Point, Point]]:
    """The lines beyond the ends of legs to where the vehicle stops, if it is told so there at its planned speed."""
    for leg in legs:
        x, y = leg.end.x - leg.begin.x, leg.end.y - leg.begin.y
        reach, length = site.margins.stopping(leg.step.speed), hypot(x, y)
        if reach and length:
            yield leg.end[:2], (leg.end.x + round(x / length * reach), leg.end.y + round(y / length * reach))


def _homeward(site: Site, legs: Sequence[PlannedLeg]) -> Iterator[Point]:
    """The places where steps end, each once, without home and without those from where a return is planned."""
    ends = {leg.step.number: leg.end[:2] for leg in legs}
    planned = {leg.begin[:2] for leg in legs if leg.step.motion == MotionKind.HOME}
    yield from (place for place in dict.fromkeys(ends.values()) if place != site.home and place not in planned)


def _home(site: Site) -> DrawnExtent:
    (x, y), r = site.home, max(site.home_within, 1_000)
    return DrawnExtent(x - r, y - r, x + r, y + r)


def _map(
    title: str, site: Site, zones: Sequence[ZoneView], extent: DrawnExtent, shown: _MapWay | None = None,
    width: int = WIDTH,
) -> ZoneMap:  # fmt: skip
    on = canvas(extent, width)
    labels = Labels(on.width, on.height)
    bar = _bar(on)
    labels.reserve(LabelBox(8, on.height - 34, bar[0] + 16, 30))  # the scale bar
    labels.reserve(LabelBox(on.width - 40, 4, 36, 52))  # the north arrow
    home = on.at(*site.home)
    labels.reserve(LabelBox(home[0] - 8, home[1] - 8, 16, 16))
    drawn = _DrawnWay() if shown is None else _drawn_way(on, site, shown)
    for x, y in drawn.stops:
        labels.reserve(LabelBox(x - 5, y - 5, 10, 10))
    for mark in drawn.marks:
        labels.reserve(LabelBox(mark.x - 7, mark.y - 7, 14, 14))
    beneath = boxes_along(*drawn.lines)
    labels.place("home", "home", (home[0], home[1] + 18), avoid=beneath, subject=home)
    for (x, y), numbers in drawn.stops.items():
        labels.place(told_numbers(numbers), "stop", (x + 14, y - 12), avoid=beneath, subject=(x, y))
    lost = [
        mark.title
        for mark in drawn.marks
        if not labels.place(mark.title, mark.kind, (mark.x, mark.y - LINE), avoid=beneath, subject=(mark.x, mark.y))
    ]
    unlabelled = (*lost, *label_zones(on, labels, zones, beneath))
    outlines = tuple(_outlined(on, zone) for zone in by_size(zones))
    return ZoneMap(
        title=title,
        policy=site.policy,
        width=on.width,
        height=on.height,
        on=on,
        outlines=outlines,
        home=home,
        home_radius=site.home_within * on.scale,
        margin=drawn.margin,
        stopping=drawn.stopping,
        homeward=drawn.homeward,
        ways=drawn.ways,
        failed=drawn.failed,
        flown=drawn.flown,
        later=drawn.later,
        stops=tuple(drawn.stops),
        marks=drawn.marks,
        images=drawn.images,
        labels=tuple(labels.placed),
        bar=bar,
        keys=(*_zone_keys(on, outlines, zones), *drawn.keys, *_home_keys(site, on)),
        unlabelled=unlabelled,
        around=tuple(zone.name for zone in zones if fills(on, zone.ground)),
    )


def _zone_keys(on: Canvas, outlines: Sequence[DrawnZone], zones: Sequence[ZoneView]) -> Iterator[DrawingKey]:
    """The legend of the zones of which something is on the page."""
    seen = {"derived" if each.derived else each.use or "other" for each in zones if is_seen(on, each)}
    for kind, words in ZONE_KEYS.items():
        if kind in seen and any(each.kind == kind for each in outlines):
            yield DrawingKey(kind, words)


def is_seen(on: Canvas, zone: ZoneView) -> bool:
    """Whether a part of a zone's box is on the page."""
    return box_of(on, zone.ground).is_on_page(on.width, on.height)


def _home_keys(site: Site, on: Canvas) -> Iterator[DrawingKey]:
    yield DrawingKey("home", "home")
    if site.home_within * on.scale > LEAST_CIRCLE:
        yield DrawingKey("near", "within this circle the real home may lie")


class _DrawnWay(NamedTuple):
    """A mission on the page; `lines` are those that labels avoid."""

    margin: DrawnBand | None = None
    stopping: DrawnBand | None = None
    homeward: str = ""
    ways: tuple[str, ...] = ()
    failed: tuple[str, ...] = ()
    flown: tuple[str, ...] = ()
    later: tuple[str, ...] = ()
    stops: Mapping[tuple[float, float], Sequence[int]] = MappingProxyType({})
    marks: tuple[DrawnMark, ...] = ()
    images: tuple[DrawnMark, ...] = ()
    lines: tuple[Sequence[tuple[float, float]], ...] = ()
    keys: tuple[DrawingKey, ...] = ()


def _drawn_way(on: Canvas, site: Site, shown: _MapWay) -> _DrawnWay:
    legs, _, refused, flown = shown
    line = [on.at(*_begin(site, shown.way)), *(on.at(*leg.end[:2]) for leg in legs)]
    home = on.at(*site.home)
    homeward = [(on.at(*place), home) for place in _homeward(site, legs)]
    stopping = [(on.at(*begin), on.at(*end)) for begin, end in _stopping(site, legs)]
    width = max(2 * site.margins.position_error * on.scale, LEAST_BAND)
    if flown is None:
        flown = FlownWay(())
    tracks, later = ([[on.at(each.x, each.y) for each in part] for part in some] for some in (flown.parts, flown.later))
    marks = [DrawnMark(*on.at(each.x, each.y), each.kind, each.label) for each in flown.marks]
    marks += [
        DrawnMark(*on.at(each.x, each.y), "left", f"step {each.number} leaves the airspace") for each in refused.left
    ]
    failed = tuple(_failed(on, legs, refused.steps))
    way = _DrawnWay(
        margin=DrawnBand(joined(line), width) if site.margins.position_error else None,
        stopping=DrawnBand("".join(map(joined, stopping)), width) if stopping else None,
        homeward="".join(map(joined, homeward)),
        ways=(points(line),),
        failed=tuple(map(points, failed)),
        flown=tuple(map(points, tracks)),
        later=tuple(map(points, later)),
        stops=_stops(on, shown.way, site),
        marks=tuple(marks),
        images=tuple(DrawnMark(*on.at(x, y), "image", told) for x, y, told in flown.images),
        lines=(line, *homeward, *(_thinned_line(each) for each in (*tracks, *later))),
    )
    return way._replace(keys=tuple(_way_keys(site, way)))


def _way_keys(site: Site, way: _DrawnWay) -> Iterator[DrawingKey]:
    """The legend of a mission."""
    yield DrawingKey("way", "the planned way; numbers: the steps that end there")
    if way.margin is not None:
        yield DrawingKey("margin", f"position error, {display(site.margins.position_error, Dimension.LENGTH)} each way")
    if way.stopping is not None:
        yield DrawingKey("stopping", "where it stops if told to at the end of a leg, at its planned speed")
    if way.homeward:
        at = f" at {display(site.return_altitude, Dimension.LENGTH)} above home" if site.return_altitude else ""
        yield DrawingKey("homeward", f"the way home{at}, from the end of a step")
    if way.failed:
        yield DrawingKey("failed-leg", "the way of a step that is refused")
    kinds = {each.kind for each in way.marks}
    if "left" in kinds:
        yield DrawingKey("failed-mark", "where it leaves the airspace first")
    if way.flown:
        yield DrawingKey("flown", "the flown track")
    if way.later:
        yield DrawingKey("later", "the track after the last record of the log")
    if way.images:
        yield DrawingKey("image-mark", "an image, where its camera says that it was taken")
    if kinds & EVENTS:
        yield DrawingKey("event-mark", "a decision, with the number of its record")


def _failed(on: Canvas, legs: Sequence[PlannedLeg], steps: Container[int]) -> Iterator[list[tuple[float, float]]]:
    """The lines of steps, of those that move across."""
    for number_, some in groupby(legs, key=lambda leg: leg.step.number):
        line = [on.at(*place) for leg in some for place in (leg.begin[:2], leg.end[:2])]
        if number_ in steps and any(point != line[0] for point in line):
            yield [line[0], *line[1::2]]


def points(line: Sequence[tuple[float, float]]) -> str:
    """The points of an SVG polyline."""
    return " ".join(f"{number(x)},{number(y)}" for x, y in line)


def joined(line: Sequence[tuple[float, float]]) -> str:
    """A line as the `d` of an SVG path."""
    return "M" + "L".join(f"{number(x)} {number(y)}" for x, y in line)


def _thinned_line(line: Sequence[tuple[float, float]]) -> Sequence[tuple[float, float]]:
    """A flown track with fewer points, exact enough to keep labels off it."""
    return line[:: len(line) // _TRACK + 1]


def _outlined(on: Canvas, zone: ZoneView) -> DrawnZone:
    kind = "derived" if zone.derived else zone.use or "other"
    said = {"allowed": "the airspace is inside of it", "forbidden": "the airspace is outside of it"}.get(zone.use, "")
    words = ", ".join(
        part for part in (zone.name, zone.shape.replace("`", ""), zone.band.replace("`", ""), said) if part
    )
    lines = hatching(box_of(on, zone.ground), on.width, on.height) if kind == "forbidden" else ""
    return DrawnZone(kind, words, path(zone.ground), path_on_page(on, zone.ground), lines)


def boxes_along(*lines: Sequence[tuple[float, float]]) -> tuple[LabelBox, ...]:
    """Small boxes along lines on the page, which labels avoid; one where several lie over each other."""
    found: dict[tuple[int, int], LabelBox] = {}
    for line in lines:
        for (ax, ay), (bx, by) in pairwise(line):
            count = int(max(abs(bx - ax), abs(by - ay)) / 6) + 1
            for part in range(count + 1):
                x, y = ax + (bx - ax) * part / count, ay + (by - ay) * part / count
                cell = int(x / 3), int(y / 3)
                if cell not in found:
                    found[cell] = LabelBox(x - 2, y - 2, 4, 4)
    return tuple(found.values())


def _stops(on: Canvas, way: PlannedWay, site: Site) -> dict[tuple[float, float], list[int]]:
    """The places where steps end, with their numbers. A step without a path ends where the previous one did."""
    found: dict[tuple[float, float], list[int]] = {}
    at = _begin(site, way)
    for step in way.steps:
        at = step.path[-1] if step.path else at
        gather(found, on.at(*at), step.number)
    return found


def gather(found: dict[tuple[float, float], list[int]], at: tuple[float, float], number_: int) -> None:
    """Add a step's number at its place on the page, or at one so near that both cannot be told apart."""
    near = next((stop for stop in found if abs(stop[0] - at[0]) + abs(stop[1] - at[1]) < 8), at)
    found.setdefault(near, []).append(number_)


def told_numbers(numbers: Sequence[int]) -> str:
    """Ascending numbers as text, such as `1-3, 5`."""
    runs: list[list[int]] = []
    for each in numbers:
        if runs and each == runs[-1][-1] + 1:
            runs[-1].append(each)
        else:
            runs.append([each])
    return ", ".join(f"{run[0]}-{run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs)


def _bar(on: Canvas) -> tuple[float, str]:
    """A round length of at most a fifth of the drawing: 1, 2 or 5 times a power of ten."""
    most = on.width / 5 / on.scale
    length = max((step for step in ROUND if step <= most), default=1)
    return length * on.scale, told_distance(length)
