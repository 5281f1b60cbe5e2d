"""How a part of the local plane lies on a drawing, and numbers as SVG has them.

Here are the only floats of the handbook: they say where on the page something is drawn, and decide nothing.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from math import isqrt

from rtshcua.ground.report.model import Ground

#: px
WIDTH, LEAST_HEIGHT, MOST_HEIGHT, MARGIN = 880, 300, 640, 34
#: round lengths, mm: 1, 2 and 5 of the powers of ten
ROUND = tuple(step * power for power in (10**3, 10**4, 10**5, 10**6, 10**7, 10**8, 10**9) for step in (1, 2, 5))
#: mm; nothing smaller fills a drawing
LEAST_EXTENT = 20_000


@dataclass(frozen=True, slots=True)
class Extent:
    """West, south, east and north, in mm of the local plane."""

    west: int
    south: int
    east: int
    north: int

    def around(self, other: "Extent") -> "Extent":
        """What holds both."""
        return Extent(
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
    """A scale in px per mm, the size of the drawing, and where home would be on it."""

    scale: float
    width: int
    height: int
    x0: float
    y0: float

    def at(self, x: int, y: int) -> tuple[float, float]:
        """Where a place lies on the page."""
        return self.x0 + x * self.scale, self.y0 - y * self.scale

    def place(self, x: float, y: float) -> tuple[int, int]:
        """The place that lies somewhere on the page."""
        return round((x - self.x0) / self.scale), round((self.y0 - y) / self.scale)

    @property
    def matrix(self) -> str:
        """From millimetres, y to the south, to the page."""
        return f"matrix({self.scale:.9g} 0 0 {self.scale:.9g} {number(self.x0)} {number(self.y0)})"


def canvas(extent: Extent) -> Canvas:
    """The drawing that shows an extent whole, with a margin around it."""
    across = max(extent.east - extent.west, LEAST_EXTENT)
    along = max(extent.north - extent.south, LEAST_EXTENT)
    scale = min((WIDTH - 2 * MARGIN) / across, (MOST_HEIGHT - 2 * MARGIN) / along)
    height = max(LEAST_HEIGHT, round(along * scale) + 2 * MARGIN)
    middle = (extent.west + extent.east) / 2, (extent.south + extent.north) / 2
    return Canvas(scale, WIDTH, height, WIDTH / 2 - middle[0] * scale, height / 2 + middle[1] * scale)


def number(value: float) -> str:
    """A number on the page, to a hundredth of a pixel."""
    text = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def extent_of(ground: Ground) -> Extent:
    """What an outline reaches over."""
    if ground.centre is not None:
        (x, y), r = ground.centre, radius(ground)
        return Extent(x - r, y - r, x + r, y + r)
    return extent_of_places(corner for ring in ground.rings for corner in ring)


def extent_of_places(places: Iterable[tuple[int, int]]) -> Extent:
    """What places reach over; there is at least one."""
    xs, ys = zip(*places, strict=True)
    return Extent(min(xs), min(ys), max(xs), max(ys))


def radius(ground: Ground) -> int:
    """The radius of a circle, mm; whole, for it is declared so."""
    return isqrt(ground.radius_squared)


def path(ground: Ground) -> str:
    """The outline as the `d` of an SVG path, in mm, y to the south; a circle as two arcs."""
    if ground.centre is not None:
        (x, y), r = ground.centre, radius(ground)
        return f"M{x - r} {-y}A{r} {r} 0 1 0 {x + r} {-y}A{r} {r} 0 1 0 {x - r} {-y}Z"
    return "".join("M" + "L".join(f"{x} {-y}" for x, y in ring) + "Z" for ring in ground.rings)


def contains(ground: Ground, x: int, y: int) -> bool:
    """Whether a place lies inside of an outline, by the parity of what a ray to the east crosses."""
    if ground.centre is not None:
        return (x - ground.centre[0]) ** 2 + (y - ground.centre[1]) ** 2 < ground.radius_squared
    odd = False
    for ring in ground.rings:
        for (ax, ay), (bx, by) in zip(ring, (*ring[1:], ring[0]), strict=True):
            if (ay > y) != (by > y) and ((bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0) == (by > ay):
                odd = not odd
    return odd
