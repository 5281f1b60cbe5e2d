"""A page of plain text with headings, names and values."""

import os
import sys
from collections.abc import Iterable

import msgspec

from rtshcua.diagnostics.excerpt import visible
from rtshcua.front.cli.width import fitted

_NAME = 12


class TextPage:
    """Lines in order; `str()` gives them all. Every text is made harmless for a terminal before it goes in."""

    def __init__(self, *, bold: bool = False) -> None:
        self._lines: list[str] = []
        self._bold = bold

    def head(self, title: str) -> None:
        """A heading, after an empty line unless it is the first."""
        if self._lines:
            self._lines.append("")
        lines = fitted(visible(title))
        self._lines += [f"\033[1m{line}\033[0m" for line in lines] if self._bold else lines

    def row(self, name: str, value: str, *, indent: int = 2, width: int = _NAME) -> None:
        """A name and its value, wrapped beneath itself."""
        start = " " * indent + f"{visible(name):<{width}}  "
        self._lines += [line.rstrip() for line in fitted(start + visible(value))]

    def rows(self, name: str, values: Iterable[str], *, indent: int = 2, width: int = _NAME) -> None:
        """A name beside the first of its values, the others beneath; nothing for none."""
        for value in values:
            self.row(name, value, indent=indent, width=width)
            name = ""

    def text(self, line: str, *, indent: int = 2) -> None:
        """A line of its own."""
        self._lines += fitted(" " * indent + visible(line))

    def __str__(self) -> str:
        return "\n".join(self._lines)


def for_terminal() -> TextPage:
    """A page with bold headings where the standard output shows them."""
    return TextPage(bold=sys.stdout.isatty() and "NO_COLOR" not in os.environ and os.environ.get("TERM") != "dumb")


def named(value: object) -> object:
    """The value made of what JSON has."""
    if isinstance(value, msgspec.Struct):
        return {field: named(getattr(value, field)) for field in value.__struct_fields__}
    if isinstance(value, (tuple, list)):
        return [named(each) for each in value]
    return value.hex() if isinstance(value, bytes) else value
