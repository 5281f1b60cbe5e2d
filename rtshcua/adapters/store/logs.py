"""Reading a log without trusting it, and the anchors beside it: `*.anchors` holds notes one after another, each ended
by an empty line.
"""

import errno
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, Final

from rtshcua.adapters.store.reading import read_regular
from rtshcua.adapters.store.writing import append
from rtshcua.evidence.reading import LONGEST
from rtshcua.evidence.witnessing.anchors import notes

#: what the first line of every log begins with
START: Final = b'{"_prev":"'
ANCHORS: Final = ".anchors"
#: more of a file of anchors than this, and more files of them than this in a folder, are not looked at
_LARGEST: Final = 16 << 20
_MOST: Final = 64


def begins_as_log(path: Path, root: Path | None = None) -> bool:
    """Whether a file begins as every log does. Raises OSError, also as `open_regular`."""
    return read_regular(path, len(START), root).startswith(START)


def lines(file: BinaryIO) -> Iterator[bytes]:
    """The lines of a log, newline included; one that is too long comes in pieces, the first longer than `LONGEST`."""
    return iter(lambda: file.readline(LONGEST + 1), b"")


# ------------------------------------------------------------------------------------------ anchors


def anchors_path(log: Path) -> Path:
    """Where the anchors of a log are put."""
    return log.with_suffix(ANCHORS)


def read_anchors(log: Path) -> list[str]:
    """The notes in all files of anchors in the folder of a log, those of other logs included.

    What cannot be read says nothing: an anchor can only be missing. To be read before the log is, for a log may grow
    while it is read, and an anchor must not be ahead of it.
    """
    return [note for path in _files(log) for note in read_notes(path)]


def unreadable(log: Path) -> list[Path]:
    """The files of anchors in the folder of a log in which there is something, but no note."""
    return [path for path in _files(log) if not (path.is_file() and not path.stat().st_size) and not read_notes(path)]


def _files(log: Path) -> list[Path]:
    found = sorted(log.parent.glob(f"*{ANCHORS}"), key=lambda path: (path != anchors_path(log), path.name))
    return found[:_MOST]


def read_notes(path: Path) -> list[str]:
    """The notes in a file of anchors; none of a file that cannot be read."""
    with suppress(OSError):
        return list(notes(read_regular(path, _LARGEST, path.parent)[:_LARGEST].decode("utf-8", "replace")))
    return []


def read_named(path: Path) -> list[str]:
    """The notes in a file that somebody named, all of them. Raises OSError for one that cannot be read or is too large,
    and for what is not a regular file, which might be waited for.
    """
    data = read_regular(path, _LARGEST)
    if len(data) > _LARGEST:
        raise OSError(errno.E2BIG, f"more than {_LARGEST >> 20} MiB of anchors", str(path))
    return list(notes(data.decode("utf-8", "replace")))


def add_anchors(path: Path, found: list[str], root: Path | None = None) -> None:
    """Put notes behind those of a file, and on the disk. Raises OSError, also for a link there, or below `root`."""
    append(path, "".join(f"{note}\n" for note in found).encode(), root)
