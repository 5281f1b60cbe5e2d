"""A side view: heights above home along a planned way, or in the time of a flight, with the zones that lie there."""

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from math import hypot, sqrt
from types import MappingProxyType
from typing import Final, NamedTuple

from rtshcua.ground.drawing.canvas import (
    LETTER,
    LINE,
    ROUND,
    WIDTH,
    DrawnExtent,
    LabelBox,
    Labels,
    MapLabel,
    contains,
    extent_of,
    hatching,
    told_distance,
)
from rtshcua.ground.drawing.drawn_site import (
    EVENTS,
    NOT_REFUSED,
    FlownWay,
    LeftAirspace,
    PlannedLeg,
    PlannedWay,
    RefusedParts,
    Site,
    ZoneOutline,
    ZoneView,
    planned_legs,
)
from rtshcua.ground.drawing.flat_site import told_band
from rtshcua.ground.drawing.time_charts import clock
from rtshcua.ground.drawing.zone_map import (
    AT_TIMES,
    ZONE_KEYS,
    DrawingKey,
    DrawnMark,
    boxes_along,
    by_size,
    gather,
    joined,
    points,
    told_numbers,
)
from rtshcua.model.quantity import Dimension, display

#: px: the plot, what stands around it, and how far the first and the last place are inside of it
_PLOT, _TOP, _LEFT, _RIGHT, _BOTTOM, _INSET = 250, 30, 66, 16, 44, 26
#: mm: heights that are never cut off
_LEAST_HEIGHT: Final = 10_000
#: limits of zones are shown up to this multiple of the greatest height of the flight; labels tell the higher ones
_LIMITS: Final = 3
#: px: the least width of a band
_THIN: Final = 2.0
#: the most places of a track whose zones are computed, and the most points that keep labels away
_PLACES, _TRACK = 1_000, 500
#: round times, us
_TIMES: Final = tuple(
    each * 1_000_000 for each in (1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 18_000, 36_000, 86_400)
)
#: us
_SECOND = 1_000_000


class ZoneBand(NamedTuple):
    """Where the way is over a zone: its box on the page, its title, and hatching."""

    kind: str
    box: LabelBox
    hatch: str
    title: str


class AxisMark(NamedTuple):
    """A mark of an axis: its place on the page, and its text; `other` is the text on the opposite axis."""

    at: float
    told: str
    other: str = ""


@dataclass(frozen=True, slots=True)
class HeightProfile:
    """A side view. `above` are the titles of the axes of heights (the second is empty where the elevation of home is
    not known), and `along` that of the other axis. `volume` (the `d` of a path) are the heights between which a leg
    is checked, `ground` the lines of the ground where it is known, and `home` the height of home. `span` are the places
    on the page of the begin and of the end of the other axis, and how long that is: in us if it is `timed`, else in mm.
    """

    title: str
    description: str
    policy: str
    width: int
    height: int
    plot: LabelBox
    above: tuple[str, str]
    along: str
    heights: tuple[AxisMark, ...]
    across: tuple[AxisMark, ...]
    bands: tuple[ZoneBand, ...]
    volume: str
    ground: tuple[str, ...]
    home: float
    returns: float | None
    ways: tuple[str, ...]
    failed: tuple[str, ...]
    flown: tuple[str, ...]
    later: tuple[str, ...]
    stops: tuple[tuple[float, float], ...]
    marks: tuple[DrawnMark, ...]
    labels: tuple[MapLabel, ...]
    keys: tuple[DrawingKey, ...]
    unlabelled: tuple[str, ...]
    span: tuple[float, float, int]
    timed: bool


class _Place(NamedTuple):
    """A place at a distance (mm) or a time (us) along the axis; `ground` is the height of the ground, if known."""

    along: int
    x: int
    y: int
    height: int
    ground: int | None = None


class _ZonePart(NamedTuple):
    """A zone over a part of the axis."""

    zone: ZoneView
    begin: float
    end: float


class _Axes(NamedTuple):
    """The scales of a side view. `end` is the end of the way (mm or us), `last` the same, but more than 0."""

    plot: LabelBox
    end: int
    last: int
    lowest: int
    highest: int

    def x(self, along: float) -> float:
        """The place on the page of a distance or a time."""
        return self.plot.x + _INSET + (self.plot.width - 2 * _INSET) * along / self.last

    def y(self, height: float) -> float:
        """The place on the page of a height, at the edge of the plot where it is beyond."""
        share = (height - self.lowest) / (self.highest - self.lowest)
        return self.plot.y + self.plot.height * (1 - min(max(share, 0.0), 1.0))

    def point(self, along: float, height: float) -> tuple[float, float]:
        """A point on the page."""
        return self.x(along), self.y(height)


