"""The width of printed text: 80 columns, unless the environment variable COLUMNS sets another width."""

import os
import shlex
from collections.abc import Sequence
from typing import Final

from rtshcua.diagnostics.wrapped import WIDTH, wrapped

#: the minimum width, columns
_LEAST: Final = 40


def fitted(line: str) -> list[str]:
    """Wrap a line at the width of printed text."""
    return wrapped(line, columns())


def columns() -> int:
    """Return the width of printed text in columns."""
    asked = os.environ.get("COLUMNS", "")
    width = int(asked) if asked.isascii() and asked.isdecimal() and len(asked) < 6 else WIDTH
    return max(width, _LEAST)


def typed(words: Sequence[str], width: int) -> list[str]:
    """Return a shell command, broken into lines that can be pasted into a shell."""
    lines = [""]
    for word in map(shlex.quote, words):
        if lines[-1] and len(lines[-1]) + 1 + len(word) > width - 2:
            lines.append("  ")
        lines[-1] += f"{' ' if lines[-1].strip() else ''}{word}"
    return [f"{line} \\" for line in lines[:-1]] + lines[-1:]
