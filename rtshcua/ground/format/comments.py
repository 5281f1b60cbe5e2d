"""Comments, as they stand between two tokens."""

import re
from typing import NamedTuple

from rtshcua.ground.lint.ignores import ignores_line

COMMENT = re.compile(r"//[^\n]*+|/\*(?s:.)*?\*/")
#: what may be taken away at the end of a line; other characters that Python calls blank are what a comment says
BLANKS = " \t\r\f"


class Comment(NamedTuple):
    """Comments that stand on one line: whether the line begins with them, whether it ends with them, and whether a
    blank line is before it.
    """

    text: str
    first: bool
    last: bool
    blank: bool

    @property
    def inline(self) -> bool:
        """Whether code may follow on the line: no `//`, no line end within, and no line of its own."""
        return not self.ends_line and not (self.first and self.last)

    @property
    def ends_line(self) -> bool:
        """Whether it cannot be followed by code on its line, or goes over several."""
        return "\n" in self.text or bool(COMMENT.findall(self.text)[-1].startswith("//"))

    @property
    def ignores(self) -> bool:
        """Whether it ignores findings, by the line."""
        return any(map(ignores_line, COMMENT.findall(self.text)))


class Gap(NamedTuple):
    """What is between two tokens: the comments, whether a line ends there, and whether the next token's line has a
    blank one before it.
    """

    comments: tuple[Comment, ...]
    ends_line: bool
    blank: bool


def content(comment: str) -> str:
    """A comment, without what is blank at the end of its lines."""
    if "\n" not in comment:
        return comment.rstrip(BLANKS)
    return "\n".join(line.rstrip(BLANKS) for line in comment.split("\n"))


def gap_of(text: str, *, at_start: bool, at_end: bool) -> Gap:
    """What a gap holds; that of the file's start begins a line, that of its end ends one."""
    if "/" not in text:
        lines = text.count("\n")
        return Gap((), lines > 0, lines > 1)
    rows: list[Comment] = []
    beside: list[str] = []  # the comments of the last row, put together once: there may be millions
    before, end, ended = at_start, 0, at_start
    blank = False
    for found in COMMENT.finditer(text):
        lines = text.count("\n", end, found.start())
        ended = ended or lines > 0
        told = content(found[0])
        if rows and not lines:
            beside.append(told)
        else:
            if rows:
                rows[-1] = rows[-1]._replace(text=" ".join(beside), last=True)
            blank = lines > 1
            beside = [told]
            rows.append(Comment(told, before or lines > 0, False, blank))
        before, end = False, found.end()
    lines = text.count("\n", end)
    rows[-1] = rows[-1]._replace(text=" ".join(beside), last=lines > 0 or at_end)
    return Gap(tuple(rows), ended or lines > 0 or any("\n" in row.text for row in rows), lines > 1)
