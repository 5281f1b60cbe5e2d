"""Whether two texts say the same: the same parse tree, the same words, the same comments between the same words."""

from bisect import bisect_left
from itertools import accumulate
from typing import NamedTuple

from rtshcua.diagnostics.codes import UNSAFE_FORMAT
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.format.comments import COMMENT, content
from rtshcua.ground.format.read import Read
from rtshcua.ground.lint.ignores import ignores_line


class Difference(NamedTuple):
    """What would not be the same, and the offset in the first text where it is."""

    what: str
    offset: int

    def told(self, source: Source) -> Diagnostic:
        """As a finding: a fault of ours, for which nothing was written."""
        start = max(0, min(self.offset, len(source.text) - 1))
        return Diagnostic(
            UNSAFE_FORMAT,
            f"formatting would change {self.what} here, so the file is left as it is",
            Span(source.file, start, min(start + 1, len(source.text))),
            "this is a fault of ours: please report it, with the file",
        )


class _Said(NamedTuple):
    """What is compared: the words and where they stand, the comments with how many words are before each, and for each
    comment that ignores findings of a line how many words are before those on that line, and before what follows them.
    """

    words: list[str]
    starts: list[int]
    comments: list[tuple[int, str]]
    ignored: list[tuple[int, int]]


def difference(before: Read, after: Read | None) -> Difference | None:
    """The first thing that `after` does not say as `before` does; None if there is none.

    The parser is a function of the tokens: where both texts have the same words, and the same rules were applied to
    them in the same order, both make the same IR but for where things stand. Only commas at the ends of lists may come
    and go.
    """
    if after is None:
        return Difference("what can be read", 0)
    one, other = _said(before), _said(after)
    if one.words != other.words:
        return Difference("a word", _place(one, _first(one.words, other.words)))
    if before.rules != after.rules:
        return Difference("the meaning", 0)
    if one.comments != other.comments:
        number = _first(one.comments, other.comments)
        words = one.comments[number][0] if number < len(one.comments) else len(one.words)
        return Difference("a comment", _place(one, words))
    if one.ignored != other.ignored:
        return Difference("what a comment ignores", 0)
    return None


def _first(one: list[str] | list[tuple[int, str]], other: list[str] | list[tuple[int, str]]) -> int:
    """Where two lists differ first."""
    pairs = enumerate(zip(one, other, strict=False))
    return next((number for number, (a, b) in pairs if a != b), min(len(one), len(other)))


def _place(said: _Said, word: int) -> int:
    return said.starts[word] if word < len(said.starts) else max(said.starts, default=0)


def _said(read: Read) -> _Said:
    text, symbols = read.text, read.symbols
    following = [*symbols[1:], ""]
    counted = [symbol != "," or after not in (")", "}") for symbol, after in zip(symbols, following, strict=False)]
    words = [word for word, counts in zip(read.words, counted, strict=True) if counts]
    starts = [start for start, counts in zip(read.starts, counted, strict=True) if counts]
    comments: list[tuple[int, str]] = []
    ignored: list[tuple[int, int]] = []
    if "//" in text or "/*" in text:
        before = 0
        counting = list(accumulate(counted, initial=0))
        lines = _Lines(read)
        for end, start, counts in zip([0, *read.ends], [*read.starts, len(text)], [*counted, True], strict=True):
            if start - end > 1 and "/" in (gap := text[end:start]):
                for found in COMMENT.finditer(gap):
                    comments.append((before, content(found[0])))
                    if ignores_line(found[0]):
                        first, last = lines.about(end + found.start())
                        ignored.append((counting[first], counting[last]))
            before += counts
    return _Said(words, starts, comments, ignored)


class _Lines:
    """The lines that comments speak of, asked for in the order of the text; none is looked through twice, for one may
    have all the text, and all the comments.
    """

    def __init__(self, read: Read) -> None:
        self._text, self._starts = read.text, read.starts
        self._begin = self._asked = 0  # where the line begins of what was asked for last, and what that was
        self._next, self._after = -1, 0  # a token, and where its line ends

    def about(self, offset: int) -> tuple[int, int]:
        """The tokens before a comment on its line; where there are none, those on the next line that has any."""
        text, starts = self._text, self._starts
        self._begin = text.rfind("\n", self._asked, offset) + 1 or self._begin
        self._asked = offset
        begin, end = bisect_left(starts, self._begin), bisect_left(starts, offset)
        if begin == end < len(starts):
            if self._next != end:
                after = text.find("\n", starts[end])
                self._next, self._after = end, after if after >= 0 else len(text)
            end = bisect_left(starts, self._after)
        return begin, end
