"""The surface of a drawing: its scale, boxes and labels that do not overlap, hatching, and numbers as SVG writes them.

Only this package uses floats: they say where on the page something is drawn, and decide nothing.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from math import isqrt
from typing import NamedTuple

from rtshcua.diagnostics.excerpt import visible
from rtshcua.ground.drawing.drawn_site import ZoneOutline
from rtshcua.model.quantity import Dimension, display

#: px
WIDTH, LEAST_HEIGHT, MOST_HEIGHT, MARGIN = 880, 300, 640, 34
#: round lengths, mm: 1, 2 and 5 of the powers of ten
ROUND = tuple(step * power for power in (10**3, 10**4, 10**5, 10**6, 10**7, 10**8, 10**9) for step in (1, 2, 5))
#: mm; nothing smaller fills a drawing
LEAST_EXTENT = 20_000


@dataclass(frozen=True, slots=True)
class DrawnExtent:
    """West, south, east and north limits, in mm of the local plane."""

    west: int
    south: int
    east: int
    north: int

    def around(self, other: "DrawnExtent") -> "DrawnExtent":
        """The smallest extent that contains both."""
        return DrawnExtent(
            min(self.west, other.west),
            min(self.south, other.south),
            max(self.east, other.east),
            max(self.north, other.north),
        )

    @property
    def size(self) -> int:
        """The longer side."""
        return max(self.east - self.west, self.north - self.south)


@dataclass(frozen=True, slots=True)
class Canvas:
    """The scale of a drawing in px per mm, its size, and the place of home on it."""

    scale: float
    width: int
    height: int
    x0: float
    y0: float

    def at(self, x: int, y: int) -> tuple[float, float]:
        """The point on the page of a place."""
        return self.x0 + x * self.scale, self.y0 - y * self.scale

    def place(self, x: float, y: float) -> tuple[int, int]:
        """The place at a point on the page."""
        return round((x - self.x0) / self.scale), round((self.y0 - y) / self.scale)

    @property
    def matrix(self) -> str:
        """The SVG transform from millimetres, y to the south, to the page."""
        return f"matrix({self.scale:.9g} 0 0 {self.scale:.9g} {number(self.x0)} {number(self.y0)})"


def canvas(extent: DrawnExtent, width: int = WIDTH) -> Canvas:
    """The canvas that shows a whole extent with a margin, `width` px wide."""
    across = max(extent.east - extent.west, LEAST_EXTENT)
    along = max(extent.north - extent.south, LEAST_EXTENT)
    scale = min((width - 2 * MARGIN) / across, (MOST_HEIGHT - 2 * MARGIN) / along)
    height = max(LEAST_HEIGHT, round(along * scale) + 2 * MARGIN)
    middle = (extent.west + extent.east) / 2, (extent.south + extent.north) / 2
    return Canvas(scale, width, height, width / 2 - middle[0] * scale, height / 2 + middle[1] * scale)


def number(value: float) -> str:
    """A number on the page, to a hundredth of a pixel."""
    text = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def told_distance(length: int) -> str:
    """A round length of a scale in words: in km from 10 km on."""
    whole, rest = divmod(length, 1_000_000)
    return display(length, Dimension.LENGTH) if rest or whole < 10 else f"{whole} km"


def extent_of(ground: ZoneOutline) -> DrawnExtent:
    """The extent of an outline."""
    if ground.centre is not None:
        (x, y), r = ground.centre, radius(ground)
        return DrawnExtent(x - r, y - r, x + r, y + r)
    return extent_of_places(corner for ring in ground.rings for corner in ring)


def extent_of_places(places: Iterable[tuple[int, int]]) -> DrawnExtent:
    """The extent of at least one place."""
    xs, ys = zip(*places, strict=True)
    return DrawnExtent(min(xs), min(ys), max(xs), max(ys))


def radius(ground: ZoneOutline) -> int:
    """The radius of a circle in mm, which is declared as a whole number."""
    return isqrt(ground.radius_squared)


def path(ground: ZoneOutline) -> str:
    """The outline as the `d` of an SVG path, in mm, y to the south; a circle as two arcs."""
    if ground.centre is not None:
        (x, y), r = ground.centre, radius(ground)
        return f"M{x - r} {-y}A{r} {r} 0 1 0 {x + r} {-y}A{r} {r} 0 1 0 {x - r} {-y}Z"
    return "".join("M" + "L".join(f"{x} {-y}" for x, y in ring) + "Z" for ring in ground.rings)


def path_on_page(on: Canvas, ground: ZoneOutline) -> str:
    """The outline as the `d` of an SVG path, in px on the page."""
    if ground.centre is not None:
        (x, y), r = on.at(*ground.centre), number(radius(ground) * on.scale)
        west, east = number(x - radius(ground) * on.scale), number(x + radius(ground) * on.scale)
        return f"M{west} {number(y)}A{r} {r} 0 1 0 {east} {number(y)}A{r} {r} 0 1 0 {west} {number(y)}Z"
    rings = ((on.at(*corner) for corner in ring) for ring in ground.rings)
    return "".join("M" + "L".join(f"{number(x)} {number(y)}" for x, y in ring) + "Z" for ring in rings)


def contains(ground: ZoneOutline, x: float, y: float) -> bool:
    """Whether a place is inside an outline, by the parity of the edges that a ray to the east crosses."""
    if ground.centre is not None:
        return (x - ground.centre[0]) ** 2 + (y - ground.centre[1]) ** 2 < ground.radius_squared
    odd = False
    for ring in ground.rings:
        for (ax, ay), (bx, by) in zip(ring, (*ring[1:], ring[0]), strict=True):
            if (ay > y) != (by > y) and ((bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0) == (by > ay):
                odd = not odd
    return odd


#: px: a line of text, the width of a letter, and what is kept free around a box
LINE, LETTER, GAP = 16, 7.3, 2
_STEP, _FARTHEST = 9, 420
#: points on a circle, written out so that every machine has the same
_CIRCLE = (
    (0.0, -1.0), (0.0, 1.0), (1.0, 0.0), (-1.0, 0.0), (0.71, -0.71), (-0.71, -0.71), (0.71, 0.71), (-0.71, 0.71),
    (0.38, -0.92), (-0.38, -0.92), (0.38, 0.92), (-0.38, 0.92), (0.92, -0.38), (-0.92, -0.38), (0.92, 0.38),
    (-0.92, 0.38),
)  # fmt: skip


class LabelBox(NamedTuple):
    """A rectangle on the page."""

    x: float
    y: float
    width: float
    height: float

    def meets_any(self, others: Sequence["LabelBox"]) -> bool:
        """Whether it overlaps one of the others, or is nearer to it than the gap."""
        left, top = self.x - GAP, self.y - GAP  # written out, as labels are tried at many places
        right, bottom = self.x + self.width + GAP, self.y + self.height + GAP
        for other in others:
            if other.x < right and left < other.x + other.width and other.y < bottom and top < other.y + other.height:
                return True
        return False

    def is_on_page(self, width: float, height: float) -> bool:
        """Whether a part of it is on a page of this size."""
        return self.x < width and self.x + self.width > 0 and self.y < height and self.y + self.height > 0

    def points(self) -> tuple[tuple[float, float], ...]:
        """Points all along its sides, and its middle."""
        right, low = self.x + self.width, self.y + self.height
        across = [self.x + self.width * part / 8 for part in range(9)]
        sides = (*((x, self.y) for x in across), *((x, low) for x in across))
        return (*sides, (self.x, self.y + self.height / 2), (right, self.y + self.height / 2), self.middle)

    @property
    def middle(self) -> tuple[float, float]:
        """The middle."""
        return self.x + self.width / 2, self.y + self.height / 2

    def nearest(self, x: float, y: float) -> tuple[float, float]:
        """The point of the box nearest to a point on the page."""
        return min(max(x, self.x), self.x + self.width), min(max(y, self.y), self.y + self.height)


@dataclass(frozen=True, slots=True)
class MapLabel:
    """A text in its box, and a line to its subject if that is not adjacent."""

    text: str
    kind: str
    box: LabelBox
    leader: tuple[float, float, float, float] | None


@dataclass(slots=True)
class Labels:
    """Places labels on a page without overlaps."""

    width: int
    height: int
    taken: list[LabelBox] = field(default_factory=list)
    placed: list[MapLabel] = field(default_factory=list)

    def reserve(self, box: LabelBox) -> None:
        """Keep a box free of labels."""
        self.taken.append(box)

    def place(
        self,
        text: str,
        kind: str,
        anchor: tuple[float, float],
        own: Callable[[float, float], bool] | None = None,
        avoid: Sequence[LabelBox] = (),
        subject: tuple[float, float] | None = None,
    ) -> bool:
        """Put a label near its anchor; false where there is no room for it.

        `subject` is the point that the label is about, if that is not the anchor. `own` says what belongs to what the
        label is about: a label lies in that, or else beside it with a line to its edge. `avoid` is kept free too, and
        the edge is not crossed, as long as there is another place.
        """
        text = visible(text)
        width = LETTER * len(text) + 6
        for kept, strict in (((*self.taken, *avoid), True), ((*self.taken, *avoid), False), (self.taken, False)):
            for x, y in _around(*anchor):
                box = LabelBox(x - width / 2, y - LINE / 2, width, LINE)
                if not self._fits(box) or box.meets_any(kept):
                    continue
                if strict and own is not None and len({own(*point) for point in box.points()}) > 1:
                    continue
                leader = _leader(box, anchor, own) if subject is None else _pointer(box, subject)
                self.placed.append(MapLabel(text, kind, box, leader))
                self.taken.append(box)
                return True
        return False

    def _fits(self, box: LabelBox) -> bool:
        return (
            box.x >= GAP
            and box.y >= GAP
            and box.x + box.width <= self.width - GAP
            and box.y + box.height <= self.height - GAP
        )


def _leader(
    box: LabelBox, anchor: tuple[float, float], own: Callable[[float, float], bool] | None
) -> tuple[float, float, float, float] | None:
    """The line from a label to the edge of its subject; None if the label is in it or next to it."""
    if own is not None and all(own(*point) for point in box.points()):
        return None
    x, y = box.nearest(*anchor)
    to_x, to_y = anchor
    if own is not None and own(*anchor):
        inside, outside = 1.0, 0.0  # as parts of the way from the label to the anchor
        for _ in range(12):
            middle = (inside + outside) / 2
            if own(x + (to_x - x) * middle, y + (to_y - y) * middle):
                inside = middle
            else:
                outside = middle
        to_x, to_y = x + (to_x - x) * inside, y + (to_y - y) * inside
    return None if abs(x - to_x) + abs(y - to_y) < LINE / 2 else (x, y, to_x, to_y)


def _pointer(box: LabelBox, subject: tuple[float, float]) -> tuple[float, float, float, float] | None:
    """The line from a label to a point; None if both are near each other."""
    x, y = box.nearest(*subject)
    return None if abs(x - subject[0]) + abs(y - subject[1]) < 2 * LINE else (x, y, *subject)


def _around(x: float, y: float) -> Iterator[tuple[float, float]]:
    """Yield a point, and then points on growing circles around it."""
    yield x, y
    for ring in range(1, _FARTHEST // _STEP):
        for across, down in _CIRCLE:
            yield x + 1.6 * ring * _STEP * across, y + ring * _STEP * down


#: px between two lines, across
_SPACING = 11


def hatching(box: LabelBox, width: float, height: float) -> str:
    """Diagonal lines over the part of a box that is on the page, as the `d` of an SVG path."""
    left, right = max(box.x, 0.0), min(box.x + box.width, width)
    top, bottom = max(box.y, 0.0), min(box.y + box.height, height)
    if left >= right or top >= bottom:
        return ""
    lines = []
    for step in range(int((left + top) // _SPACING), int((right + bottom) // _SPACING) + 1):
        total = step * _SPACING  # x + y is the same all along a line
        x0, x1 = max(left, total - bottom), min(right, total - top)
        if x0 < x1:
            lines.append(f"M{number(x0)} {number(total - x0)}L{number(x1)} {number(total - x1)}")
    return "".join(lines)
