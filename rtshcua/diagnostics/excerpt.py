"""Show a source line on a terminal, with spans underlined, and make untrusted text safe to print."""

from collections.abc import Sequence
from re import compile as pattern
from unicodedata import category, east_asian_width

from rtshcua.diagnostics.span import Source, Span

TAB_WIDTH = 4
#: a longer line is cut around the underlined span
MAX_WIDTH = 110
#: how many columns of a cut line are shown before the underlined span
BEFORE = 30
#: how many characters of a long line are examined on either side of the underlined span
NEAR = 300
CUT = "..."

#: invisible characters that Unicode counts as printable (Default_Ignorable_Code_Point, and the blanks of Hangul and
#: Braille): two names could differ in them alone
_BLANK = "\u034f\u115f\u1160\u17b4\u17b5\u180b-\u180d\u180f\u2800\u3164\ufe00-\ufe0f\uffa0\U000e0100-\U000e01ef"
_BLANKS = pattern(f"[{_BLANK}]")
#: control characters other than white space, a lone carriage return, and reordering or invisible characters
_HIDING = pattern(
    "[\x00-\x08\x0b\x0e-\x1f\x7f-\x9f\u00ad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    f"\U0001bca0-\U0001bca3\U0001d173-\U0001d17a\U000e0000-\U000e0fff{_BLANK}]|\r(?!\n)"
)

#: a span to underline, the underline character, and the text after it
Mark = tuple[Span, str, str]


def together(source: Source, number: int, marks: Sequence[Mark], width: int = MAX_WIDTH) -> list[list[Mark]]:
    """Group the marks of a line so that the beginnings of all marks of a group fit in one excerpt."""
    text = source.line(number)
    groups: list[tuple[tuple[int, int], list[Mark]]] = []
    for mark in marks:
        column = min(source.position(mark[0].start).column - 1, len(text))
        for (first, last), group in groups:
            if first <= column <= last and (column < last or last == len(text)):
                group.append(mark)
                break
        else:
            begun = max(column - NEAR, 0)
            starts = _starts([_cell(character) for character in text[begun : column + NEAR]])
            first, last = _window(starts, (column - begun, column - begun), width)
            groups.append(((begun + first, begun + last), [mark]))
    return [group for _, group in groups]


def excerpt(source: Source, number: int, marks: Sequence[Mark], width: int = MAX_WIDTH) -> tuple[str, list[str]]:
    """Return the text of a line in at most `width` columns, and the underlines of its marks.

    The text of a mark follows its underline, or goes below it if there is no room. A span over several lines is
    underlined to the end of this line; an empty span has an underline of one character.
    """
    text = source.line(number)
    column = source.position(marks[0][0].start).column - 1
    begun, ended = max(column - NEAR, 0), column + NEAR
    offset = marks[0][0].start - column + begun
    cut = (begun > 0, ended < len(text))
    text = text[begun:ended]
    cells = [_cell(character) for character in text]
    starts = _starts(cells)
    columns = [(min(max(span.start - offset, 0), len(text)), min(span.end - offset, len(text))) for span, _, _ in marks]
    first, last = _window(starts, columns[0], width)
    rendered = "".join(
        shown if columns_taken >= 0 else " " * (starts[at + 1] - starts[at])
        for at, (shown, columns_taken) in enumerate(cells[first:last], start=first)
    )
    before, after = CUT if first > 0 or cut[0] else "", CUT if last < len(text) or cut[1] else ""
    underlines = []
    for (begin, end), (_, character, words) in zip(columns, marks, strict=True):
        begin, end = min(max(begin, first), last), min(max(end, first), last)
        indent = " " * (len(before) + starts[begin] - starts[first])
        underline = character * max(starts[max(end, begin)] - starts[begin], 1)
        label = visible(words)
        if len(indent) + len(underline) + 1 + len(label) <= width:
            underlines.append(f"{indent}{underline} {label}".rstrip())
        else:
            underlines += [indent + underline, " " * max(0, min(len(indent), width - len(label))) + label]
    return before + rendered + after, underlines


def _starts(cells: Sequence[tuple[str, int]]) -> list[int]:
    """The column of each character, and the column after the last one."""
    starts = [0]
    for _, width in cells:
        starts.append(starts[-1] + (width if width >= 0 else TAB_WIDTH - starts[-1] % TAB_WIDTH))
    return starts


def _window(starts: Sequence[int], column: tuple[int, int], width: int) -> tuple[int, int]:
    """The range of characters to show: all, or those around a column that fit beside the marks of a cut."""
    count = len(starts) - 1
    if starts[-1] <= width:
        return 0, count
    width -= 2 * len(CUT)
    first = column[0]
    while first > 0 and starts[column[0]] - starts[first - 1] <= BEFORE:
        first -= 1
    last = first
    while last < count and starts[last + 1] - starts[first] <= width:
        last += 1
    return first, last


def _cell(character: str) -> tuple[str, int]:
    """The text shown for a character and its width in columns; -1 for a tab."""
    if character == "\t":
        return " ", -1
    shown = visible(character)
    if shown != character:
        return shown, len(shown)
    if category(character) in ("Mn", "Me"):
        return character, 0
    return character, 2 if east_asian_width(character) in ("W", "F") else 1


def hiding(text: str, start: int = 0) -> int | None:
    """The offset of the first invisible or reordering character from `start` on; None if there is none."""
    found = _HIDING.search(text, start)
    return None if found is None else found.start()


def visible(text: str) -> str:
    """The text on one line, with control, invisible and reordering characters written as `<U+202E>`.

    All untrusted text passes this function before it is printed.
    """
    if text.isprintable() and (text.isascii() or _BLANKS.search(text) is None):
        return text
    return "".join(each if each.isprintable() and not _BLANKS.match(each) else f"<U+{ord(each):04X}>" for each in text)


def escaped(json: str) -> str:
    """JSON with every character that `visible` would replace written as an escape; its value is unchanged.

    Line feeds stay: JSON has them only between values.
    """
    lines = json.split("\n")
    if all(visible(line) == line for line in lines):
        return json
    return "\n".join("".join(each if visible(each) == each else _escape(each) for each in line) for line in lines)


def _escape(character: str) -> str:
    units = character.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[at]:02x}{units[at + 1]:02x}" for at in range(0, len(units), 2))


SHOWN = 40  # characters


def short(text: str) -> str:
    """`text` on one line, printable, and cut to `SHOWN` characters."""
    text = text[: SHOWN + 1]
    plain = text if text.isprintable() else text.encode("unicode_escape").decode()
    return plain if len(plain) <= SHOWN else plain[: SHOWN - 3] + "..."
