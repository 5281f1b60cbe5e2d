"""Text positions of the protocol: lines from 0, and columns in UTF-16 or UTF-8 units or characters.

The Language Server Protocol (3.17, "Text Documents") counts UTF-16 code units unless both sides agree on another
`positionEncoding`, and ends lines with `\\n`, `\\r\\n` or `\\r`. All other code counts characters of the whole text.
"""

import re
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable
from enum import Enum
from typing import NamedTuple

_LINE_END = re.compile(r"\r\n|\n|\r")
_ASTRAL = 0xFFFF


class Encoding(Enum):
    """The unit of columns; the values are those of the protocol."""

    UTF_8 = "utf-8"
    UTF_16 = "utf-16"
    UTF_32 = "utf-32"


class TextPosition(NamedTuple):
    """A line, and a column in units of the encoding, both from 0."""

    line: int
    column: int


class TextChange(NamedTuple):
    """A replacement of the text from `start` to `end`; without a start, of the whole text."""

    start: TextPosition | None
    end: TextPosition | None
    text: str


class Edit(NamedTuple):
    """A replacement of the characters `[start, end)` of the old text by `length` characters."""

    start: int
    end: int
    length: int


class LineIndex:
    """A text with an index of its lines."""

    def __init__(self, text: str, encoding: Encoding, starts: list[int] | None = None) -> None:
        self.text = text
        self.encoding = encoding
        self._starts = [0, *(found.end() for found in _LINE_END.finditer(text))] if starts is None else starts
        self._plain = text.isascii() or encoding is Encoding.UTF_32

    def place(self, offset: int) -> TextPosition:
        """The position of a character: past the end it is the end, between `\\r` and `\\n` the end of the line."""
        offset = max(0, min(offset, len(self.text)))
        line = bisect_right(self._starts, offset) - 1
        start = self._starts[line]
        return TextPosition(line, self._units(self.text[start : min(offset, self._line_end(line))]))

    def offset(self, place: TextPosition) -> int:
        """The character at a position. Past the end of a line it is the end of the line, past the last line the end of
        the text; in the middle of a character it is the start of the character.
        """
        line, column = place
        if line < 0:
            return 0
        if line >= len(self._starts):
            return len(self.text)
        start, end = self._starts[line], self._line_end(line)
        if self._plain:
            return min(start + max(0, column), end)
        return start + self._characters(self.text[start:end], column)

    def replaced(self, start: int, end: int, put: str) -> "LineIndex":
        """Return the text with `put` in place of `[start, end)`. Only this part, with a character on either side, is
        searched for line ends again.
        """
        text = self.text[:start] + put + self.text[end:]
        last, by = start + len(put), len(put) - (end - start)
        before = self._starts[: max(1, bisect_left(self._starts, start))]
        found = (each.end() for each in _LINE_END.finditer(text, max(0, start - 1), last + 1))
        within = [each for each in found if before[-1] < each <= last]
        behind = [each + by for each in self._starts[bisect_right(self._starts, end) :]]
        return LineIndex(text, self.encoding, [*before, *within, *behind])

    def _line_end(self, line: int) -> int:
        """The end of a line, without its line terminator."""
        if line + 1 == len(self._starts):
            return len(self.text)
        end = self._starts[line + 1] - 1
        return end - 1 if self.text[end] == "\n" and end > self._starts[line] and self.text[end - 1] == "\r" else end

    def _units(self, piece: str) -> int:
        if self._plain or piece.isascii():
            return len(piece)
        return sum(self._width(char) for char in piece)

    def _characters(self, line: str, column: int) -> int:
        left = column
        for at, char in enumerate(line):
            left -= self._width(char)
            if left < 0:
                return at
        return len(line)

    def _width(self, char: str) -> int:
        point = ord(char)
        if self.encoding is Encoding.UTF_16:
            return 2 if point > _ASTRAL else 1
        if self.encoding is Encoding.UTF_8:
            return 1 if point < 0x80 else 2 if point < 0x800 else 3 if point <= _ASTRAL else 4
        return 1


def edited(lines: LineIndex, changes: Iterable[TextChange]) -> LineIndex:
    """Apply changes, one after the other. A change whose end is before its start inserts at the start."""
    for change in changes:
        text = lines.text
        if change.start is None or change.end is None:
            start, end = 0, len(text)
        else:
            start = lines.offset(change.start)
            end = max(start, lines.offset(change.end))
        lines = lines.replaced(start, end, change.text)
    return lines


def difference(old: str, new: str) -> Edit:
    """Return the smallest single replacement that changes `old` to `new`."""
    if old == new:
        return Edit(len(old), len(old), 0)
    least = min(len(old), len(new))
    start = _longest(least, lambda low, high: old[low:high] == new[low:high])
    length, others = len(old), len(new)
    behind = _longest(
        least - start, lambda low, high: old[length - high : length - low] == new[others - high : others - low]
    )
    return Edit(start, len(old) - behind, len(new) - behind - start)


def _longest(most: int, same: Callable[[int, int], bool]) -> int:
    """The number of equal characters, at most `most`. Bisection lets fast slice comparisons do the work."""
    low, high = 0, most
    while low < high:
        middle = (low + high + 1) // 2
        if same(low, middle):
            low = middle
        else:
            high = middle - 1
    return low
