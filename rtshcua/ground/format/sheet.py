"""What stands between the tokens of a text, and which of it must stay: all that laying it out needs to know."""

import re
from dataclasses import dataclass
from itertools import accumulate

from rtshcua.ground.format.comments import Gap, gap_of
from rtshcua.ground.format.read import SPACED, Read
from rtshcua.ground.format.style import CALLS, LISTS, OPERANDS

NO_COMMENTS = Gap((), ends_line=False, blank=False)

_MOMENT = re.compile('"[0-9]{4}-')
LIST, GROUP, BLOCK = "list", "group", "block"


@dataclass(frozen=True, slots=True)
class Sheet:
    """A text's tokens by their number, and what stands before each of them, `gaps`, where it stands on one line.

    `written` has gap and word of each token in turn, and `places` where each of these would begin if all of it stood
    on one line. `pairs` has the closing bracket of each opening one, `kinds` what they enclose. `notes` has the gaps
    that are not empty nor one blank. `lines` counts the gaps before a token at which the author ended a line,
    `kept` those at which a line ends whatever its width. `held` are gaps at which no line may end: a comment that
    ignores findings speaks of the line.
    """

    read: Read
    gaps: list[str]
    written: list[str]
    places: list[int]
    pairs: dict[int, int]
    kinds: dict[int, str]
    notes: dict[int, Gap]
    lines: list[int]
    kept: list[int]
    held: set[int]

    def width(self, first: int, end: int) -> int:
        """How wide the tokens from `first` to before `end` are on one line."""
        return self.places[2 * end] - self.places[2 * first + 1]

    def flat(self, first: int, end: int) -> str:
        """These tokens on one line."""
        return "".join(self.written[2 * first + 1 : 2 * end])

    def ends_within(self, first: int, end: int) -> bool:
        """Whether a line ends between two of these tokens, whatever their width."""
        return end > first and self.kept[end - 1] > self.kept[first]

    def ends_before(self, token: int) -> bool:
        """Whether a line ends just before this token, whatever the width."""
        return token > 0 and self.kept[token] > self.kept[token - 1]

    def author_ended(self, token: int) -> bool:
        """Whether the author ended a line just before this token."""
        return token > 0 and self.lines[token] > self.lines[token - 1]

    def note(self, token: int) -> Gap:
        """What the gap before a token holds."""
        return self.notes.get(token, NO_COMMENTS)


def sheet(read: Read) -> Sheet:
    """The sheet of a text."""
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
    ended = [0] * (count + 1)
    kept = [0] * (count + 1)
    for number, note in notes.items():
        ended[number] = note.ends_line
        if note.comments:
            kept[number] = not all(comment.inline for comment in note.comments)
        elif note.ends_line and number < count and read.symbols[number] in ("and", "or"):
            kept[number] = 1
    held = _hold(read, notes, ended, kept)
    for opening, close in pairs.items():
        _within(read, opening, close, kinds[opening], words, gaps, notes, ended, kept, held)
    for number, note in notes.items():
        if 0 < number < count and note.comments and all(comment.inline for comment in note.comments):
            inside = " ".join(comment.text for comment in note.comments)
            left = "" if words[number - 1] == "(" else " "
            gaps[number] = left + inside + ("" if words[number] in (")", ",") else " ")
    gaps[:1] = [""] * min(1, count)
    written = [part for pair in zip(gaps, words, strict=True) for part in pair]
    places = list(accumulate(map(len, written), initial=0))
    return Sheet(
        read, gaps, written, places, pairs, kinds, notes, list(accumulate(ended)), list(accumulate(kept)), held
    )


def _gaps(read: Read) -> list[str]:
    """What stands before each token if nothing is between them but what the style asks for."""
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
    for number in [number for number, symbol in enumerate(read.symbols) if symbol == "<STRING>"]:
        close = read.symbols[number - 1] == "at" and read.ends[number - 1] == read.starts[number]
        if close and not _MOMENT.match(read.words[number]):
            gaps[number] = ""  # with a blank it would be the text of a clause, unless it is a moment
    for number in read.items:
        if number and read.symbols[number - 1] != "{":
            gaps[number] = "  "
    return gaps


def _brackets(read: Read) -> tuple[dict[int, int], dict[int, str]]:
    """The closing bracket of each opening one, and what they enclose; inner ones first."""
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


def _within(
    read: Read,
    opening: int,
    close: int,
    kind: str,
    words: list[str],
    gaps: list[str],
    notes: dict[int, Gap],
    ended: list[int],
    kept: list[int],
    held: set[int],
) -> None:
    """What a pair of brackets says of the gaps in it: where the author opened a list or a block over several lines it
    stays so. The comma that a list ends in is not written; laying the list out over lines does that.
    """
    if kind is LIST and read.symbols[opening] == "{" and read.symbols[opening - 1] == "in":
        gaps[opening + 1] = gaps[close] = ""
    if kind is LIST and ended[opening + 1]:
        kept[opening + 1] = 1
    elif kind is BLOCK and any(ended[opening + 1 : close + 1]):
        kept[opening + 1] |= close > opening + 1 or bool(notes[close].comments)
    last = close - 1
    if (
        kind is LIST
        and read.symbols[last] == ","
        and not any(notes.get(at, NO_COMMENTS).comments for at in (last, close))
    ):
        words[last] = gaps[last] = ""
        if kept[last]:  # it began a line that is held
            kept[close] = 1
            held.discard(close)


def _hold(read: Read, notes: dict[int, Gap], ended: list[int], kept: list[int]) -> set[int]:
    """Gaps on the lines that an ignore speaks of; such a line also begins and ends where it did."""
    count, held = len(read.words), set[int]()
    ignoring = [number for number, note in notes.items() if any(each.ignores for each in note.comments)]
    if not ignoring:
        return held
    begun = list(ended)  # whether the token after a gap begins on another line than the one before it
    for number, symbol in enumerate(read.symbols):
        if symbol in SPACED and "\n" in read.text[read.starts[number] : read.ends[number]]:
            begun[number + 1] = 1
    lines = list(accumulate(begun))  # each walked once: one line may have all the ignores of a file
    before: dict[int, int] = {}  # by line, the last token before a comment that speaks of it
    after: dict[int, int] = {}  # by line, the first token that such a comment at its beginning speaks of
    for number in ignoring:
        comments = notes[number].comments
        behind = not comments[0].first and "\n" not in comments[0].text
        if comments[0].ignores and behind:
            before[lines[number - 1]] = number - 1
        if any(each.ignores for each in comments[behind:]):
            after.setdefault(lines[number], number + 1)
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
