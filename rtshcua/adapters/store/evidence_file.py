"""Write evidence to the disk: the file of a log, the disk (which tests replace), and the writing thread.

All evidence of a flight, the log and the raw frames, passes `Disk`. The flying thread never waits for the disk: it
hands lines to `EvidenceWriter`, whose thread owns the file (docs/adr/0016).
"""

import errno
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Event, Thread
from time import monotonic
from typing import Protocol

from rtshcua.adapters.store.writing import open_existing, open_new, sync_data, sync_folder
from rtshcua.evidence.records import is_signed
from rtshcua.model.durability import BUFFERED, SYNC_US, SYNCED, SYNCED_FIRST, WRITTEN

#: the most buffered lines that are written together
MOST_BUFFERED = 256


class LogFile(Protocol):
    """An open file. Each method raises OSError when the system refuses."""

    def write(self, data: bytes | memoryview, /) -> int:
        """Append bytes; return how many the system accepted."""

    def sync(self) -> None:
        """Return once the written data is on the disk."""

    def truncate(self, length: int, /) -> None:
        """Cut the file off after `length` bytes."""

    def close(self) -> None:
        """Close the file; data that was not synced may be lost in a power failure."""


class SystemFile:
    """A file of the operating system, by its descriptor."""

    __slots__ = ("_handle", "sync", "truncate", "write")

    def __init__(self, handle: int) -> None:
        self._handle = handle
        self.write = partial(os.write, handle)  # no Python call in between: most of the time is spent here
        self.sync = partial(sync_data, handle)
        self.truncate = partial(os.ftruncate, handle)

    def close(self) -> None:
        """Closes it."""
        os.close(self._handle)


class Disk:
    """The disks of this machine; tests replace it by faulty ones."""

    def create(self, path: Path) -> LogFile:
        """Create a file, its name synced. Raises FileExistsError, and OSError."""
        return SystemFile(open_new(path))

    def reopen(self, path: Path) -> LogFile:
        """Open an existing file, to append to it. Raises FileNotFoundError, and OSError."""
        return SystemFile(open_existing(path))

    def sync_folder(self, folder: Path) -> None:
        """Return once the names in `folder` are on the disk."""
        sync_folder(folder)


SYSTEM = Disk()


def write_all(file: LogFile, data: bytes) -> None:
    """Write every byte, in as many calls as the system needs."""
    view = memoryview(data)
    while view:
        view = view[file.write(view) :]


