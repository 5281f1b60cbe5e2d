"""Places for labels such that none lies over another, nor over what is reserved."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

#: px: a line of text, the width of a letter, and what is kept free around a box
LINE, LETTER, GAP = 16, 7.3, 2
_STEP, _FARTHEST = 9, 420
#: points on a circle, written out so that every machine has the same
_CIRCLE = (
    (0.0, -1.0), (0.0, 1.0), (1.0, 0.0), (-1.0, 0.0), (0.71, -0.71), (-0.71, -0.71), (0.71, 0.71), (-0.71, 0.71),
    (0.38, -0.92), (-0.38, -0.92), (0.38, 0.92), (-0.38, 0.92), (0.92, -0.38), (-0.92, -0.38), (0.92, 0.38),
    (-0.92, 0.38),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle on the page."""

    x: float
    y: float
    width: float
    height: float

    def meets(self, other: "Box") -> bool:
        """Whether both share a place, or come nearer than the gap."""
        return (
            self.x < other.x + other.width + GAP
            and other.x < self.x + self.width + GAP
            and self.y < other.y + other.height + GAP
            and other.y < self.y + self.height + GAP
        )

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
        """The point of the box that is nearest to one of the page."""
        return min(max(x, self.x), self.x + self.width), min(max(y, self.y), self.y + self.height)


@dataclass(frozen=True, slots=True)
class Label:
    """A text in its box, and a line to what it is about where that is not plain."""

    text: str
    kind: str
    box: Box
    leader: tuple[float, float, float, float] | None


@dataclass(slots=True)
class Labels:
    """Gives out places on a page of some size."""

    width: int
    height: int
    taken: list[Box] = field(default_factory=list)
    placed: list[Label] = field(default_factory=list)

    def reserve(self, box: Box) -> None:
        """Keep something free."""
        self.taken.append(box)

    def place(
        self,
        text: str,
        kind: str,
        anchor: tuple[float, float],
        own: Callable[[float, float], bool] | None = None,
        avoid: Sequence[Box] = (),
    ) -> bool:
        """Put a label near its anchor; false where there is no room for it.

        `own` says what belongs to what the label is about: a label lies in that, or else beside it with a line to its
        edge. `avoid` is kept free too, and the edge is not crossed, as long as there is another place.
        """
        width = LETTER * len(text) + 6
        for kept, strict in (((*self.taken, *avoid), True), ((*self.taken, *avoid), False), (self.taken, False)):
            for x, y in _around(*anchor):
                box = Box(x - width / 2, y - LINE / 2, width, LINE)
                if not self._fits(box) or any(box.meets(other) for other in kept):
                    continue
                if strict and own is not None and len({own(*point) for point in box.points()}) > 1:
                    continue
                self.placed.append(Label(text, kind, box, _leader(box, anchor, own)))
                self.taken.append(box)
                return True
        return False

    def _fits(self, box: Box) -> bool:
        return (
            box.x >= GAP
            and box.y >= GAP
            and box.x + box.width <= self.width - GAP
            and box.y + box.height <= self.height - GAP
        )


def _leader(
    box: Box, anchor: tuple[float, float], own: Callable[[float, float], bool] | None
) -> tuple[float, float, float, float] | None:
    """From the label to the edge of what it is about; none where it lies in that, or next to it."""
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


def _around(x: float, y: float) -> Iterator[tuple[float, float]]:
    """Points on growing circles around a point, from the point itself on."""
    yield x, y
    for ring in range(1, _FARTHEST // _STEP):
        for across, down in _CIRCLE:
            yield x + 1.6 * ring * _STEP * across, y + ring * _STEP * down
