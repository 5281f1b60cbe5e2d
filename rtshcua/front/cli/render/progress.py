"""How far a long command is, for a person who waits."""

import sys
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from rtshcua.app.wording import shorten
from rtshcua.diagnostics.excerpt import visible

T = TypeVar("T", bound=tuple[object, ...])

#: fewer are done before anyone asks
_FEW = 4
_CLEAR = "\r\033[K"


def watched(items: Sequence[T]) -> Iterator[T]:
    """The items, each by its first field, and on a terminal a line that says which one is in hand."""
    shows = len(items) >= _FEW and sys.stderr is not None and sys.stderr.isatty()
    try:
        for number, item in enumerate(items, 1):
            if shows:
                sys.stderr.write(f"{_CLEAR}{number}/{len(items)} {shorten(visible(str(item[0])), 60)}")
                sys.stderr.flush()
            yield item
    finally:
        if shows:
            sys.stderr.write(_CLEAR)
            sys.stderr.flush()


def counting(*, quiet: bool) -> Callable[[str], None]:
    """What shows on a terminal how far something is, each text in the place of the one before; nothing if `quiet`."""
    shows = not quiet and sys.stderr is not None and sys.stderr.isatty()

    def say(text: str) -> None:
        if shows:
            sys.stderr.write(_CLEAR + visible(text))
            sys.stderr.flush()

    return say
