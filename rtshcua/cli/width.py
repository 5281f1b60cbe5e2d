"""How wide the text of commands is: 80 columns, on a terminal or not, unless the environment asks for more or fewer."""

import os
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
