"""A small map in braille dots: home, the places of the mission, the way flown, and the vehicle."""

from collections.abc import Iterable, Sequence

#: dots a character: two wide, four high; their bits in U+2800
_WIDE, _HIGH = 2, 4
_BITS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
_LEAST_MM = 40_000  # the map never shows less than this, so that noise on the ground is no journey

Point = tuple[int, int]


def chart(track: Sequence[Point], path: Sequence[Point], here: Point | None, columns: int, rows: int) -> list[str]:
    """Lines of the map, north up, x and y to the same scale; points are x (east), y (north) in mm from home.

    `H` is home, `o` a place of the mission, `X` the vehicle.
    """
    points = [(0, 0), *track, *path, *([here] if here else [])]
    west, east = min(x for x, _ in points), max(x for x, _ in points)
    south, north = min(y for _, y in points), max(y for _, y in points)
    # A character is about twice as high as wide, so its dots are about square.
    wide, high = columns * _WIDE, rows * _HIGH
    scale = max((east - west) / (wide - 1), (north - south) / (high - 1), _LEAST_MM / wide)

    def dot(point: Point) -> tuple[int, int]:
        column = wide / 2 + (point[0] - (west + east) / 2) / scale
        row = high / 2 - (point[1] - (south + north) / 2) / scale
        return min(max(int(column), 0), wide - 1), min(max(int(row), 0), high - 1)

    cells = [[0] * columns for _ in range(rows)]
    for x, y in map(dot, track):
        cells[y // _HIGH][x // _WIDE] |= _BITS[y % _HIGH][x % _WIDE]
    canvas = [[chr(0x2800 | bits) if bits else " " for bits in row] for row in cells]
    for letter, marked in (("o", path), ("H", [(0, 0)]), ("X", [here] if here else [])):
        _mark(canvas, letter, map(dot, marked))
    return ["".join(row) for row in canvas]


def _mark(canvas: list[list[str]], letter: str, dots: Iterable[tuple[int, int]]) -> None:
    for x, y in dots:
        canvas[y // _HIGH][x // _WIDE] = letter
