"""The door between the evidence and the disk: a file that is appended to, and who makes it. Tests put faults in here.

Whatever of the evidence is written goes through it: the log, and the raw frames.
"""

import os
from functools import partial
from pathlib import Path
from typing import Protocol

from rtshcua.adapters.store.folders import sync_folder
from rtshcua.adapters.store.writing import open_new, sync_data

_ON = os.O_RDWR | os.O_APPEND | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)


class LogFile(Protocol):
    """An open file. Each method raises OSError when the system refuses."""

    def write(self, data: bytes | memoryview, /) -> int:
        """Appends bytes, as many as the system takes at once; how many that were."""
        ...

    def sync(self) -> None:
        """Returns when what was written is on the disk."""
        ...

    def truncate(self, length: int, /) -> None:
        """Cuts the file off after `length` bytes."""
        ...

    def close(self) -> None:
        """Closes it; what was not synced may be lost with the power."""
        ...


class Disk(Protocol):
    """Who makes files."""

    def create(self, path: Path) -> LogFile:
        """A file that did not exist before, its name on the disk. Raises FileExistsError, and OSError."""
        ...

    def reopen(self, path: Path) -> LogFile:
        """A file that exists, to be gone on with at its end. Raises FileNotFoundError, and OSError."""
        ...

    def sync_folder(self, folder: Path) -> None:
        """Returns when the names in `folder` are on the disk."""
        ...


class SystemFile:
    """A file of the operating system, by its descriptor."""

    __slots__ = ("_handle", "sync", "truncate", "write")

    def __init__(self, handle: int) -> None:
        self._handle = handle
        self.write = partial(os.write, handle)  # no call of ours in between: this is where most of the time goes
        self.sync = partial(sync_data, handle)
        self.truncate = partial(os.ftruncate, handle)

    def close(self) -> None:
        """Closes it."""
        os.close(self._handle)


class SystemDisk:
    """The disks of this machine."""

    def create(self, path: Path) -> LogFile:
        """See `Disk`."""
        return SystemFile(open_new(path))

    def reopen(self, path: Path) -> LogFile:
        """See `Disk`."""
        return SystemFile(os.open(path, _ON))

    def sync_folder(self, folder: Path) -> None:
        """See `Disk`."""
        sync_folder(folder)


SYSTEM = SystemDisk()
