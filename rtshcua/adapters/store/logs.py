"""Read a log without trusting it, and its anchors: `*.anchors` holds notes, each followed by an empty line."""

import errno
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, Final

from rtshcua.adapters.store.reading import read_regular
from rtshcua.adapters.store.writing import append
from rtshcua.evidence.reading import LONGEST
from rtshcua.evidence.witnessing.anchors import notes

#: the beginning of the first line of every log
START: Final = b'{"_prev":"'
ANCHORS: Final = ".anchors"
#: the limits of a file of anchors, and of the number of such files in a folder; the rest is ignored
_LARGEST: Final = 16 << 20
_MOST: Final = 64


def begins_as_log(path: Path, root: Path | None = None) -> bool:
    """Whether a file begins like a log. Raises OSError, also as `open_regular`."""
    return read_regular(path, len(START), root).startswith(START)


def lines(file: BinaryIO) -> Iterator[bytes]:
    """The lines of a log with their newlines; an overlong line comes in pieces, the first longer than `LONGEST`."""
    return iter(lambda: file.readline(LONGEST + 1), b"")


# ------------------------------------------------------------------------------------------ anchors


def anchors_path(log: Path) -> Path:
    """The file for the anchors of a log."""
    return log.with_suffix(ANCHORS)


def read_anchors(log: Path) -> list[str]:
    """The notes in all files of anchors in the folder of a log, including those of other logs. Unreadable files are
    ignored: an anchor can only be missing. To be called before the log is read, because a log may grow meanwhile, and
    an anchor must not be ahead of it.
    """
    return [note for path in _files(log) for note in read_notes(path)]


def unreadable(log: Path) -> list[Path]:
    """The non-empty files of anchors in the folder of a log that hold no note."""
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
    """All notes in a file that the user named. Raises OSError for one that cannot be read or is too large, or that is
    not a regular file, which might block.
    """
    data = read_regular(path, _LARGEST)
    if len(data) > _LARGEST:
        raise OSError(errno.E2BIG, f"more than {_LARGEST >> 20} MiB of anchors", str(path))
    return list(notes(data.decode("utf-8", "replace")))


def add_anchors(path: Path, found: list[str], root: Path | None = None) -> None:
    """Append notes to a file, synced. Raises OSError, also for a link there or below `root`."""
    append(path, "".join(f"{note}\n" for note in found).encode(), root)
