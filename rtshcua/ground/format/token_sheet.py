"""The gaps between the tokens of a text: comments, blanks and line ends, and those that must stay.

`gap_of` reads one gap; `sheet` collects the input of the layout.
"""

import re
from dataclasses import dataclass
from itertools import accumulate
from typing import NamedTuple

from rtshcua.ground.format.style import CALLS, LISTS, OPERANDS
from rtshcua.ground.format.token_reader import SPACED, TokenizedText
from rtshcua.ground.lint.ignores import ignores_line

COMMENT = re.compile(r"//[^\n]*+|/\*(?s:.)*?\*/")
#: blanks that may be removed at the end of a line; other Unicode blanks are part of a comment
BLANKS = " \t\r\f"


class CommentRow(NamedTuple):
    """Comments on one line: whether they start the line, whether they end it, and whether a blank line precedes it."""

    text: str
    first: bool
    last: bool
    blank: bool

    @property
    def inline(self) -> bool:
        """Whether code may follow on the line: no `//`, no line end inside, not a line of its own."""
        return not self.ends_line and not (self.first and self.last)

    @property
    def ends_line(self) -> bool:
        """Whether no code can follow on the line, or the comments span several lines."""
        return "\n" in self.text or bool(COMMENT.findall(self.text)[-1].startswith("//"))

    @property
    def ignores(self) -> bool:
        """Whether it is an `ignore` comment for a line."""
        return any(map(ignores_line, COMMENT.findall(self.text)))


class TokenGap(NamedTuple):
    """The gap between two tokens: its comments, whether a line ends in it, and whether a blank line precedes the next
    token's line.
    """

    comments: tuple[CommentRow, ...]
    ends_line: bool
    blank: bool

    @property
    def inline(self) -> bool:
        """Whether it has comments, and code may follow all of them on the line."""
        return bool(self.comments) and all(comment.inline for comment in self.comments)


def content(comment: str) -> str:
    """A comment without trailing blanks in its lines."""
    if "\n" not in comment:
        return comment.rstrip(BLANKS)
    return "\n".join(line.rstrip(BLANKS) for line in comment.split("\n"))


def gap_of(text: str, *, at_start: bool, at_end: bool) -> TokenGap:
    """Read a gap. The gap at the start of a file starts a line, that at the end ends one."""
    if "/" not in text:
        lines = text.count("\n")
        return TokenGap((), lines > 0, lines > 1)
    rows: list[CommentRow] = []
    beside: list[str] = []  # the comments of the last row, joined once: there may be millions
    before, end, ended = at_start, 0, at_start
    blank = False
    for found in COMMENT.finditer(text):
        lines = text.count("\n", end, found.start())
        ended = ended or lines > 0
        comment = content(found[0])
        if rows and not lines:
            beside.append(comment)
        else:
            if rows:
                rows[-1] = rows[-1]._replace(text=" ".join(beside), last=True)
            blank = lines > 1
            beside = [comment]
            rows.append(CommentRow(comment, before or lines > 0, False, blank))
        before, end = False, found.end()
    lines = text.count("\n", end)
    rows[-1] = rows[-1]._replace(text=" ".join(beside), last=lines > 0 or at_end)
    return TokenGap(tuple(rows), ended or lines > 0 or any("\n" in row.text for row in rows), lines > 1)


NO_GAP = TokenGap((), ends_line=False, blank=False)

_MOMENT = re.compile('"[0-9]{4}-')
LIST, GROUP, BLOCK = "list", "group", "block"


