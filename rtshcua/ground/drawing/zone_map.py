"""Maps: the zones around home with their labels and their use in the airspace, and the path of a mission."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from rtshcua.ground.drawing.canvas import (
    ROUND,
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
)
from rtshcua.ground.drawing.site import PlannedWay, Site, ZoneOutline, ZoneView
from rtshcua.model.quantity import Dimension, display

#: px: zones smaller than this are kept free of other zones' labels
_SMALL = 130
#: the share of the drawing from which a zone is labelled at its edge
_LARGE = 0.45
#: the most zones that are labelled, without those that a detail shows
MOST_LABELS = 60
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
    """The label of a zone: `school + 20 m` for one that a rule grows."""
    if not zone.derived:
        return zone.name
    base, _, margin = zone.name.removeprefix("grow(").removesuffix(")").partition(", ")
    return f"{base} {'-' if margin.startswith('-') else '+'} {margin.removeprefix('-')}"


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


@dataclass(frozen=True, slots=True)
class DrawnZone:
    """A zone's outline in mm, and how it is drawn; `hatch` are lines on the page, to be seen within the outline only.

    Not a pattern: of one that is scaled by a matrix, viewers of PDF make nothing.
    """

    kind: str
    title: str
    d: str
    hatch: str


@dataclass(frozen=True, slots=True)
class ZoneMap:
    """A map; `bar` is the length of the scale bar in px, and what that is."""

    title: str
    policy: str
    width: int
    height: int
    matrix: str
    outlines: tuple[DrawnZone, ...]
    home: tuple[float, float]
    home_radius: float
    ways: tuple[str, ...]
    stops: tuple[tuple[float, float], ...]
    labels: tuple[MapLabel, ...]
    bar: tuple[float, str]
    unlabelled: tuple[str, ...]
    around: tuple[str, ...]  # zones that contain the whole map
    on: Canvas

    def at(self, x: int, y: int) -> tuple[float, float]:
        """The point on the page of a place."""
        return self.on.at(x, y)


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


def mission_map(site: Site, way: PlannedWay) -> ZoneMap:
    """The map of a mission's path, with the zones near it."""
    places = [site.home, *(place for step in way.steps for place in step.path)]
    extent = extent_of_places(places)
    extent = extent.around(_home(site))
    declared = [zone for zone in site.zones if not zone.derived]
    return _map(f"The way of {way.name}", site, declared, extent, way)


def _home(site: Site) -> DrawnExtent:
    (x, y), r = site.home, max(site.home_within, 1_000)
    return DrawnExtent(x - r, y - r, x + r, y + r)


def _map(
    title: str, site: Site, zones: Sequence[ZoneView], extent: DrawnExtent, way: PlannedWay | None = None
) -> ZoneMap:
    on = canvas(extent)
    labels = Labels(on.width, on.height)
    bar = _bar(on)
    labels.reserve(LabelBox(8, on.height - 34, bar[0] + 16, 30))  # the scale bar
    labels.reserve(LabelBox(on.width - 40, 4, 36, 52))  # the north arrow
    home = on.at(*site.home)
    labels.reserve(LabelBox(home[0] - 8, home[1] - 8, 16, 16))
    stops = _stops(on, way)
    for x, y in stops:
        labels.reserve(LabelBox(x - 5, y - 5, 10, 10))
    line = [] if way is None else _line(on, site, way)
    beneath = list(_boxes(line))
    labels.place("home", "home", (home[0], home[1] + 18), avoid=beneath)
    for (x, y), numbers in stops.items():
        labels.place(_numbers(numbers), "stop", (x + 14, y - 12), avoid=beneath)
    unlabelled = label_zones(on, labels, zones, beneath)
    return ZoneMap(
        title=title,
        policy=site.policy,
        width=on.width,
        height=on.height,
        matrix=on.matrix,
        outlines=tuple(_outlined(on, zone) for zone in by_size(zones)),
        home=home,
        home_radius=site.home_within * on.scale,
        ways=(" ".join(f"{number(x)},{number(y)}" for x, y in line),) if line else (),
        stops=tuple(stops),
        labels=tuple(labels.placed),
        bar=bar,
        unlabelled=unlabelled,
        around=tuple(zone.name for zone in zones if fills(on, zone.ground)),
        on=on,
    )


def _outlined(on: Canvas, zone: ZoneView) -> DrawnZone:
    kind = "derived" if zone.derived else zone.use or "other"
    said = {"allowed": "the airspace is inside of it", "forbidden": "the airspace is outside of it"}.get(zone.use, "")
    words = ", ".join(
        part for part in (zone.name, zone.shape.replace("`", ""), zone.band.replace("`", ""), said) if part
    )
    lines = hatching(box_of(on, zone.ground), on.width, on.height) if kind == "forbidden" else ""
    return DrawnZone(kind, words, path(zone.ground), lines)


def _line(on: Canvas, site: Site, way: PlannedWay) -> list[tuple[float, float]]:
    return [on.at(*place) for place in (site.home, *(place for step in way.steps for place in step.path))]


def _boxes(line: Sequence[tuple[float, float]]) -> Iterator[LabelBox]:
    """Small boxes along a path, which labels avoid."""
    for (ax, ay), (bx, by) in pairwise(line):
        count = int(max(abs(bx - ax), abs(by - ay)) / 6) + 1
        for part in range(count + 1):
            yield LabelBox(ax + (bx - ax) * part / count - 2, ay + (by - ay) * part / count - 2, 4, 4)


def _stops(on: Canvas, way: PlannedWay | None) -> dict[tuple[float, float], list[int]]:
    """The places where steps end, with their numbers. A step without a path ends where the previous one did."""
    found: dict[tuple[float, float], list[int]] = {}
    at: tuple[int, int] | None = None
    for step in () if way is None else way.steps:
        at = step.path[-1] if step.path else at
        x, y = on.at(*(at or (0, 0)))
        near = next((stop for stop in found if abs(stop[0] - x) + abs(stop[1] - y) < 8), (x, y))
        found.setdefault(near, []).append(step.number)
    return found


def _numbers(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers))


def _bar(on: Canvas) -> tuple[float, str]:
    """A round length of at most a fifth of the drawing: 1, 2 or 5 times a power of ten."""
    most = on.width / 5 / on.scale
    length = max((step for step in ROUND if step <= most), default=1)
    return length * on.scale, display(length, Dimension.LENGTH)