class _DrawnHeights(NamedTuple):
    """What is drawn of a way; `lines` keep labels away, `levels` are heights to be labelled with a point each."""

    lines: tuple[Sequence[tuple[float, float]], ...] = ()
    levels: tuple[tuple[int, tuple[float, float]], ...] = ()
    volume: str = ""
    ways: tuple[str, ...] = ()
    failed: tuple[str, ...] = ()
    flown: tuple[str, ...] = ()
    later: tuple[str, ...] = ()
    ground: tuple[str, ...] = ()
    stops: Mapping[tuple[float, float], Sequence[int]] = MappingProxyType({})
    marks: tuple[DrawnMark, ...] = ()


class _Titles(NamedTuple):
    """The title and the description of a side view, and the title of its axis along the way, which may be of times."""

    title: str
    description: str
    along: str
    timed: bool = False


def planned_heights(site: Site, way: PlannedWay, refused: RefusedParts = NOT_REFUSED) -> HeightProfile:
    """The side view of a planned way: heights over the distance along it. Climbs and descents are upright."""
    legs = tuple(planned_legs(way, site))
    line = [_Place(0, *site.home, 0)]
    for leg in legs:
        length = round(hypot(leg.end.x - leg.begin.x, leg.end.y - leg.begin.y))
        line.append(_Place(line[-1].along + length, *leg.end))
    parts = tuple(_zone_parts(site, [line]))
    axes = _axes(site, line, parts)
    step = _round(axes.last, ROUND)
    across = [AxisMark(axes.x(at), told_distance(at)) for at in range(0, line[-1].along + 1, step)]
    highest = _told(max(place.height for place in line))
    return _profile(
        site,
        axes,
        parts,
        _planned(axes, way, legs, line, refused),
        _Titles(
            f"Heights along the way of {way.name}",
            f"A side view: heights above home over the distance along the planned way, up to {highest}.",
            "distance along the way",
        ),
        across,
    )


