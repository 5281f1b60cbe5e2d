"""A small map in braille dots: zones, home, the places of the mission, the way flown, the way home, and the vehicle."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

from rtshcua.app.fly.story import Area

#: dots a character: two wide, four high; their bits in U+2800
_WIDE, _HIGH = 2, 4
_BITS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
_LEAST_MM = 40_000  # the map never shows less than this, so that noise on the ground is no journey
_MOST_LARGER: Final = 3  # a zone this many times as large as what is flown is not shown whole
_DASH: Final = 3  # every so many dots of the way home are drawn

#: what a cell shows, of several things the last
FENCE, ZONE, KEEP_OUT, HOMEWARD, FLOWN, MARK = "fence", "zone", "keep-out", "way home", "flown", "mark"
_LAYERS: Final = (ZONE, FENCE, KEEP_OUT, HOMEWARD, FLOWN)

Point = tuple[int, int]
Dot = tuple[int, int]


class Cell(NamedTuple):
    """A character, and what it shows (empty: nothing)."""

    letter: str
    shows: str


class Chart(NamedTuple):
    """The map's rows of cells, and how many metres its scale bar of so many columns stands for."""

    rows: list[list[Cell]]
    bar_columns: int
    bar_m: int
    beyond: bool  # whether the fence lies beyond the map on every side

    def lines(self) -> list[str]:
        """The rows as text."""
        return ["".join(cell.letter for cell in row) for row in self.rows]


class _Frame:
    """Where a point of the ground lies on the dots; north up, x and y to the same scale."""

    def __init__(self, west: int, east: int, south: int, north: int, columns: int, rows: int) -> None:
        # A character is about twice as high as wide, so its dots are about square.
        self.wide, self.high = columns * _WIDE, rows * _HIGH
        self.scale = max((east - west) / (self.wide - 2), (north - south) / (self.high - 2), _LEAST_MM / self.wide)
        self._x, self._y = (west + east) / 2, (south + north) / 2

    def place(self, point: Point) -> tuple[float, float]:
        """Where a point lies, also beyond the map."""
        return self.wide / 2 + (point[0] - self._x) / self.scale, self.high / 2 - (point[1] - self._y) / self.scale

    def dot(self, point: Point) -> Dot:
        """The dot of a point; at the edge where it lies beyond."""
        column, row = self.place(point)
        return min(max(int(column), 0), self.wide - 1), min(max(int(row), 0), self.high - 1)

    def line(self, start: Point, end: Point) -> Iterator[Dot]:
        """The dots of a line, as far as they are on the map, from its start."""
        (x0, y0), (x1, y1) = self.place(start), self.place(end)
        found = _clipped(x0, y0, x1, y1, self.wide - 1, self.high - 1)
        if found is None:
            return
        x0, y0, x1, y1 = found
        steps = max(1, int(max(abs(x1 - x0), abs(y1 - y0))))
        for step in range(steps + 1):
            yield int(x0 + (x1 - x0) * step / steps), int(y0 + (y1 - y0) * step / steps)


