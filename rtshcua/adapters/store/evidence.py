"""The file that evidence lines go to, and the door between the evidence and the disk, in which tests put faults.

Whatever of the evidence is written while it flies goes through that door: the log, and the raw frames. Who must not
wait for the disk writes to it through `writer`.
"""

import os
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Protocol

from rtshcua.adapters.store.writing import open_existing, open_new, sync_data, sync_folder
from rtshcua.evidence.records import is_signed
from rtshcua.model.durability import BUFFERED, SYNCED_FIRST

#: as many buffered lines are written together at the latest
MOST_BUFFERED = 256


class LogFile(Protocol):
    """An open file. Each method raises OSError when the system refuses."""

    def write(self, data: bytes | memoryview, /) -> int:
        """Appends bytes, as many as the system takes at once; how many that were."""

    def sync(self) -> None:
        """Returns when what was written is on the disk."""

    def truncate(self, length: int, /) -> None:
        """Cuts the file off after `length` bytes."""

    def close(self) -> None:
        """Closes it; what was not synced may be lost with the power."""


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


class Disk:
    """The disks of this machine; a test's does worse."""

    def create(self, path: Path) -> LogFile:
        """A file that did not exist before, its name on the disk. Raises FileExistsError, and OSError."""
        return SystemFile(open_new(path))

    def reopen(self, path: Path) -> LogFile:
        """A file that exists, to be gone on with at its end. Raises FileNotFoundError, and OSError."""
        return SystemFile(open_existing(path))

    def sync_folder(self, folder: Path) -> None:
        """Returns when the names in `folder` are on the disk."""
        sync_folder(folder)


SYSTEM = Disk()


def write_all(file: LogFile, data: bytes) -> None:
    """Writes every byte, however often the system takes only some of them."""
    view = memoryview(data)
    while view:
        view = view[file.write(view) :]


class EvidenceFile:
    """A log that is only ever appended to, and never replaces another: raises FileExistsError when `path` is there.

    The disk may refuse a line. It is then kept, so that the chain has no hole, and written before the next one or when
    the file is closed. What the disk took of a refused line is cut off again, so the log ends between two records.
    """

    __slots__ = ("_file", "_length", "_open", "_sync_error", "_taken", "_waiting", "_write", "path")

    def __init__(self, path: Path, disk: Disk = SYSTEM) -> None:
        self.path = path
        self._file = disk.create(path)
        self._write = self._file.write
        self._open = True
        self._length = 0  # of the whole lines in the file
        self._taken = 0  # bytes of the first waiting line that stand after them
        self._waiting: list[bytes] = []
        self._sync_error: OSError | None = None

    @property
    def waiting(self) -> int:
        """How many lines are not in the file yet: refused by the disk, or buffered."""
        return len(self._waiting)

    def append(self, line: bytes, durability: int) -> None:
        """Takes one line over, and returns when it is as durable as this class of `evidence.durability` says: buffered,
        written, or (synced first) on the disk. To sync what class `SYNCED` promises is the caller's part.

        Raises OSError when this line or one before it could not be written, and, for one to be synced, from the first
        sync that failed on: what the system then reports of the disk cannot be believed any more.
        """
        if self._waiting or durability == BUFFERED:
            self._waiting.append(line)
            if durability == BUFFERED and len(self._waiting) < MOST_BUFFERED:
                return
            self.flush()
        else:
            try:
                taken = self._write(line)
            except OSError:
                self._waiting.append(line)
                raise
            if taken == len(line):
                self._length += taken
            else:
                self._waiting.append(line)
                self._taken = taken
                self.flush()
        if durability == SYNCED_FIRST:
            self.sync()

    def flush(self) -> None:
        """Writes what waits. Raises OSError where the disk refuses it still."""
        waiting = self._waiting
        while waiting:
            data = self._together()
            try:
                self._count(self._write(data[self._taken :] if self._taken else data))
            except OSError:
                self._cut()
                raise

    def _together(self) -> bytes:
        """What is written at once of what waits: up to the next signed record."""
        batch = self._waiting[:MOST_BUFFERED]
        if is_signed(batch[0]):
            self.settle()
            return batch[0]
        signed = next((number for number, line in enumerate(batch) if is_signed(line)), len(batch))
        return b"".join(batch[:signed])

    def settle(self) -> None:
        """Syncs what is in the file, before a signed record is: recovery counts on it that a power cut leaves no damage
        before one. A disk that refuses does not stop the record; it is told at the next sync.
        """
        with suppress(OSError):
            self.sync()

    def _count(self, taken: int) -> None:
        """So many more bytes of what waits are in the file."""
        taken += self._taken
        whole = 0
        for line in self._waiting:
            if taken < len(line):
                break
            taken -= len(line)
            self._length += len(line)
            whole += 1
        self._taken = taken
        del self._waiting[:whole]

    def _cut(self) -> None:
        """Takes the beginning of a refused line off again; where even that is refused, the line goes on from there."""
        if self._taken:
            with suppress(OSError):
                self._file.truncate(self._length)
                self._taken = 0

    def sync(self) -> None:
        """Returns when what was written is on the disk. Raises OSError, and from the first time on always."""
        if self._sync_error is not None:
            raise self._sync_error
        try:
            self._file.sync()
        except OSError as error:
            self._sync_error = error
            raise

    def close(self) -> None:
        """Writes what waits, syncs, and closes, also when the first two fail. Closing twice does nothing."""
        if not self._open:
            return
        try:
            self.flush()
            self.sync()
        finally:
            self._open = False
            self._file.close()
