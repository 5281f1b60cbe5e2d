"""Show the progress of long commands on a terminal."""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

from rtshcua.app.wording import shorten
from rtshcua.diagnostics.excerpt import visible

T = TypeVar("T", bound=tuple[object, ...])

#: no progress is shown for fewer items
_FEW = 4
#: octets from which a bar is shown
_LONG = 32 << 20
_CLEAR = "\r\033[K"


def watched(items: Sequence[T]) -> Iterator[T]:
    """Yield the items; on a terminal, show the number and the first field of the current one."""
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
    """Return a function that shows progress texts on a terminal, each replacing the previous one; none if `quiet`."""
    shows = not quiet and sys.stderr is not None and sys.stderr.isatty()

    def say(text: str) -> None:
        if shows:
            sys.stderr.write(_CLEAR + visible(text))
            sys.stderr.flush()

    return say


def time_left(seconds: float) -> str:
    """Return a rest of the time in words: `2 h 5 min`, `12 min`, `under 1 min`."""
    minutes = round(seconds / 60)
    if minutes >= 60:
        return f"{minutes // 60} h {minutes % 60} min"
    return f"{minutes} min" if minutes else "under 1 min"


@contextmanager
def octets_of(what: str, size: int) -> Iterator[Callable[[int], None]]:
    """Yield a function that takes the number of octets done of `size`; it drives a bar on the terminal if they are
    many.
    """
    if size < _LONG or not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console
    from rich.progress import Progress as Bar

    with Bar(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=size)
        yield lambda done: bar.update(task, completed=done)
