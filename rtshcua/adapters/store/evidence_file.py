"""How evidence reaches the disk: the file of a log, the disk (which tests replace), and the thread that writes.

All evidence that is written in flight, the log and the raw frames, passes `Disk`. The flying thread never waits for the
disk: it hands lines to `EvidenceWriter`, whose thread owns the file (docs/adr/0016).
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


#: Evidence fails once more lines than this wait for the disk. None is dropped, because the chain has no gaps: while
#: the flight comes down, up to `TIMES_MOST` times as many may wait.
MOST_WAITING = 1_000
TIMES_MOST = 64
#: What was written is synced once nothing has come for this time, in seconds, so that a sync stands in nobody's way.
SYNC_S = 0.2
#: a disk that hangs is waited for this long at the end, in seconds
CLOSE_S = 10.0
#: A line of class `SYNCED` is synced this long after it was taken at the latest, in seconds: half of what is promised,
#: for the sync takes its time too.
SYNC_AFTER_S = SYNC_US / 1e6 / 2
#: A line that was to be on the disk within `SYNC_US` and is not is told; when it is not after this time, in seconds,
#: the disk counts as failed: it hangs.
STUCK_S = 5.0
#: Who looks after a longer time than this, in seconds, stood still meanwhile, and with it the thread that writes: that
#: says nothing of the disk. A loop that goes on looks far more often.
STOOD_S = 1.0

_BEHIND = OSError(errno.ENOBUFS, "the disk is too slow for the log")
_OVER = OSError(errno.ENOSPC, "the disk did not keep up: the log ends before this record")


class EvidenceWriter:
    """The `EvidenceSink` over a file. Lines are written in the order in which they were appended, each as soon as the
    disk lets it, those that wait together with one sync.

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
        """How many lines were taken over, or should have been, and are not kept."""
        return self._given - self._keeper.written

    def append(self, line: bytes, durability: int) -> int:
        """Takes one line over; see `EvidenceSink`. Raises OSError when too many wait: it is written all the same,
        unless so many wait that the log must end, and then before the first that was not taken over.
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
        """Why lines are not kept, once for each failure of the disk."""
        if not self._keeper.troubles.empty():  # nobody else takes from it
            return self._keeper.troubles.get_nowait()
        return self._overdue(self._lateness.stuck)

    def late(self) -> str | None:
        """That a line was not on the disk in time, once for each time that it falls behind."""
        return self._overdue(self._lateness.late)

    def _overdue(self, judge: Callable[[int, float], str | None]) -> str | None:
        keeper = self._keeper
        if keeper.failing or self._lateness.kept(keeper.synced):
            return None
        return judge(keeper.synced, monotonic())

    def settle(self) -> None:
        """Waits until all that was given is on the disk. Raises OSError when it is not, or not in time."""
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
        """Waits until all that can be written is, and closes the file. Raises OSError, also when the disk does not
        answer: what is left is then left to the thread, and not counted as kept. Closing twice does nothing.
        """
        if self._thread is None:
            return
        self._queue.put(None)
        self._thread = None
        if not self._over.wait(self._close_s):
            raise self._hangs()
        if self._last_error is not None:
            raise self._last_error

    # -------------------------------------------------------- in the thread

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
        """All lines that wait, after at least one came or something is due; False when no more will come."""
        batch: list[tuple[bytes, int]] = []
        with suppress(Empty):
            item = self._queue.get(timeout=self._sync_s if self._keeper.busy else None)
            while item is not None:
                batch.append(item)
                item = self._queue.get_nowait()
            return batch, False
        return batch, True


class Keeper:
    """Feeds one evidence file. `written` and `synced` count lines from the first on, and never more than is certain.

    They may be read in another thread. `troubles` is what the disk refused, in its words, each refusal once. It neither
    waits nor looks at a clock: the writer's thread does, or a test.
    """

    def __init__(self, file: EvidenceFile, *, sync_after_s: float = SYNC_AFTER_S) -> None:
        self.file = file
        self.written = self.synced = 0
        self.troubles: SimpleQueue[str] = SimpleQueue()
        self._sync_after_s = sync_after_s
        self._taken = 0
        self._unsynced = False  # something was written since the last sync
        self._promised_s: float | None = None  # since when a line waits that is to be synced
        self._refused = False  # lines wait that the disk did not take
        self._doubtful = False  # a sync failed: what is durable is not known any more

    @property
    def busy(self) -> bool:
        """Whether something is left to be written or synced."""
        return self._unsynced or self.file.waiting > 0

    @property
    def failing(self) -> bool:
        """Whether the disk refused something, and not all of that was made good."""
        return self._doubtful or self._refused

    def take(self, batch: Sequence[tuple[bytes, int]], now_s: float) -> None:
        """Takes lines over, each with its class of durability, in their order; syncs if one asks for it, or it is time.

        Without lines: nothing came for a while, and all that is left is written and synced.
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
            with suppress(OSError):  # it was told when it was refused first
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
        """Nothing that comes from here on can be believed."""
        self._doubtful = True
        self.troubles.put(reason)

    def close(self) -> None:
        """Writes and syncs what it can, and closes the file. Raises OSError."""
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
    """Watches over the sync of lines, one at a time: the next is the last that was given when the one before came true.

    Times are in seconds of the caller's clock, which never goes back. A time in which nobody looked does not count: the
    whole process stood still.
    """

    def __init__(self, late_s: float = SYNC_US / 1e6, stuck_s: float = STUCK_S) -> None:
        self._late_s, self._stuck_s = late_s, stuck_s
        self._promised = 0  # the last line that is to be synced,
        self._watched = 0  # the one that is watched,
        self._since_s = 0.0  # since when,
        self._told_s = 0.0  # and after how long it was told to be late
        self._looked_s = 0.0  # when somebody looked last

    def given(self, number: int, durability: int) -> None:
        """Line `number`, counted from 1, was given to the disk."""
        if durability >= SYNCED:
            self._promised = number

    def kept(self, synced: int) -> bool:
        """Whether all that was promised came true: then neither `late` nor `stuck` has anything to say."""
        return self._promised <= synced

    def late(self, synced: int, now_s: float) -> str | None:
        """That a line is late, once for each time that the disk falls behind; `synced` lines are on it."""
        if self._told_s or self._waited_s(synced, now_s) <= self._late_s:
            return None
        self._told_s = self._late_s
        return f"a write did not reach the disk within {SYNC_US // 1_000} ms"

    def stuck(self, synced: int, now_s: float) -> str | None:
        """That the disk hangs, once for each time that it does."""
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
