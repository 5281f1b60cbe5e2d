"""Where the names of zones stand on a map: in the zone, or beside it with a line to its edge."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from rtshcua.ground.report.drawing.canvas import Canvas, contains, extent_of
from rtshcua.ground.report.drawing.labels import Box, Labels
from rtshcua.ground.report.model import Ground, ZoneTold

#: a zone below this size on the page is kept free of other zones' labels, px
_SMALL = 130
#: a zone that fills so much of the drawing is labelled at its edge
_LARGE = 0.45
#: of more zones than these, and of those alone that a detail shows, nobody could read the labels
MOST_LABELS = 60
#: by so many corners of a zone its label is placed
_CORNERS = 200


def by_size(zones: Sequence[ZoneTold]) -> list[ZoneTold]:
    """The largest first, so that the others lie over it; what is forbidden over all."""
    return sorted(zones, key=lambda zone: (zone.use == "forbidden", -extent_of(zone.ground).size))


def label_zones(on: Canvas, labels: Labels, zones: Sequence[ZoneTold], beneath: Sequence[Box]) -> tuple[str, ...]:
    """Labels for the zones that are seen, the smallest first, for it has the least room."""
    boxes = {zone.name: box_of(on, zone.ground) for zone in zones}
    small = {name: box for name, box in boxes.items() if max(box.width, box.height) < _SMALL}
    lost = []
    for zone in reversed(by_size(zones)):
        box = boxes[zone.name]
        seen = box.x < on.width and box.x + box.width > 0 and box.y < on.height and box.y + box.height > 0
        if not seen or fills(on, zone.ground):
            continue
        others = [*beneath, *(other for name, other in small.items() if name != zone.name)]
        ground = _thinned(zone.ground)
        anchor = _anchor(on, ground, box)
        kind = "derived" if zone.derived else zone.use or "other"

        def own(x: float, y: float, ground: Ground = ground) -> bool:
            return contains(ground, *on.place(x, y))

        if len(labels.placed) >= MOST_LABELS or not labels.place(_short(zone), kind, anchor, own, others):
            lost.append(zone.name)
    return tuple(lost)


def _thinned(ground: Ground) -> Ground:
    """An outline with fewer corners, where it has very many: good enough to say where a label goes."""
    step = sum(map(len, ground.rings)) // _CORNERS + 1
    return replace(ground, rings=tuple(ring[::step] if len(ring) > 3 * step else ring for ring in ground.rings))


def _short(zone: ZoneTold) -> str:
    """What a zone is called on a map: `school + 20 m` for one that a rule grows."""
    if not zone.derived:
        return zone.name
    base, _, margin = zone.name.removeprefix("grow(").removesuffix(")").partition(", ")
    return f"{base} {'-' if margin.startswith('-') else '+'} {margin.removeprefix('-')}"


def fills(on: Canvas, ground: Ground) -> bool:
    """Whether no edge of a zone is seen, for the whole map lies in it."""
    ground = _thinned(ground)
    across = [on.width * part / 16 for part in range(17)]
    down = [on.height * part / 16 for part in range(17)]
    edge = [(x, y) for x in across for y in (0, on.height)] + [(x, y) for y in down for x in (0, on.width)]
    return all(contains(ground, *on.place(x, y)) for x, y in edge)


def box_of(on: Canvas, ground: Ground) -> Box:
    """What an outline fills of the page."""
    extent = extent_of(ground)
    x, y = on.at(extent.west, extent.north)
    return Box(x, y, (extent.east - extent.west) * on.scale, (extent.north - extent.south) * on.scale)


def _anchor(on: Canvas, ground: Ground, box: Box) -> tuple[float, float]:
    """A point inside of the outline, and on the page: in its middle, or at its northern edge if it is large."""
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


def _chords(ground: Ground, y: int) -> Iterator[tuple[int, int]]:
    """From where to where the line at some height lies inside of the outline."""
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
