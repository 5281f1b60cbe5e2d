"""Positions agree with a count of encoded units, and changes with slicing the text."""

from hypothesis import given
from hypothesis import strategies as st

from rtshcua.ground.editor.positions import Edit, Encoding, LineIndex, TextChange, TextPosition, difference, edited
from virtual.rows import rows

TEXTS = st.lists(st.sampled_from(["a", "é", "€", "𝄞", "\n", "\r", "\r\n", "\f", " "]), max_size=20).map("".join)
ENCODINGS = st.sampled_from(Encoding)
WIDTHS = {"utf-8": ("utf-8", 1), "utf-16": ("utf-16-le", 2), "utf-32": ("utf-32-le", 4)}


def units(text: str, encoding: Encoding) -> int:
    codec, width = WIDTHS[encoding.value]
    return len(text.encode(codec)) // width


def naive(text: str, offset: int, encoding: Encoding) -> TextPosition:
    """Line by line, ends by `\\r\\n`, `\\n` or `\\r`; what stands in the middle of an end is at the end of its line."""
    line, start, at = 0, 0, 0
    while at < len(text):
        end = 2 if text.startswith("\r\n", at) else 1 if text[at] in "\r\n" else 0
        if end and at + end <= offset:
            line, start = line + 1, at + end
        elif end and at < offset:
            return TextPosition(line, units(text[start:at], encoding))
        at += end or 1
    return TextPosition(line, units(text[start:offset], encoding))


@given(TEXTS, ENCODINGS, st.integers(0, 30))
def test_position_converts_to_an_offset_and_back(text: str, encoding: Encoding, offset: int) -> None:
    offset = min(offset, len(text))
    lines = LineIndex(text, encoding)
    place = lines.place(offset)
    assert place == naive(text, offset, encoding)
    if text[offset - 1 : offset + 1] != "\r\n":
        assert lines.offset(place) == offset


@rows(
    ("place", "encoding", "offset"),
    [
        (TextPosition(0, 0), Encoding.UTF_16, 0),
        (TextPosition(0, 3), Encoding.UTF_16, 2),  # after the two units of the clef
        (TextPosition(0, 2), Encoding.UTF_16, 1),  # between the two units: before the clef
        (TextPosition(0, 5), Encoding.UTF_8, 2),
        (TextPosition(0, 3), Encoding.UTF_8, 1),
        (TextPosition(0, 2), Encoding.UTF_32, 2),
        (TextPosition(0, 99), Encoding.UTF_16, 3),  # past the end of a line: its end
        (TextPosition(1, 0), Encoding.UTF_16, 5),
        (TextPosition(9, 0), Encoding.UTF_16, 6),  # past the last line: the end
        (TextPosition(-1, 4), Encoding.UTF_16, 0),
        (TextPosition(1, -4), Encoding.UTF_16, 5),
    ],
)
def test_positions_by_hand(place: TextPosition, encoding: Encoding, offset: int) -> None:
    assert LineIndex("a𝄞b\r\nc", encoding).offset(place) == offset


@given(TEXTS, ENCODINGS, st.integers(0, 30), st.integers(0, 30), TEXTS)
def test_change_equals_slicing_the_text(text: str, encoding: Encoding, one: int, other: int, put: str) -> None:
    start, end = sorted((min(one, len(text)), min(other, len(text))))
    lines = LineIndex(text, encoding)
    middle = any(text[at - 1 : at + 1] == "\r\n" for at in (start, end))
    if not middle:
        assert (
            edited(lines, [TextChange(lines.place(start), lines.place(end), put)]).text
            == text[:start] + put + text[end:]
        )
    assert edited(lines, [TextChange(None, None, put)]).text == put
    now = lines.replaced(start, end, put)
    assert now._starts == LineIndex(now.text, encoding)._starts


def test_changes_are_sequential_and_a_reversed_range_inserts() -> None:
    lines = LineIndex("abc", Encoding.UTF_16)
    changes = [
        TextChange(TextPosition(0, 1), TextPosition(0, 2), "x\ny"),
        TextChange(TextPosition(1, 1), TextPosition(1, 2), ""),
    ]
    assert edited(lines, changes).text == "ax\ny"
    assert edited(lines, [TextChange(TextPosition(0, 2), TextPosition(0, 1), "-")]).text == "ab-c"


@given(TEXTS, TEXTS)
def test_difference_changes_the_old_text_to_the_new(old: str, new: str) -> None:
    start, end, length = difference(old, new)
    assert old[:start] + new[start : start + length] + old[end:] == new
    if old != new and start < end and length:
        assert old[start] != new[start]
        assert old[end - 1] != new[start + length - 1]
    assert difference(old, old) == Edit(len(old), len(old), 0)
