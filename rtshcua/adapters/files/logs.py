"""Reading a log without trusting it, and the files beside it: its anchors, and its secret.

`*.anchors` holds notes one after another, each ended by an empty line. `log.secret` holds 32 random octets, without
which no record of the log can be shown in part. Its owner alone may read it: with it the fields that were withheld can
be guessed (docs/log-format.md, section 6).
"""

import errno
from collections.abc import Iterable, Iterator
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import BinaryIO, Final

from rtshcua.adapters.store.reading import exposed, open_regular, read_regular
from rtshcua.adapters.store.writing import PRIVATE_FILE, append, write_new
from rtshcua.evidence.proofs.disclosure import SECRET_BYTES, disclosure_root
from rtshcua.evidence.reading import LONGEST
from rtshcua.evidence.witnessing.anchors import notes
from rtshcua.wire.untrusted import Untrusted

#: what the first line of every log begins with
START: Final = b'{"_prev":"'
ANCHORS: Final = ".anchors"
SECRET: Final = "log.secret"
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
    and for what is no regular file, which might be waited for.
    """
    data = read_regular(path, _LARGEST)
    if len(data) > _LARGEST:
        raise OSError(errno.E2BIG, f"more than {_LARGEST >> 20} MiB of anchors", str(path))
    return list(notes(data.decode("utf-8", "replace")))


def add_anchors(path: Path, found: list[str], root: Path | None = None) -> None:
    """Put notes behind those of a file, and on the disk. Raises OSError, also for a link there, or below `root`."""
    append(path, "".join(f"{note}\n" for note in found).encode(), root)


# ---------------------------------------------------------------------------------------- the secret


class SecretError(Untrusted):
    """A secret that does not serve: `exposed`, `malformed`."""


def write_secret(folder: Path, secret: bytes) -> None:
    """Keep the secret of the log that is about to begin in this folder. Raises FileExistsError and OSError."""
    write_new(folder / SECRET, secret, mode=PRIVATE_FILE)


def read_secret(path: Path, root: Path | None = None) -> bytes:
    """The secret in a file that its owner alone may read. Raises `SecretError` and OSError, as `open_regular`."""
    with open_regular(path, root) as file:
        if why := exposed(file):
            raise SecretError("exposed", f"others may read the secret `{path}`: {why}")
        data = file.read(SECRET_BYTES + 1)
    if len(data) != SECRET_BYTES:
        raise SecretError("malformed", f"`{path}` is no secret of a log: it has not {SECRET_BYTES} bytes")
    return data


def disclosure_of(log: Path, records: int, before: Iterable[bytes] | None = None) -> bytes | None:
    """The disclosure root for the close of a log that stands on the disk with so many records, unless its lines are
    given otherwise; None where it does not, or its folder has no usable secret.
    """
    numbers = count()
    try:
        with open_regular(log) as file:
            numbered = zip(lines(file) if before is None else before, numbers, strict=False)
            root = disclosure_root((line for line, _ in numbered), read_secret(log.parent / SECRET, log.parent))
    except (OSError, ValueError):  # an `Untrusted` is a ValueError too
        return None
    return root if next(numbers) == records else None
