"""Opening what others may have put there: a regular file or nothing, and it is never waited for."""

import os
import stat
from errno import ELOOP, ENXIO
from io import BufferedReader
from pathlib import Path
from typing import BinaryIO, Final

from rtshcua.adapters.store.faults import NotRegular
from rtshcua.adapters.store.folders import opened_folder

#: without O_NONBLOCK a pipe without a writer would be waited for; with O_NOCTTY no terminal becomes ours
UNAWAITED: Final = os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC


def open_regular(path: str | Path, root: Path | None = None) -> BufferedReader:
    """A regular file, or a link to one, opened to be read. Below `root`, where one is given, no link is followed.

    Raises `NotRegular` for everything else, and OSError as the system does.
    """
    try:
        if root is None:
            handle = os.open(path, os.O_RDONLY | UNAWAITED)
        else:
            with opened_folder(Path(path).parent, root) as folder:
                handle = os.open(Path(path).name, os.O_RDONLY | os.O_NOFOLLOW | UNAWAITED, dir_fd=folder)
    except OSError as error:
        if error.errno == ENXIO:  # a socket
            raise NotRegular(ENXIO, "no regular file", str(path)) from None
        if error.errno == ELOOP and root is not None:
            raise NotRegular(ELOOP, "symbolic links are not followed here", str(path)) from None
        error.filename = str(path)
        raise
    expect_regular(handle, path)
    return os.fdopen(handle, "rb")


def read_regular(path: str | Path, most: int, root: Path | None = None) -> bytes:
    """What a regular file holds, but no more than one octet above `most`: who gets so many knows that it is too large.

    Raises as `open_regular`.
    """
    with open_regular(path, root) as file:
        return file.read(most + 1)


def expect_regular(handle: int, path: str | Path) -> None:
    """Closes a descriptor that is not of a regular file, and raises `NotRegular`."""
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise NotRegular(ENXIO, "no regular file", str(path))


def exposed(file: BinaryIO) -> str | None:
    """The mode of an open file that others than its owner may read, write or run, as in `0644`; else None."""
    mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
    return f"{mode:04o}" if mode & 0o077 else None