@dataclass(frozen=True, slots=True)
class TokenSheet:
    """The tokens of a text by number, and the `gaps` before them on a single line.

    `written` has the gap and the text of each token in turn, and `places` their offsets if all were on one line.
    `pairs` has the closing bracket of each opening one, `kinds` what they enclose. `notes` has the gaps other than none
    or one blank. `lines` counts the gaps up to a token in which the author ended a line, `kept` those that always end
    one. `held` has the gaps in which no line may end, because an `ignore` comment refers to the line.
    """

    read: TokenizedText
    gaps: list[str]
    written: list[str]
    places: list[int]
    pairs: dict[int, int]
    kinds: dict[int, str]
    notes: dict[int, TokenGap]
    lines: list[int]
    kept: list[int]
    held: set[int]

    def width(self, first: int, end: int) -> int:
        """The width of the tokens `[first, end)` on one line."""
        return self.places[2 * end] - self.places[2 * first + 1]

    def flat(self, first: int, end: int) -> str:
        """These tokens on one line."""
        return "".join(self.written[2 * first + 1 : 2 * end])

    def ends_within(self, first: int, end: int) -> bool:
        """Whether a line must end between two of these tokens."""
        return end > first and self.kept[end - 1] > self.kept[first]

    def ends_before(self, token: int) -> bool:
        """Whether a line must end before this token."""
        return token > 0 and self.kept[token] > self.kept[token - 1]

    def author_ended(self, token: int) -> bool:
        """Whether the author ended a line before this token."""
        return token > 0 and self.lines[token] > self.lines[token - 1]

    def note(self, token: int) -> TokenGap:
        """The gap before a token."""
        return self.notes.get(token, NO_GAP)


def sheet(read: TokenizedText) -> TokenSheet:
    """Return the sheet of a text."""
    text, count = read.text, len(read.words)
    raw = [text[end:start] for end, start in zip([0, *read.ends], [*read.starts, len(text)], strict=True)]
    raw[0] = raw[0].removeprefix("\ufeff")
    notes = {
        number: gap_of(gap, at_start=number == 0, at_end=number == count)
        for number, gap in enumerate(raw)
        if gap != " " and gap
    }
    words, gaps = list(read.words), _gaps(read)
    pairs, kinds = _brackets(read)
    ended, kept = _line_ends(read, notes)
    held = _held_gaps(read, notes, ended, kept)
    for opening, close in pairs.items():
        _settle_brackets(read, opening, close, kinds[opening], words, gaps, notes, ended, kept, held)
    for number, note in notes.items():
        if 0 < number < count and note.inline:
            inside = " ".join(comment.text for comment in note.comments)
            left = "" if words[number - 1] == "(" else " "
            gaps[number] = left + inside + ("" if words[number] in (")", ",") else " ")
    gaps[:1] = [""] * min(1, count)
    written = [part for pair in zip(gaps, words, strict=True) for part in pair]
    places = list(accumulate(map(len, written), initial=0))
    return TokenSheet(
        read, gaps, written, places, pairs, kinds, notes, list(accumulate(ended)), list(accumulate(kept)), held
    )


def _line_ends(read: TokenizedText, notes: dict[int, TokenGap]) -> tuple[list[int], list[int]]:
    """Whether the author ended a line before each token, and whether the line always ends there."""
    count = len(read.words)
    ended, kept = [0] * (count + 1), [0] * (count + 1)
    for number, note in notes.items():
        ended[number] = note.ends_line
        if note.comments:
            kept[number] = not note.inline
        elif note.ends_line and number < count and read.symbols[number] in ("and", "or"):
            kept[number] = 1
    return ended, kept


def _gaps(read: TokenizedText) -> list[str]:
    """The gap of the style before each token: a blank or nothing."""
    gaps: list[str] = []
    before = last = ""
    for symbol in read.symbols:
        if symbol in (")", ",", "@") or last in ("(", "@", ""):
            gap = ""
        elif symbol == "(":
            gap = "" if last in CALLS else " "
        elif last in ("-", "+") and before not in OPERANDS:
            gap = ""
        elif symbol == ":":
            gap = " " if before == "signal" else ""
        else:
            gap = " "
        gaps.append(gap)
        before, last = last, symbol
    _special_gaps(read, gaps)
    return gaps


