"""Lines for a terminal of 80 columns: what does not fit goes on beneath, under the text that it belongs to."""

import re
from typing import Final

WIDTH: Final = 80
#: the least room for text beneath what stands before it
_ROOM: Final = 32
#: what stands before the text of a line: marks, and names in columns, parted by two spaces or more
_BEFORE: Final = re.compile(r" *(?:[-+=·] +|\d+\. )?(?:(?:error|warning|note|help)(?:\[[\w/-]+\])?: )?")
_COLUMN: Final = re.compile(r" {2,}+(?=[^ ])")
#: a part of a word; words in backticks are one: a command or a name is not taken apart where it fits
_PART: Final = re.compile(r"( *+)([^ `]++|`[^`]*+`|`)")
#: a command of ours is to be typed: it is not broken, whatever room it takes
_COMMAND: Final = "`rtshcua "
#: what sets a colour, and takes no room
_COLOUR: Final = re.compile(r"\x1b\[[0-9;]*m")


def wrapped(line: str, width: int = WIDTH) -> list[str]:
    """A line of text in lines of at most so many characters. A longer word stays whole, on a line of its own."""
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
    """What is kept together, each with the spaces before it."""
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
    """The column at which what does not fit goes on."""
    before = _BEFORE.match(line)
    at = before.end() if before is not None else 0
    while (column := _COLUMN.search(line, at)) is not None and column.end() <= width - _ROOM:
        at = column.end()
    return at or 2
