"""A disk that can fail at any operation, and whose power can be cut. The files are real; synced content is recorded.

In a power cut unsynced data is lost page by page, at random: each page has either the old octets
are there or the new ones, or zeros where the file was shorter; the file ends anywhere between its old end and its new.
"""

import errno
import os
from collections.abc import Callable
from pathlib import Path
from random import Random

PAGE = 4096


class Died(BaseException):
    """The process has died and must not continue."""


class PowerDisk:
    """A `Disk`. `fault` returns the fault of each operation, by its number from 0 and its name:

    `""` nothing; `refused` OSError; `short` half is written (of a write); `failed` so too, and the next operation is
    refused; `died` the process dies before it; `torn` it dies within it, half done; `late` it dies once it is done.
    """

    def __init__(self, fault: Callable[[int, str], str] = lambda number, name: "") -> None:
        self.fault = fault
        self.operations = 0
        self._synced: dict[Path, bytes] = {}
        self.doubtful = False  # after a failed sync the content after a power cut is undefined
        self._dead = self._full = False

    def create(self, path: Path) -> "PowerFile":
        with_half = self._begin("create")
        handle = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_EXCL, 0o644)
        self._synced[path] = b""
        self._end(with_half)
        return PowerFile(self, path, handle)

    def reopen(self, path: Path) -> "PowerFile":
        with_half = self._begin("reopen")
        handle = os.open(path, os.O_RDWR | os.O_APPEND)
        self._synced.setdefault(path, path.read_bytes())
        self._end(with_half)
        return PowerFile(self, path, handle)

    def sync_folder(self, folder: Path) -> None:
        self._end(self._begin("sync_folder"))

    def synced(self, path: Path) -> bytes:
        """The content of a file that survives any failure."""
        return self._synced[path]

    def cut_power(self, chance: Random) -> None:
        """Cut the power: the files get the content that survived, and their writers no longer exist."""
        for path, old in self._synced.items():
            if path.exists():
                path.write_bytes(_survives(old, path.read_bytes(), chance))

    def _begin(self, name: str) -> str:
        if self._dead:
            raise Died
        what = self.fault(self.operations, name)
        self.operations += 1
        if what == "died" or (what == "torn" and name != "write"):
            self._dead = True
            raise Died
        full, self._full = self._full, False
        if full or what == "refused" or (what == "failed" and name != "write"):
            self.doubtful = self.doubtful or name == "sync"
            raise OSError(errno.EIO, "refused")
        return what

    def _end(self, what: str) -> None:
        if what == "late":
            self._dead = True
            raise Died


class PowerFile:
    """A file on such a disk."""

    def __init__(self, disk: PowerDisk, path: Path, handle: int) -> None:
        self._disk, self._path, self._handle = disk, path, handle

    def write(self, data: bytes | memoryview, /) -> int:
        what = self._disk._begin("write")
        half = what in ("short", "failed", "torn")
        count = os.write(self._handle, data[: len(data) // 2] if half else data)
        self._disk._full = what == "failed"
        self._disk._end("late" if what == "torn" else what)
        return count

    def sync(self) -> None:
        what = self._disk._begin("sync")
        self._disk._synced[self._path] = self._path.read_bytes()
        self._disk._end(what)

    def truncate(self, length: int, /) -> None:
        what = self._disk._begin("truncate")
        os.ftruncate(self._handle, length)
        self._disk._end(what)

    def close(self) -> None:
        if self._handle >= 0:
            os.close(self._handle)
            self._handle = -1


def _survives(old: bytes, new: bytes, chance: Random) -> bytes:
    if old == new:
        return old
    size = chance.choice((len(old), len(new), chance.randint(*sorted((len(old), len(new))))))
    before, after = old.ljust(size, b"\0"), new.ljust(size, b"\0")
    taken = chance.choice((0.0, 0.5, 0.9, 1.0))
    pages = []
    for start in range(0, size, PAGE):
        source = after if chance.random() < taken else before
        pages.append(source[start : min(start + PAGE, size)])
    return b"".join(pages)
