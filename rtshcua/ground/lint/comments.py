"""The comments of a text, and where its first declaration begins. By itself: a text with errors has comments too.

What a comment asks of the tools is said here alone (`asked`): the linter and the formatter mean the same comments.
"""

import re
from bisect import bisect_left
from collections.abc import Iterator
from typing import NamedTuple

from rtshcua.diagnostics.span import Source, Span

#: what a comment may ask for: about a line, or about the whole file
LINE, FILE = "ignore", "ignore-file"
#: what a comment holds that asks for anything
ASKING = "rtshcua:"

_TOKEN = re.compile(
    r'(?P<text>"[^"\\\n]*+(?:\\[^\n][^"\\\n]*+){0,999}"?)|(?P<comment>//[^\n]*+|/\*.*?(?:\*/|\Z))|(?P<other>[^\s"/]++|/)',
    re.DOTALL,
)
_ASKED = re.compile(r"\s*rtshcua:\s*(?P<word>[^\s,]*)(?P<rest>.*)", re.DOTALL)


class Comment(NamedTuple):
    """A comment with its marks, what stands between them, and whether a declaration stands before it.

    `alone` is whether nothing but comments stands on its lines; `about` is the line (from 1) that it speaks of: the one
    that it begins on, or, where it is alone, the next that has something else than comments.
    """

    span: Span
    inside: str
    offset: int  # of `inside` in the text
    alone: bool
    about: int
    begun: bool


def asked(inside: str) -> "re.Match[str] | None":
    """What a comment asks of the tools, by what stands between its marks: the `word`, and the `rest` behind it."""
    return _ASKED.match(inside)


def ignores_line(comment: str) -> bool:
    """Whether a comment, with its marks, ignores findings by the line."""
    if ASKING not in comment:
        return False
    found = asked(_inside(comment))
    return found is not None and found["word"] == LINE


def comments(source: Source, holding: str = "") -> Iterator[Comment]:
    """The comments of a text that hold another, in order: there may be millions, and few that ask for anything."""
    found: list[tuple[int, int, bool]] = []
    taken: list[int] = []  # lines that have something else
    begun = False
    for match in _TOKEN.finditer(source.text):
        if match["comment"] is not None:
            if holding in match["comment"]:
                found.append((*match.span(), begun))
            continue
        begun = True
        line = source.position(match.start()).line  # what is no comment stays on one line
        if not taken or taken[-1] != line:
            taken.append(line)
    for start, end, later in found:
        first, last = source.position(start).line, source.position(end).line
        after = bisect_left(taken, first)
        alone = after == len(taken) or taken[after] > last
        about = first if not alone else taken[after] if after < len(taken) else last + 1
        inside = _inside(source.text[start:end]).rstrip("\r")
        yield Comment(Span(source.file, start, end), inside, start + 2, alone, about, later)


def _inside(written: str) -> str:
    """What stands between the marks of a comment; a block at the end of a text may lack the second."""
    closed = written.startswith("/*") and written.endswith("*/") and len(written) >= 4
    return written[2:-2] if closed else written[2:]
