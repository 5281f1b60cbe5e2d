"""A disk for the evidence's file port with faults that a test controls."""

import errno
import os
from collections.abc import Callable
from pathlib import Path
from threading import Event

from rtshcua.adapters.store.evidence_file import SYSTEM, LogFile

PATIENCE_S = 20.0


class FaultyDisk:
    """A disk that forwards to the real one, with injected faults.

    `room` is the number of bytes still accepted, `step` that of each call. An error number in `failing`, by the name of
    a method, is the error of each call; `once` has those of the next calls, None for one that succeeds. An event
    cleared in `open` (`write`, `sync`) blocks until it is set. `durable` is how many bytes of each file survive a power
    cut.
    """

    def __init__(self, room: int = 1 << 40, step: int = 1 << 30) -> None:
        self.room, self.step = room, step
        self.failing: dict[str, int] = {}
        self.once: dict[str, list[int | None]] = {}
        self.open = {"write": Event(), "sync": Event()}
        for gate in self.open.values():
            gate.set()
        self.calls: list[str] = []
        self.durable: dict[Path, int] = {}

    def create(self, path: Path) -> LogFile:
        self.ask("create")
        return FaultyFile(self, SYSTEM.create(path), path)

    def reopen(self, path: Path) -> LogFile:
        self.ask("reopen")
        return FaultyFile(self, SYSTEM.reopen(path), path)

    def sync_folder(self, folder: Path) -> None:
        self.ask("sync_folder")

    def ask(self, method: str) -> None:
        """Record a call, and hang or fail if requested."""
        gate = self.open.get(method)
        assert gate is None or gate.wait(PATIENCE_S)
        self.calls.append(method)
        left = self.once.get(method)
        number = left.pop(0) if left else self.failing.get(method)
        if number is not None:
            raise OSError(number, os.strerror(number))

    def heal(self) -> None:
        """Remove all faults."""
        self.failing.clear()
        self.once.clear()
        self.room, self.step = 1 << 40, 1 << 30
        for gate in self.open.values():
            gate.set()

    @property
    def synced(self) -> int:
        """Return the number of syncs."""
        return self.calls.count("sync")


class FaultyFile:
    """A file on such a disk."""

    def __init__(self, disk: FaultyDisk, file: LogFile, path: Path) -> None:
        self._disk, self._file, self._path = disk, file, path
        disk.durable[path] = 0

    def write(self, data: bytes | memoryview, /) -> int:
        disk = self._disk
        disk.ask("write")
        take = min(len(data), disk.step, disk.room)
        if data and not take:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        disk.room -= take
        return self._file.write(data[:take])

    def sync(self) -> None:
        self._disk.ask("sync")
        self._disk.durable[self._path] = self._path.stat().st_size

    def truncate(self, length: int, /) -> None:
        self._disk.ask("truncate")
        self._disk.room += max(0, self._path.stat().st_size - length)
        self._file.truncate(length)

    def close(self) -> None:
        self._disk.ask("close")
        self._file.close()


def until(holds: Callable[[], bool]) -> None:
    """Let another thread run until a condition holds."""
    pause, left = Event(), 2_000
    while not holds():
        left -= 1
        assert left, "it never came"
        pause.wait(0.01)
