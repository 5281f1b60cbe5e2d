"""Zones of the local plane while they are compiled: circles by their radius, polygons by their corners, in mm."""

from dataclasses import dataclass

from rtshcua.model.flat.zone import CIRCLE, POLYGON, Zone

Point = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Disc:
    """All points nearer to `center` than `radius`."""

    center: Point
    radius: int


@dataclass(frozen=True, slots=True)
class Outline:
    """The inside of a simple polygon, counter-clockwise."""

    corners: tuple[Point, ...]


Shape = Disc | Outline


@dataclass(frozen=True, slots=True)
class Region:
    """A shape with its floor and ceiling, in mm above home."""

    shape: Shape
    floor: int
    ceiling: int

    def flat(self, name: str) -> Zone:
        """The region as it is carried on board."""
        shape = self.shape
        if isinstance(shape, Disc):
            data = (*shape.center, shape.radius * shape.radius)
            return Zone(name, CIRCLE, self.floor, self.ceiling, data)
        return Zone(name, POLYGON, self.floor, self.ceiling, tuple(c for corner in shape.corners for c in corner))


def edges(outline: Outline) -> list[tuple[Point, Point]]:
    """The edges of an outline, from each corner to the next."""
    corners = outline.corners
    return list(zip(corners, (*corners[1:], corners[0]), strict=True))


def bounds(shape: Shape) -> tuple[int, int, int, int]:
    """West, south, east, north."""
    if isinstance(shape, Disc):
        (x, y), r = shape.center, shape.radius
        return x - r, y - r, x + r, y + r
    xs, ys = zip(*shape.corners, strict=True)
    return min(xs), min(ys), max(xs), max(ys)