def _special_gaps(read: TokenizedText, gaps: list[str]) -> None:
    """Set the gaps before quoted clauses after `at`, and between items on one line."""
    for number in [number for number, symbol in enumerate(read.symbols) if symbol == "<STRING>"]:
        close = read.symbols[number - 1] == "at" and read.ends[number - 1] == read.starts[number]
        if close and not _MOMENT.match(read.words[number]):
            gaps[number] = ""  # with a blank it would be the text of a clause, unless it is a moment
    for number in read.items:
        if number and read.symbols[number - 1] != "{":
            gaps[number] = "  "


def _brackets(read: TokenizedText) -> tuple[dict[int, int], dict[int, str]]:
    """The closing bracket of each opening one, and what they enclose; inner pairs first."""
    pairs: dict[int, int] = {}
    kinds: dict[int, str] = {}
    symbols, opened = read.symbols, list[int]()
    for number, symbol in enumerate(symbols):
        if symbol in ("(", "{"):
            opened.append(number)
        elif symbol in (")", "}"):
            opening = opened.pop()
            pairs[opening] = number
            if symbol == ")":
                kinds[opening] = LIST if symbols[opening - 1] in LISTS else GROUP
            else:
                block = number == opening + 1 or opening + 1 in read.items
                kinds[opening] = BLOCK if block else LIST
    return pairs, kinds


def _settle_brackets(
    read: TokenizedText,
    opening: int,
    close: int,
    kind: str,
    words: list[str],
    gaps: list[str],
    notes: dict[int, TokenGap],
    ended: list[int],
    kept: list[int],
    held: set[int],
) -> None:
    """Set the gaps in a pair of brackets. A list or block that the author opened over several lines stays so. The comma
    at the end of a list is dropped; the layout of a list over several lines adds it.
    """
    if kind is LIST and read.symbols[opening] == "{" and read.symbols[opening - 1] == "in":
        gaps[opening + 1] = gaps[close] = ""
    if kind is LIST and ended[opening + 1]:
        kept[opening + 1] = 1
    elif kind is BLOCK and any(ended[opening + 1 : close + 1]):
        kept[opening + 1] |= close > opening + 1 or bool(notes[close].comments)
    last = close - 1
    if kind is LIST and read.symbols[last] == "," and not any(notes.get(at, NO_GAP).comments for at in (last, close)):
        words[last] = gaps[last] = ""
        if kept[last]:  # it began a line that is held
            kept[close] = 1
            held.discard(close)


def _held_gaps(read: TokenizedText, notes: dict[int, TokenGap], ended: list[int], kept: list[int]) -> set[int]:
    """The gaps on the lines of `ignore` comments; such a line also keeps its beginning and end."""
    count, held = len(read.words), set[int]()
    ignoring = [number for number, note in notes.items() if any(each.ignores for each in note.comments)]
    if not ignoring:
        return held
    begun = list(ended)  # whether the token after a gap is on another line than the one before it
    for number, symbol in enumerate(read.symbols):
        if symbol in SPACED and "\n" in read.text[read.starts[number] : read.ends[number]]:
            begun[number + 1] = 1
    before, after = _ignored_lines(notes, ignoring, list(accumulate(begun)))
    for token in before.values():
        while token > 0 and not begun[token]:
            held.add(token)
            token -= 1
        kept[token] = token > 0
    for token in after.values():
        while token < count and not begun[token]:
            held.add(token)
            token += 1
        if token < count:
            kept[token] = 1
    return held


def _ignored_lines(
    notes: dict[int, TokenGap], ignoring: list[int], lines: list[int]
) -> tuple[dict[int, int], dict[int, int]]:
    """By line, the last token before an `ignore` comment on it, and the first token after one at its beginning.

    Each line has one entry, because one line may have all the `ignore` comments of a file.
    """
    before: dict[int, int] = {}
    after: dict[int, int] = {}
    for number in ignoring:
        comments = notes[number].comments
        behind = not comments[0].first and "\n" not in comments[0].text
        if comments[0].ignores and behind:
            before[lines[number - 1]] = number - 1
        if any(each.ignores for each in comments[behind:]):
            after.setdefault(lines[number], number + 1)
    return before, after
