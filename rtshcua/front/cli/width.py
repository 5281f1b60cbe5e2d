"""How wide the text of commands is: 80 columns, on a terminal or not, unless the environment asks for more or fewer."""

import os
import shlex
from collections.abc import Sequence
from typing import Final

from rtshcua.diagnostics.wrapped import WIDTH, wrapped

#: the fewest columns that text is laid out for
_LEAST: Final = 40


def fitted(line: str) -> list[str]:
    """A line as lines of 80 columns, or of as many as `COLUMNS` says."""
    return wrapped(line, columns())


def columns() -> int:
    """How many columns text is laid out for."""
    asked = os.environ.get("COLUMNS", "")
    width = int(asked) if asked.isascii() and asked.isdecimal() and len(asked) < 6 else WIDTH
    return max(width, _LEAST)


def typed(words: Sequence[str], width: int) -> list[str]:
    """A command over as many lines as it takes, which can be copied into a shell as they are."""
    lines = [""]
    for word in map(shlex.quote, words):
        if lines[-1] and len(lines[-1]) + 1 + len(word) > width - 2:
            lines.append("  ")
        lines[-1] += f"{' ' if lines[-1].strip() else ''}{word}"
    return [f"{line} \\" for line in lines[:-1]] + lines[-1:]