def flown_heights(site: Site, flown: FlownWay) -> HeightProfile:
    """The side view of a flown track: heights over the time since the flight began, and the marks of the flight."""
    lines = [
        [_Place(each.t_us, each.x, each.y, each.height, each.ground) for each in part]
        for part in (*flown.parts, *flown.later)
    ]
    everything = [place for line in lines for place in line] or [_Place(0, *site.home, 0)]
    last = max([place.along for place in everything] + [mark.t_us for mark in flown.marks])
    parts = tuple(_zone_parts(site, map(_thinned, lines)))
    axes = _axes(site, [*everything, everything[-1]._replace(along=last)], parts)
    across = [AxisMark(axes.x(at), clock(at // _SECOND)) for at in range(0, last + 1, _round(axes.last, _TIMES))]
    highest = _told(max(place.height for place in everything))
    return _profile(
        site,
        axes,
        parts,
        _flown(axes, lines, everything, flown),
        _Titles(
            "Heights of the flown track",
            f"A side view: heights above home over the time of the flight, up to {highest}.",
            "time since the flight began",
            timed=True,
        ),
        across,
    )


def _flown(
    axes: _Axes, lines: Sequence[Sequence[_Place]], everything: Sequence[_Place], flown: FlownWay
) -> _DrawnHeights:
    tracks = [[axes.point(place.along, place.height) for place in line] for line in lines]
    return _DrawnHeights(
        lines=tuple(line[:: len(line) // _TRACK + 1] for line in tracks),
        flown=tuple(map(points, tracks[: len(flown.parts)])),
        later=tuple(map(points, tracks[len(flown.parts) :])),
        ground=tuple(
            points([axes.point(place.along, place.ground or 0) for place in some])
            for line in lines
            for known, some in groupby(line, key=lambda place: place.ground is not None)
            if known
        ),
        marks=tuple(
            DrawnMark(*axes.point(mark.t_us, _height_at(everything, mark.t_us)), mark.kind, mark.label)
            for mark in flown.marks
        ),
    )


def _thinned(line: Sequence[_Place]) -> Sequence[_Place]:
    step = len(line) // _PLACES + 1
    return line if step == 1 else [*line[::step], line[-1]]


def _height_at(places: Sequence[_Place], t_us: int) -> int:
    """The height at the latest place until a time, or at the first one; the places are in the order of their times."""
    return places[max(bisect_right(places, t_us, key=lambda place: place.along) - 1, 0)].height


def _planned(
    axes: _Axes, way: PlannedWay, legs: Sequence[PlannedLeg], line: Sequence[_Place], refused: RefusedParts
) -> _DrawnHeights:
    drawn = [axes.point(place.along, place.height) for place in line]
    volume, levels = "", dict[int, tuple[float, tuple[float, float]]]()
    failed: dict[int, list[tuple[float, float]]] = {}
    ends: dict[int, tuple[float, float]] = {}
    marks: list[DrawnMark] = []
    for leg, (begin, end) in zip(legs, pairwise(drawn), strict=True):
        ends[leg.step.number] = end
        width = end[0] - begin[0]
        if leg.low < leg.high and width > 0:
            volume += f"{joined([(begin[0], axes.y(leg.low)), (end[0], axes.y(leg.low))])}V{axes.y(leg.high):.2f}"
            volume += f"H{begin[0]:.2f}Z"
        if leg.end.height:
            levels.setdefault(leg.end.height, (0.0, end))
        if leg.begin.height == leg.end.height and width > levels.get(leg.end.height, (0.0,))[0]:
            levels[leg.end.height] = (width, ((begin[0] + end[0]) / 2, end[1]))
        if leg.step.number in refused.steps:
            failed.setdefault(leg.step.number, [begin]).append(end)
    for each in refused.left:
        at = _along(each, legs, line)
        if at is not None:
            marks.append(DrawnMark(*axes.point(*at), "left", f"step {each.number} leaves the airspace"))
    stops: dict[tuple[float, float], list[int]] = {}
    at_end = drawn[0]
    for step in way.steps:
        at_end = ends.get(step.number, at_end)
        gather(stops, at_end, step.number)
    return _DrawnHeights(
        lines=(drawn,),
        levels=tuple((height, point) for height, (_, point) in levels.items()),
        volume=volume,
        ways=(points(drawn),),
        failed=tuple(map(points, failed.values())),
        stops=stops,
        marks=tuple(marks),
    )


def _along(left: LeftAirspace, legs: Sequence[PlannedLeg], line: Sequence[_Place]) -> tuple[float, float] | None:
    """The distance along the way and the height of a place of a step: on the leg that comes nearest to it."""
    found = []
    for leg, (begin, end) in zip(legs, pairwise(line), strict=True):
        if leg.step.number == left.number:
            x, y, length = leg.end.x - leg.begin.x, leg.end.y - leg.begin.y, end.along - begin.along
            part = 0.0 if not length else ((left.x - leg.begin.x) * x + (left.y - leg.begin.y) * y) / length**2
            part = min(max(part, 0.0), 1.0)
            away = hypot(leg.begin.x + x * part - left.x, leg.begin.y + y * part - left.y)
            found.append(
                (away, begin.along + length * part, leg.begin.height + (leg.end.height - leg.begin.height) * part)
            )
    return min(found)[1:] if found else None


def _profile(
    site: Site,
    axes: _Axes,
    parts: Sequence[_ZonePart],
    drawn: _DrawnHeights,
    titles: _Titles,
    across: Sequence[AxisMark],
) -> HeightProfile:
    plot, returns, bands = axes.plot, site.return_altitude, tuple(_bands(axes, parts))
    labels = Labels(WIDTH, round(plot.y + plot.height))
    for box in (
        LabelBox(0, 0, plot.x, plot.y + plot.height),
        LabelBox(plot.x + plot.width, 0, WIDTH - plot.x - plot.width, plot.y + plot.height),
        LabelBox(0, 0, WIDTH, plot.y - LINE),
        *(LabelBox(x - 5, y - 5, 10, 10) for x, y in drawn.stops),
        *(LabelBox(mark.x - 7, mark.y - 7, 14, 14) for mark in drawn.marks),
    ):
        labels.reserve(box)
    unlabelled = tuple(_label(labels, axes, drawn, bands, returns))
    return HeightProfile(
        title=titles.title,
        description=titles.description,
        policy=site.policy,
        width=WIDTH,
        height=round(plot.y + plot.height + _BOTTOM),
        plot=plot,
        above=("above home", "" if site.elevation is None else "above sea"),
        along=titles.along,
        heights=tuple(_height_marks(site, axes)),
        across=tuple(across),
        bands=bands,
        volume=drawn.volume,
        ground=drawn.ground,
        home=axes.y(0),
        returns=axes.y(returns) if returns else None,
        ways=drawn.ways,
        failed=drawn.failed,
        flown=drawn.flown,
        later=drawn.later,
        stops=tuple(drawn.stops),
        marks=drawn.marks,
        labels=tuple(labels.placed),
        keys=tuple(_keys(site, drawn, bands)),
        unlabelled=unlabelled,
        span=(axes.x(0), axes.x(axes.last), axes.last),
        timed=titles.timed,
    )


def _label(labels: Labels, axes: _Axes, drawn: _DrawnHeights, bands: Sequence[ZoneBand], returns: int) -> Iterator[str]:
    """Place the labels of steps, marks, heights and zones; yield the marks and zones without room."""
    beneath = boxes_along(*drawn.lines)
    for (x, y), numbers in drawn.stops.items():
        labels.place(told_numbers(numbers), "stop", (x + 14, y - 12), avoid=beneath, subject=(x, y))
    for mark in drawn.marks:
        at = (mark.x, mark.y)
        if not labels.place(mark.title, mark.kind, (mark.x, mark.y - LINE), avoid=beneath, subject=at):
            yield mark.title
    clear = [*beneath, *_edges(bands)]
    if returns:
        words = f"return at {_told(returns)} above home"
        x = axes.plot.x + axes.plot.width - _INSET - LETTER * len(words) / 2
        labels.place(words, "returns", (x, axes.y(returns) - LINE / 2 - 2), avoid=clear, subject=(x, axes.y(returns)))
    for level, (x, y) in drawn.levels:
        if level != returns:
            labels.place(f"{_told(level)} above home", "level", (x, y - LINE / 2 - 4), avoid=clear, subject=(x, y))
    yield from _label_zones(labels, bands, clear)


def _keys(site: Site, drawn: _DrawnHeights, bands: Sequence[ZoneBand]) -> Iterator[DrawingKey]:
    """The legend."""
    seen = {each.kind for each in bands}
    yield from (DrawingKey(kind, words) for kind, words in ZONE_KEYS.items() if kind in seen)
    if drawn.ways:
        yield DrawingKey("way", "the planned heights; numbers: the steps that end there")
    if drawn.volume:
        yield DrawingKey("margin", "heights between which a leg is checked")
    if drawn.failed:
        yield DrawingKey("failed-leg", "the way of a step that is refused")
    if any(mark.kind == "left" for mark in drawn.marks):
        yield DrawingKey("failed-mark", "where it leaves the airspace first")
    if drawn.flown:
        yield DrawingKey("flown", "the flown heights")
    if drawn.later:
        yield DrawingKey("later", "the heights after the last record of the log")
    if EVENTS & {mark.kind for mark in drawn.marks}:
        yield DrawingKey("event-mark", "a decision, with the number of its record")
    if site.return_altitude:
        yield DrawingKey("returns", "the height to which a return climbs")
    yield DrawingKey("ground", "the ground below" if drawn.ground else "the height of home")


def _told(height: int) -> str:
    return display(height, Dimension.LENGTH)


def _round(span: int, steps: Sequence[int]) -> int:
    """A round interval, about an eighth of a span."""
    return next((step for step in steps if step * 8 >= span), steps[-1])


def _axes(site: Site, places: Sequence[_Place], parts: Sequence[_ZonePart]) -> _Axes:
    """The scales that show all places, and the limits of the zones that are not too far away."""
    heights = [0, _LEAST_HEIGHT, site.return_altitude, *(place.height for place in places)]
    heights += [place.ground for place in places if place.ground is not None]
    lowest, highest = min(heights), max(heights)
    limits = [limit for part in parts for limit in (part.zone.floor, part.zone.ceiling) if limit is not None]
    shown = [limit for limit in limits if lowest - highest <= limit <= _LIMITS * highest]
    lowest, highest = min([lowest, *shown]), max([highest, *shown])
    room, end = (highest - lowest) // 12, max(place.along for place in places)
    right = WIDTH - (_RIGHT if site.elevation is None else _LEFT)
    return _Axes(
        LabelBox(_LEFT, _TOP, right - _LEFT, _PLOT),
        end,
        end or 1,
        lowest - room // 2,
        highest + room,
    )


def _height_marks(site: Site, axes: _Axes) -> Iterator[AxisMark]:
    step = _round(axes.highest - axes.lowest, ROUND)
    for height in range(-(-axes.lowest // step) * step, axes.highest + 1, step):
        sea = "" if site.elevation is None else _told(height + site.elevation)
        yield AxisMark(axes.y(height), _told(height), sea)


def _bands(axes: _Axes, parts: Sequence[_ZonePart]) -> Iterator[ZoneBand]:
    """The zones as bands, the largest ones first and the forbidden ones last. At the ends of the way they continue."""
    plot = axes.plot
    order = by_size([part.zone for part in parts])
    for part in sorted(parts, key=lambda part: order.index(part.zone)):
        zone = part.zone
        left = plot.x if part.begin <= 0 else axes.x(part.begin)
        right = plot.x + plot.width if part.end >= axes.end else axes.x(part.end)
        top = plot.y if zone.ceiling is None else axes.y(zone.ceiling)
        bottom = plot.y + plot.height if zone.floor is None else axes.y(zone.floor)
        box = LabelBox(left, top, max(right - left, _THIN), bottom - top)
        if box.height > 0:
            kind = zone.use or "other"
            hatch = hatching(box, WIDTH, plot.y + plot.height) if kind == "forbidden" else ""
            name = zone.name + AT_TIMES * zone.timed
            yield ZoneBand(kind, box, hatch, f"{name}: {told_band(zone.floor, zone.ceiling)}")


def _edges(bands: Iterable[ZoneBand]) -> Iterator[LabelBox]:
    """The lower and upper edges of bands, through which no other label goes."""
    for box in dict.fromkeys(each.box for each in bands):
        yield LabelBox(box.x, box.y - 1, box.width, 2)
        yield LabelBox(box.x, box.y + box.height - 1, box.width, 2)


def _label_zones(labels: Labels, bands: Sequence[ZoneBand], beneath: Sequence[LabelBox]) -> Iterator[str]:
    """Label each zone at its widest band, the narrowest first; yield those without room."""
    widest: dict[str, LabelBox] = {}
    for band in bands:
        if band.title not in widest or band.box.width > widest[band.title].width:
            widest[band.title] = band.box
    kinds = {band.title: band.kind for band in bands}
    for title, box in sorted(widest.items(), key=lambda item: item[1].width * item[1].height):

        def own(x: float, y: float, box: LabelBox = box) -> bool:
            return box.x <= x <= box.x + box.width and box.y <= y <= box.y + box.height

        anchor = (box.middle[0], box.y + min(LINE / 2 + 3, box.height / 2))
        if not labels.place(title, kinds[title], anchor, own, beneath):
            yield title


def _zone_parts(site: Site, lines: Iterable[Sequence[_Place]]) -> Iterator[_ZonePart]:
    """Where lines are over the declared zones, at any height; adjacent parts are joined."""
    zones = [(zone, extent_of(zone.ground)) for zone in site.zones if not zone.derived]
    ways = [list(pairwise(line)) or [(place, place) for place in line] for line in lines]
    for zone, extent in zones:
        found: list[_ZonePart] = []
        for one, other in (pair for way in ways for pair in way if _may_meet(*pair, extent)):
            length = other.along - one.along
            for first, last in inside(zone.ground, (one.x, one.y), (other.x, other.y)):
                begin, end = one.along + length * first, one.along + length * last
                if found and begin <= found[-1].end + 1:
                    found[-1] = found[-1]._replace(end=max(end, found[-1].end))
                else:
                    found.append(_ZonePart(zone, begin, end))
        yield from found


def _may_meet(one: _Place, other: _Place, extent: DrawnExtent) -> bool:
    """Whether the box of a line meets an extent."""
    across = max(one.x, other.x) >= extent.west and min(one.x, other.x) <= extent.east
    return across and max(one.y, other.y) >= extent.south and min(one.y, other.y) <= extent.north


def inside(ground: ZoneOutline, one: tuple[int, int], other: tuple[int, int]) -> Iterator[tuple[float, float]]:
    """The parts of a straight line that are inside an outline, from 0 at its beginning to 1 at its end."""
    (ax, ay), (x, y) = one, (other[0] - one[0], other[1] - one[1])
    cuts = sorted({0.0, 1.0, *(cut for cut in _crossings(ground, ax, ay, x, y) if 0 < cut < 1)})
    for first, last in pairwise(cuts):
        middle = (first + last) / 2
        if contains(ground, ax + x * middle, ay + y * middle):
            yield first, last


def _crossings(ground: ZoneOutline, ax: int, ay: int, x: int, y: int) -> Iterator[float]:
    """Where the line through a place in a direction meets the edge of an outline, in multiples of the direction."""
    if ground.centre is not None:
        dx, dy = ax - ground.centre[0], ay - ground.centre[1]
        a, b, c = x * x + y * y, dx * x + dy * y, dx * dx + dy * dy - ground.radius_squared
        if a and b * b > a * c:
            root = sqrt(b * b - a * c)
            yield from ((-b - root) / a, (-b + root) / a)
        return
    for ring in ground.rings:
        for (cx, cy), (dx, dy) in zip(ring, (*ring[1:], ring[0]), strict=True):
            across = x * (dy - cy) - y * (dx - cx)
            if across:
                yield ((cx - ax) * (dy - cy) - (cy - ay) * (dx - cx)) / across