def chart(
    track: Sequence[Point], path: Sequence[Point], here: Point | None, columns: int, rows: int,
    areas: Sequence[Area] = (), *, homeward: bool = True,
) -> Chart:  # fmt: skip
    """The map, north up, x and y to the same scale; points are x (east), y (north) in mm from home.

    `H` is home, `o` a place of the mission, `X` the vehicle. What must not be entered is hatched. `homeward`: also the
    straight way home, which is dashed. Zones that are far larger than what is flown are cut at the map's edge.
    """
    frame = _frame([(0, 0), *track, *path, *([here] if here else [])], areas, columns, rows)
    layers: dict[str, set[Dot]] = {layer: set() for layer in _LAYERS}
    for area in areas:
        layer = {"inside": FENCE, "outside": KEEP_OUT}.get(area.kind, ZONE)
        for ring in area.rings:
            corners = list(zip(ring[::2], ring[1::2], strict=True))
            for start, end in pairwise((*corners, corners[0])):
                layers[layer].update(frame.line(start, end))
        if layer is KEEP_OUT:
            layers[layer].update(_hatch(area, frame))
    if here is not None and homeward:
        layers[HOMEWARD].update(dot for number, dot in enumerate(frame.line(here, (0, 0))) if number % _DASH == 0)
    layers[FLOWN].update(map(frame.dot, track))
    canvas = _drawn(layers, columns, rows)
    for letter, marked in (("o", path), ("H", [(0, 0)]), ("X", [here] if here else [])):
        for x, y in map(frame.dot, marked):
            canvas[y // _HIGH][x // _WIDE] = Cell(letter, MARK)
    bar_m = _round_length(frame.scale * frame.wide / 3 / 1_000)
    beyond = any(area.kind == "inside" for area in areas) and not layers[FENCE]
    return Chart(canvas, max(1, round(bar_m * 1_000 / frame.scale / _WIDE)), bar_m, beyond)


def _frame(points: Sequence[Point], areas: Sequence[Area], columns: int, rows: int) -> _Frame:
    """All points are on it, and every zone that does not make it much larger."""
    box = _box(points)
    most = _MOST_LARGER * max(box[1] - box[0], box[3] - box[2], _LEAST_MM)
    for area in areas:
        corners = [corner for ring in area.rings for corner in zip(ring[::2], ring[1::2], strict=True)]
        wider = _box([(box[0], box[2]), (box[1], box[3]), *corners])
        if max(wider[1] - wider[0], wider[3] - wider[2]) <= most:
            box = wider
    return _Frame(*box, columns, rows)


def _box(points: Sequence[Point]) -> tuple[int, int, int, int]:
    """West, east, south and north of them all."""
    xs, ys = [x for x, _ in points], [y for _, y in points]
    return min(xs), max(xs), min(ys), max(ys)


def _clipped(
    x0: float, y0: float, x1: float, y1: float, wide: float, high: float
) -> tuple[float, float, float, float] | None:
    """The part of a line within 0 to `wide` and 0 to `high` (Liang and Barsky, 1984); None where there is none."""
    first, last = 0.0, 1.0
    for toward, room in ((x0 - x1, x0), (x1 - x0, wide - x0), (y0 - y1, y0), (y1 - y0, high - y0)):
        if toward == 0:
            if room < 0:
                return None
        elif toward < 0:
            first = max(first, room / toward)
        else:
            last = min(last, room / toward)
    if first > last:
        return None
    return x0 + first * (x1 - x0), y0 + first * (y1 - y0), x0 + last * (x1 - x0), y0 + last * (y1 - y0)


def _hatch(area: Area, frame: _Frame) -> Iterator[Dot]:
    """Some of the dots within a zone: those on diagonals."""
    edges = []
    for ring in area.rings:
        corners = [frame.place(corner) for corner in zip(ring[::2], ring[1::2], strict=True)]
        edges += [*pairwise((*corners, corners[0]))]
    for row in range(frame.high):
        middle = row + 0.5
        crossed = sorted(
            x0 + (middle - y0) / (y1 - y0) * (x1 - x0)
            for (x0, y0), (x1, y1) in edges
            if (y0 <= middle) is not (y1 <= middle)
        )
        for start, end in zip(crossed[::2], crossed[1::2], strict=True):
            for column in range(max(0, int(start) + 1), min(frame.wide, int(end) + 1)):
                if (column + row) % 4 == 0:
                    yield column, row


def _drawn(layers: dict[str, set[Dot]], columns: int, rows: int) -> list[list[Cell]]:
    bits = [[0] * columns for _ in range(rows)]
    shows = [[""] * columns for _ in range(rows)]
    for layer in _LAYERS:
        for x, y in _within(layers[layer], columns * _WIDE, rows * _HIGH):
            bits[y // _HIGH][x // _WIDE] |= _BITS[y % _HIGH][x % _WIDE]
            shows[y // _HIGH][x // _WIDE] = layer
    return [
        [Cell(chr(0x2800 | dots) if dots else " ", what) for dots, what in zip(*row, strict=True)]
        for row in zip(bits, shows, strict=True)
    ]


def _within(dots: Iterable[Dot], wide: int, high: int) -> Iterator[Dot]:
    return ((x, y) for x, y in dots if 0 <= x < wide and 0 <= y < high)


def _round_length(most_m: float) -> int:
    """The largest of 1, 2, 5, 10, 20, 50, ... m that is no more."""
    power = 1
    while power * 10 <= most_m:
        power *= 10
    return next((each * power for each in (5, 2) if each * power <= most_m), power)
