"""Format a text, and check that the result has the same meaning.

The check compares the parse trees, tokens and comments of both texts: the same comments must be between the same
tokens. It imports only the table of the parser, not the parser itself, so that `rtshcua fmt` starts fast.
`format.formatted` adds the findings on a text that cannot be formatted.
"""

from bisect import bisect_left
from itertools import accumulate
from typing import NamedTuple

from rtshcua.diagnostics.codes import NOT_FORMATTED, UNSAFE_FORMAT
from rtshcua.diagnostics.diagnostic import Applicability, Diagnostic, Fix
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.format.line_layout import align, layout
from rtshcua.ground.format.style import WIDTH
from rtshcua.ground.format.token_reader import TokenizedText, read
from rtshcua.ground.format.token_sheet import COMMENT, content, sheet
from rtshcua.ground.language.size_limits import MAX_SIZE, MAX_TOKENS
from rtshcua.ground.lint.ignores import ignores_line


class FormatDifference(NamedTuple):
    """A difference between two texts, and its offset in the first."""

    what: str
    offset: int

    def finding(self, source: Source) -> Diagnostic:
        """The finding on this internal fault."""
        start = max(0, min(self.offset, len(source.text) - 1))
        return Diagnostic(
            UNSAFE_FORMAT,
            f"formatting would change {self.what} here, so the file was not changed",
            Span(source.file, start, min(start + 1, len(source.text))),
            "this is an internal fault: please report it with the file",
        )


class _Comparable(NamedTuple):
    """The compared parts: tokens with their offsets, comments with the number of tokens before each, and for each
    `ignore` comment the range of tokens on its line.
    """

    words: list[str]
    starts: list[int]
    comments: list[tuple[int, str]]
    ignored: list[tuple[int, int]]


def difference(before: TokenizedText, after: TokenizedText | None) -> FormatDifference | None:
    """Return the first difference between two texts; None if there is none.

    The parser is a function of the tokens: two texts with the same tokens, reduced by the same rules in the same order,
    have the same IR apart from spans. Only commas at the ends of lists may differ.
    """
    if after is None:
        return FormatDifference("the syntax", 0)
    one, other = _comparable(before), _comparable(after)
    if one.words != other.words:
        return FormatDifference("a token", _offset_of(one, _first(one.words, other.words)))
    if before.rules != after.rules:
        return FormatDifference("the meaning", 0)
    if one.comments != other.comments:
        number = _first(one.comments, other.comments)
        words = one.comments[number][0] if number < len(one.comments) else len(one.words)
        return FormatDifference("a comment", _offset_of(one, words))
    if one.ignored != other.ignored:
        return FormatDifference("the line of an `ignore` comment", 0)
    return None


def _first(one: list[str] | list[tuple[int, str]], other: list[str] | list[tuple[int, str]]) -> int:
    """The index of the first difference of two lists."""
    pairs = enumerate(zip(one, other, strict=False))
    return next((number for number, (a, b) in pairs if a != b), min(len(one), len(other)))


def _offset_of(text: _Comparable, word: int) -> int:
    return text.starts[word] if word < len(text.starts) else max(text.starts, default=0)


def _comparable(read: TokenizedText) -> _Comparable:
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
        lines = _CommentLines(read)
        for end, start, counts in zip([0, *read.ends], [*read.starts, len(text)], [*counted, True], strict=True):
            if start - end > 1 and "/" in (gap := text[end:start]):
                for found in COMMENT.finditer(gap):
                    comments.append((before, content(found[0])))
                    if ignores_line(found[0]):
                        first, last = lines.about(end + found.start())
                        ignored.append((counting[first], counting[last]))
            before += counts
    return _Comparable(words, starts, comments, ignored)


class _CommentLines:
    """The lines that comments refer to, requested in source order. No line is scanned twice: a single line may have the
    whole text and all the comments.
    """

    def __init__(self, read: TokenizedText) -> None:
        self._text, self._starts = read.text, read.starts
        self._begin = self._asked = 0  # the line start of the last request, and the request
        self._next, self._after = -1, 0  # a token, and where its line ends

    def about(self, offset: int) -> tuple[int, int]:
        """The tokens before a comment on its line; if there are none, those on the next line with tokens."""
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


#: the deepest nesting of brackets; the parser reports E0105 at a lower level
MAX_DEPTH = 100


def format_text(text: str, width: int = WIDTH) -> str | FormatDifference | None:
    """Return `text` in the standard style, in lines of at most `width` characters where possible.

    None if the text has syntax errors, is nested too deeply, or has too many tokens or comments. A `FormatDifference`
    if the result would have another meaning or other comments, which is an internal fault.
    """
    before = read(text) if len(text) <= MAX_SIZE and "\0" not in text else None
    if before is None or before.depth > MAX_DEPTH or len(before.words) > MAX_TOKENS or has_too_many_comments(before):
        return None
    made = lay_out(before, width)
    if made == text:
        return made
    return difference(before, read(made)) or made


def has_too_many_comments(read: TokenizedText) -> bool:
    """Whether there are more comments than the formatter accepts: each may need a line."""
    text = read.text
    if text.count("//") + text.count("/*") <= MAX_TOKENS:
        return False
    gaps = (text[end:start] for end, start in zip([0, *read.ends], [*read.starts, len(text)], strict=True))
    return sum(len(COMMENT.findall(gap)) for gap in gaps if "/" in gap) > MAX_TOKENS


def lay_out(before: TokenizedText, width: int) -> str:
    """Return the formatted text without the comparison."""
    return align(layout(sheet(before), width), width)


def not_formatted(source: Source, text: str) -> Diagnostic | None:
    """Return the finding on a `source` that differs from its formatted `text`; None if both are equal.

    Its span is the first different line; its fix is safe and replaces the whole text.
    """
    if source.text == text:
        return None
    old, new = source.text.split("\n"), text.split("\n")
    same = next(
        (at for at, pair in enumerate(zip(old, new, strict=False)) if pair[0] != pair[1]), min(len(old), len(new))
    )
    start = min(sum(len(line) + 1 for line in old[:same]), len(source.text))
    end = start + len(old[same]) if same < len(old) else start
    return Diagnostic(
        NOT_FORMATTED,
        "the source is not formatted",
        Span(source.file, start, end),
        f"run `rtshcua fmt {source.file}`",
        fixes=(Fix(Span(source.file, 0, len(source.text)), text, "format the file", Applicability.SAFE),),
    )
