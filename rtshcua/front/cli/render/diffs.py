"""Unified diffs of formatted files, as `patch` accepts them."""

import os
import sys
from collections.abc import Iterator
from difflib import unified_diff

from rtshcua.app.layout import Laid
from rtshcua.diagnostics.excerpt import visible

_COLOURS = {"---": "\033[1m", "+++": "\033[1m", "@@": "\033[36m", "-": "\033[31m", "+": "\033[32m"}
_END = "\033[0m"


def difference(laid: Laid) -> str:
    """Return the diff of one file, coloured on a terminal; empty if nothing changes."""
    if laid.after is None or not laid.changed:
        return ""
    colour = sys.stdout is not None and sys.stdout.isatty() and not os.environ.get("NO_COLOR")
    made = unified(laid.name, laid.before, laid.after, "current", "formatted")
    return "".join(map(_coloured, made) if colour else made)


def unified(name: str, before: bytes, after: bytes, was: str = "", now: str = "") -> Iterator[str]:
    """Yield the lines of a unified diff of two UTF-8 texts; `was` and `now` label the two sides.

    Only the file name is escaped: a source with control or bidirectional characters is refused before.
    """
    name = visible(name)
    for line in unified_diff(_lines(before.decode("utf-8")), _lines(after.decode("utf-8")), name, name, was, now):
        yield line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n"


def _lines(text: str) -> list[str]:
    """Split at line feeds only, and keep the line ends."""
    lines = text.split("\n")
    return [f"{line}\n" for line in lines[:-1]] + lines[-1:] * bool(lines[-1])


def _coloured(line: str) -> str:
    head = next((colour for start, colour in _COLOURS.items() if line.startswith(start)), None)
    return line if head is None else f"{head}{line[:-1]}{_END}\n"
