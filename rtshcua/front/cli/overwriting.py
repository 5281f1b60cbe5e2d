"""What no command writes over: a source that it reads itself, whatever that is called."""

from collections.abc import Iterable
from pathlib import Path

from rtshcua.diagnostics.refusal import Refusal


def refusal(target: Path, read: Iterable[str | Path], what: str) -> Refusal | None:
    """Why `what` (a page, a report) cannot be written to a file: it is one of those that are read, by this name or, as
    links are, by another; None where it is not.
    """
    if not target.is_file() or not any(_same(target, Path(each)) for each in read):
        return None
    help = "name a file that nothing is read from"
    return Refusal("output", f"`{target}` is one of the sources, and is not replaced by {what}", help)


def _same(target: Path, other: Path) -> bool:
    try:
        return target.samefile(other)
    except (OSError, ValueError):  # a name that is no path, such as that of a text in memory
        return False
