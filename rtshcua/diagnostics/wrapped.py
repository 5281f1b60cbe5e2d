"""Wrap lines for a terminal of 80 columns; continuation lines are indented to the text of the first line."""

import re
from typing import Final

WIDTH: Final = 80
#: the least width of the text column
_ROOM: Final = 32
#: the prefix of a line (a mark or a label), and columns, separated by two spaces or more
_BEFORE: Final = re.compile(r" *(?:[-+=·] +|\d+\. )?(?:(?:error|warning|note|help)(?:\[[\w/-]+\])?: )?")
_COLUMN: Final = re.compile(r" {2,}+(?=[^ ])")
#: a part of a word; text in backticks counts as one word, so that a command is not broken where it fits
_PART: Final = re.compile(r"( *+)([^ `]++|`[^`]*+`|`)")
#: one of our commands is never broken, because people copy it
_COMMAND: Final = "`rtshcua "
#: a colour sequence, which has no width
_COLOUR: Final = re.compile(r"\x1b\[[0-9;]*m")


def wrapped(line: str, width: int = WIDTH) -> list[str]:
    """Wrap a line to `width` columns. A word that is longer stays whole, on a line of its own."""
    if _columns(line) <= width:
        return [line]
    beneath = _beneath(_COLOUR.sub("", line), width)
    lines: list[str] = []
    now = ""
    for space, word in _words(line, width - beneath):
        if not now and not lines:
            now = space + word
        elif _columns(now) + len(space) + _columns(word) <= width and now.strip():
            now += space + word
        else:
            lines.append(now)
            now = " " * max(0, min(beneath, width - _columns(word))) + word
    return [*lines, now]


def _columns(text: str) -> int:
    return len(_COLOUR.sub("", text)) if "\x1b" in text else len(text)


def _words(line: str, room: int) -> list[tuple[str, str]]:
    """The unbreakable pieces of a line, each with the spaces before it."""
    found: list[tuple[str, str]] = []
    whole: list[tuple[str, str]] = []
    for space, part in _PART.findall(line):
        if whole and not space:
            whole[-1] = whole[-1][0], whole[-1][1] + part
        else:
            whole.append((space, part))
    for space, word in whole:
        if " " in word and _columns(word) > room and not word.startswith(_COMMAND):
            head, *more = re.findall(r"( *)([^ ]+)", word)
            found += [(space, head[1]), *more]
        else:
            found.append((space, word))
    return found


def _beneath(line: str, width: int) -> int:
    """The column at which continuation lines start."""
    before = _BEFORE.match(line)
    at = before.end() if before is not None else 0
    while (column := _COLUMN.search(line, at)) is not None and column.end() <= width - _ROOM:
        at = column.end()
    return at or 2