class EvidenceFile:
    """A log that is only ever appended to and never replaces another: raises FileExistsError when `path` exists.

    A line that the disk refuses is kept, so that the chain has no gap, and written before the next one or when the file
    is closed. The written part of a refused line is cut off again, so the log ends between two records.
    """

    __slots__ = ("_file", "_length", "_open", "_sync_error", "_taken", "_waiting", "_write", "path")

    def __init__(self, path: Path, disk: Disk = SYSTEM) -> None:
        self.path = path
        self._file = disk.create(path)
        self._write = self._file.write
        self._open = True
        self._length = 0  # the size of the whole lines in the file
        self._taken = 0  # the bytes of the first waiting line that are already in the file
        self._waiting: list[bytes] = []
        self._sync_error: OSError | None = None

    @property
    def waiting(self) -> int:
        """How many lines are not in the file yet: refused by the disk, or buffered."""
        return len(self._waiting)

    def append(self, line: bytes, durability: int) -> None:
        """Take over one line, and return when it is as durable as its class of `evidence.durability` requires:
        buffered, written, or (synced first) on the disk. The caller has to sync lines of class `SYNCED`.

        Raises OSError when this line or one before it could not be written and, for a line to be synced, after any
        failed sync: later reports of the system about this disk are not reliable.
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
        """Write the waiting lines. Raises OSError where the disk still refuses."""
        waiting = self._waiting
        while waiting:
            data = self._together()
            try:
                self._count(self._write(data[self._taken :] if self._taken else data))
            except OSError:
                self._cut()
                raise

    def _together(self) -> bytes:
        """The waiting lines to write at once: up to the next signed record."""
        batch = self._waiting[:MOST_BUFFERED]
        if is_signed(batch[0]):
            self.settle()
            return batch[0]
        signed = next((number for number, line in enumerate(batch) if is_signed(line)), len(batch))
        return b"".join(batch[:signed])

    def settle(self) -> None:
        """Sync the file before a signed record: recovery relies on it that a power failure damages nothing before one.
        A refusal does not stop the record; the next sync reports it.
        """
        with suppress(OSError):
            self.sync()

    def _count(self, taken: int) -> None:
        """Note that this many more bytes of the waiting lines are in the file."""
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
        """Cut the beginning of a refused line off; where that is refused too, the line is continued from there."""
        if self._taken:
            with suppress(OSError):
                self._file.truncate(self._length)
                self._taken = 0

    def sync(self) -> None:
        """Return once the written lines are on the disk. Raises OSError, and after the first failure always."""
        if self._sync_error is not None:
            raise self._sync_error
        try:
            self._file.sync()
        except OSError as error:
            self._sync_error = error
            raise

    def close(self) -> None:
        """Write the waiting lines, sync and close, even if the first two fail. Closing twice does nothing."""
        if not self._open:
            return
        try:
            self.flush()
            self.sync()
        finally:
            self._open = False
            self._file.close()


#: Evidence fails once more lines than this wait for the disk. None is dropped, because the chain has no gaps: while
#: the flight comes down, up to `TIMES_MOST` times as many may wait.
MOST_WAITING = 1_000
TIMES_MOST = 64
#: Written lines are synced after this many idle seconds, so that a sync delays nothing.
SYNC_S = 0.2
#: how long to wait for a hanging disk at the end, in seconds
CLOSE_S = 10.0
#: The latest sync of a line of class `SYNCED`, in seconds after it was taken over: half of the promised time, because
#: the sync takes time too.
SYNC_AFTER_S = SYNC_US / 1e6 / 2
#: A line that is not on the disk within `SYNC_US` is reported; after this time, in seconds, the disk counts as failed.
STUCK_S = 5.0
#: A check after a longer pause than this, in seconds, proves nothing about the disk: the process stood still, and the
#: writing thread with it. A running loop checks far more often.
STOOD_S = 1.0

_BEHIND = OSError(errno.ENOBUFS, "the disk is too slow for the log")
_OVER = OSError(errno.ENOSPC, "the disk did not keep up: the log ends before this record")


class EvidenceWriter:
    """The `EvidenceSink` over a file. Lines are written in order, as soon as the disk allows, and waiting lines are
    synced together.

    `append`, `trouble`, `late` and `close` are for one thread. `SimpleQueue.put` takes no lock that the writer might
    hold.
    """

    def __init__(
        self, file: EvidenceFile, *, most_waiting: int = MOST_WAITING, sync_s: float = SYNC_S,
        sync_after_s: float = SYNC_AFTER_S, stuck_s: float = STUCK_S, close_s: float = CLOSE_S,
    ) -> None:  # fmt: skip
        self._keeper = Keeper(file, sync_after_s=sync_after_s)
        self._most = most_waiting
        self._sync_s = sync_s
        self._lateness = Lateness(sync_after_s * 2, stuck_s)
        self._close_s = close_s
        self._queue: SimpleQueue[tuple[bytes, int] | None] = SimpleQueue()
        self._given = 0
        self._cut = False
        self._over = Event()
        self._last_error: OSError | None = None
        self._thread: Thread | None = Thread(target=self._run, name="evidence", daemon=True)
        self._thread.start()

    @property
    def kept(self) -> int:
        """How many lines, from the first on, are in the file."""
        return self._keeper.written

    @property
    def synced(self) -> int:
        """How many lines, from the first on, are on the disk."""
        return self._keeper.synced

    @property
    def waiting(self) -> int:
        """How many lines were taken over, or should have been, and are not in the file."""
        return self._given - self._keeper.written

    def append(self, line: bytes, durability: int) -> int:
        """Take over one line; see `EvidenceSink`. Raises OSError when too many lines wait. The line is written all the
        same, unless so many wait that the log must end; then it ends before the first line that was not taken over.
        """
        self._given += 1
        waiting = self.waiting
        self._cut = self._cut or waiting > self._most * TIMES_MOST or self._thread is None
        if self._cut:
            raise _OVER
        self._queue.put((line, durability))
        self._lateness.given(self._given, durability)
        if waiting > self._most:
            raise _BEHIND
        return self._given

    def trouble(self) -> str | None:
        """Why lines are not written, once for each failure of the disk."""
        if not self._keeper.troubles.empty():  # only this thread takes from it
            return self._keeper.troubles.get_nowait()
        return self._overdue(self._lateness.stuck)

    def late(self) -> str | None:
        """That a line was not on the disk in time, once each time the disk falls behind."""
        return self._overdue(self._lateness.late)

    def _overdue(self, judge: Callable[[int, float], str | None]) -> str | None:
        keeper = self._keeper
        if keeper.failing or self._lateness.kept(keeper.synced):
            return None
        return judge(keeper.synced, monotonic())

    def settle(self) -> None:
        """Wait until all lines are on the disk. Raises OSError when they are not, or not in time."""
        until_s = monotonic() + self._close_s
        while self._keeper.synced < self._given:
            if self._keeper.failing:
                raise OSError(errno.EIO, self.trouble() or "the disk does not accept all data")
            if monotonic() > until_s:
                raise self._hangs()
            self._over.wait(0.001)

    def _hangs(self) -> OSError:
        return OSError(errno.ETIMEDOUT, f"the disk has not answered for {self._close_s:g} s")

    def close(self) -> None:
        """Wait until all possible lines are written, and close the file. Raises OSError, also when the disk does not
        answer: the remaining lines are then left to the thread, and do not count as kept. Closing twice does nothing.
        """
        if self._thread is None:
            return
        self._queue.put(None)
        self._thread = None
        if not self._over.wait(self._close_s):
            raise self._hangs()
        if self._last_error is not None:
            raise self._last_error

    # -------------------------------------------------------- in the writing thread

    def _run(self) -> None:
        keeper = self._keeper
        try:
            going = True
            while going:
                batch, going = self._next()
                if batch or going:
                    keeper.take(batch, monotonic())
        except Exception as error:  # noqa: BLE001  a thread that dies in silence would leave the flight unrecorded
            keeper.fail(str(error))
        try:
            keeper.close()
        except OSError as error:
            self._last_error = error
        finally:
            self._over.set()

    def _next(self) -> tuple[list[tuple[bytes, int]], bool]:
        """The waiting lines, after at least one came or something is due; False when no more will come."""
        batch: list[tuple[bytes, int]] = []
        with suppress(Empty):
            item = self._queue.get(timeout=self._sync_s if self._keeper.busy else None)
            while item is not None:
                batch.append(item)
                item = self._queue.get_nowait()
            return batch, False
        return batch, True


class Keeper:
    """Writes one evidence file. `written` and `synced` count lines from the first on, and never more than is certain.
    Another thread may read them. `troubles` holds the disk's errors, each once.

    It neither waits nor reads a clock: the writer's thread does, or a test.
    """

    def __init__(self, file: EvidenceFile, *, sync_after_s: float = SYNC_AFTER_S) -> None:
        self.file = file
        self.written = self.synced = 0
        self.troubles: SimpleQueue[str] = SimpleQueue()
        self._sync_after_s = sync_after_s
        self._taken = 0
        self._unsynced = False  # lines were written since the last sync
        self._promised_s: float | None = None  # since when a line waits to be synced
        self._refused = False  # lines wait that the disk refused
        self._doubtful = False  # a sync failed: it is unknown what is durable

    @property
    def busy(self) -> bool:
        """Whether lines are left to write or sync."""
        return self._unsynced or self.file.waiting > 0

    @property
    def failing(self) -> bool:
        """Whether a refused line is not written yet."""
        return self._doubtful or self._refused

    def take(self, batch: Sequence[tuple[bytes, int]], now_s: float) -> None:
        """Take over lines, each with its durability class, in order; sync if one requires it, or if it is time. Without
        lines nothing came for a while, and everything left is written and synced.
        """
        self._taken += len(batch)
        highest = WRITTEN
        refused: OSError | None = None
        for line, durability in batch:
            highest = max(highest, durability)
            if durability == SYNCED_FIRST and is_signed(line):
                self.file.settle()
            try:
                self.file.append(line, min(durability, WRITTEN))
            except OSError as error:
                refused = error
        if not batch:
            with suppress(OSError):  # the refusal was reported already
                self.file.flush()
        if refused is not None:
            self._tell(refused)
        self._refused = self.file.waiting > 0 and (self._refused or refused is not None)
        self._unsynced = self._unsynced or bool(batch)
        if highest >= SYNCED and self._promised_s is None:
            self._promised_s = now_s
        self._count()
        if highest == SYNCED_FIRST or not batch or self._overdue(now_s):
            self._sync(now_s)

    def fail(self, reason: str) -> None:
        """Note that later results are not reliable."""
        self._doubtful = True
        self.troubles.put(reason)

    def close(self) -> None:
        """Write and sync what is possible, and close the file. Raises OSError."""
        try:
            self.file.close()
        finally:
            self._count()
        if not self._doubtful:
            self.synced = self.written

    def _overdue(self, now_s: float) -> bool:
        return self._promised_s is not None and now_s - self._promised_s >= self._sync_after_s

    def _sync(self, now_s: float) -> None:
        if not self._unsynced:
            return
        waiting = self.file.waiting
        try:
            self.file.sync()
        except OSError as error:
            if not self._doubtful:
                self._tell(error)
            self._doubtful = True
        self._unsynced = waiting > 0
        self._promised_s = now_s if waiting and self._promised_s is not None else None
        if not self._doubtful:
            self.synced = self.written

    def _count(self) -> None:
        if not self._doubtful:
            self.written = self._taken - self.file.waiting

    def _tell(self, error: OSError) -> None:
        self.troubles.put(error.strerror or str(error))


class Lateness:
    """Supervises the sync of lines, one at a time: after a line was synced, the last one taken over is next.

    Times are in seconds of the caller's clock, which never goes back. Time between two distant calls does not count:
    the whole process stood still.
    """

    def __init__(self, late_s: float = SYNC_US / 1e6, stuck_s: float = STUCK_S) -> None:
        self._late_s, self._stuck_s = late_s, stuck_s
        self._promised = 0  # the last line to be synced
        self._watched = 0  # the supervised line
        self._since_s = 0.0  # since when it is supervised
        self._told_s = 0.0  # the delay that was last reported
        self._looked_s = 0.0  # the time of the last call

    def given(self, number: int, durability: int) -> None:
        """Note that line `number`, counted from 1, was handed to the disk."""
        if durability >= SYNCED:
            self._promised = number

    def kept(self, synced: int) -> bool:
        """Whether every promised sync is done: then `late` and `stuck` have nothing to report."""
        return self._promised <= synced

    def late(self, synced: int, now_s: float) -> str | None:
        """That a line is late, once each time the disk falls behind; `synced` lines are on the disk."""
        if self._told_s or self._waited_s(synced, now_s) <= self._late_s:
            return None
        self._told_s = self._late_s
        return f"a write did not reach the disk within {SYNC_US // 1_000} ms"

    def stuck(self, synced: int, now_s: float) -> str | None:
        """That the disk hangs, once each time it does."""
        if self._waited_s(synced, now_s) <= self._stuck_s or self._told_s >= self._stuck_s:
            return None
        self._told_s = self._stuck_s
        return f"the disk has not answered for {self._stuck_s:g} s"

    def _waited_s(self, synced: int, now_s: float) -> float:
        stood_s, self._looked_s = now_s - self._looked_s, now_s
        if self._promised <= synced:
            return 0.0
        if self._watched <= synced:
            self._watched, self._since_s, self._told_s = self._promised, now_s, 0.0
        elif stood_s > STOOD_S:
            self._since_s += stood_s
        return now_s - self._since_s
