"""A few octets of memory that outlive this process until the machine restarts: they never wait for a disk."""

import mmap
import os
import stat
from pathlib import Path
from typing import Final

from rtshcua.adapters.store.reading import UNAWAITED
from rtshcua.adapters.store.writing import PRIVATE_FILE

#: a file system in memory that every user may write to (shm_overview(7)); other systems have none
_FOLDER: Final = Path("/dev/shm")


def memory_file(name: str) -> Path:
    """The file of such memory of this user."""
    return _FOLDER / f"rtshcua-{os.geteuid()}-{name}"


def open_memory(name: str, octets: int) -> mmap.mmap | None:
    """The memory of this name, with its content since the machine started; None where the system has none. None too for
    another kind of file or another user's, which others could read or change.
    """
    try:
        handle = os.open(memory_file(name), os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | UNAWAITED, PRIVATE_FILE)
    except OSError:
        return None
    try:
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode) or found.st_uid != os.geteuid() or found.st_nlink != 1:
            return None
        os.fchmod(handle, PRIVATE_FILE)
        # written, so that the pages exist: a map of a sparse file would end the process when memory is short
        os.pwrite(handle, os.pread(handle, octets, 0).ljust(octets, b"\0"), 0)
        return mmap.mmap(handle, octets)
    except (OSError, ValueError):
        return None
    finally:
        os.close(handle)
