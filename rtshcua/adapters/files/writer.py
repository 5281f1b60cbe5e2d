"""Evidence off the reflex path: a thread that owns the evidence file, fed without waiting (docs/adr/0016)."""

import errno
from contextlib import suppress
from queue import Empty, SimpleQueue
from threading import Thread
from time import monotonic

from rtshcua.adapters.files.evidence import EvidenceFile

#: More lines than this that are not kept mean that the disk does not keep up, and evidence fails. They are not dropped,
#: for the chain has no holes: it goes on, while the flight comes down, up to `TIMES_MOST` times as many.
MOST_WAITING = 1_000
TIMES_MOST = 64
#: What was written is synced once nothing has come for this time, in seconds, so that a sync stands in nobody's way;
#: and `TIMES_LONGEST` times as much after it was written at the latest.
SYNC_S = 0.2
TIMES_LONGEST = 5

_BEHIND = OSError(errno.ENOBUFS, "the disk does not keep up")
_OVER = OSError(errno.ENOSPC, "the disk did not keep up, and the log ends before this")


class EvidenceWriter:
    """The `EvidenceSink` over a file. Lines are written in the order in which they were appended, each as soon as the
    disk lets it, those that wait together with one sync.

    `append`, `trouble` and `close` are for one thread. `SimpleQueue.put` takes no lock that the writer might hold.
    """

    def __init__(self, file: EvidenceFile, *, most_waiting: int = MOST_WAITING, sync_s: float = SYNC_S) -> None:
        self._file = file
        self._most = most_waiting
        self._sync_s = sync_s
        self._queue: SimpleQueue[tuple[bytes, bool] | None] = SimpleQueue()
        self._troubles: SimpleQueue[str] = SimpleQueue()
        self._given = self._kept = 0
        self._cut = False
        self._taken = 0  # by the thread
        self._unsynced_s: float | None = None  # since when there is something to sync
        self._doubtful = False  # a sync failed: what is durable is not known any more
        self._thread: Thread | None = Thread(target=self._run, name="evidence", daemon=True)
        self._thread.start()

    @property
    def kept(self) -> int:
        """How many lines, from the first on, are in the file, and those that were to be durable on the disk."""
        return self._kept

    @property
    def waiting(self) -> int:
        """How many lines were taken over, or should have been, and are not kept."""
        return self._given - self._kept

    def append(self, line: bytes, durable: bool) -> int:
        """Takes one line over; see `EvidenceSink`. Raises OSError when too many wait: it is written all the same,
        unless so many wait that the log must end, and then before the first that was not taken over.
        """
        self._given += 1
        waiting = self.waiting
        self._cut = self._cut or waiting > self._most * TIMES_MOST or self._thread is None
        if self._cut:
            raise _OVER
        self._queue.put((line, durable))
        if waiting > self._most:
            raise _BEHIND
        return self._given

    def trouble(self) -> str | None:
        """Why lines are not kept, once for each failure of the disk."""
        try:
            return self._troubles.get_nowait()
        except Empty:
            return None

    def close(self) -> None:
        """Waits until all that can be written is, and closes the file. Raises OSError. Closing twice does nothing."""
        if self._thread is None:
            return
        self._queue.put(None)
        self._thread.join()
        self._thread = None
        try:
            self._file.close()
        finally:
            self._count()

    # -------------------------------------------------------- in the thread

    def _run(self) -> None:
        try:
            while self._turn():
                pass
        except Exception as error:  # noqa: BLE001  a thread that dies in silence would leave the flight unrecorded
            self._doubtful = True
            self._troubles.put(str(error))

    def _turn(self) -> bool:
        batch, going = self._next()
        self._write([line for line, _ in batch])
        durable = any(asked for _, asked in batch)
        if not durable:
            self._count()
        if durable or not batch or self._overdue():
            self._sync()
        self._count()
        return going

    def _next(self) -> tuple[list[tuple[bytes, bool]], bool]:
        """All lines that wait, after at least one came or something is due; False when no more will come."""
        due = self._unsynced_s is not None or self._file.waiting
        batch: list[tuple[bytes, bool]] = []
        with suppress(Empty):
            item = self._queue.get(timeout=self._sync_s if due else None)
            while item is not None:
                batch.append(item)
                item = self._queue.get_nowait()
            return batch, False
        return batch, True

    def _write(self, lines: list[bytes]) -> None:
        """Write these lines, after what waits; only what it was first refused for is told."""
        self._taken += len(lines)
        if not lines:
            with suppress(OSError):
                self._file.flush()
            return
        if self._unsynced_s is None:
            self._unsynced_s = monotonic()
        refused: OSError | None = None
        for line in lines:
            try:
                self._file.append(line, durable=False)
            except OSError as error:
                refused = error
        if refused is not None:
            self._tell(refused)

    def _overdue(self) -> bool:
        return self._unsynced_s is not None and monotonic() - self._unsynced_s >= self._sync_s * TIMES_LONGEST

    def _sync(self) -> None:
        if self._unsynced_s is None:
            return
        self._unsynced_s = monotonic() if self._file.waiting else None
        try:
            self._file.sync()
        except OSError as error:
            if not self._doubtful:
                self._tell(error)
            self._doubtful = True

    def _count(self) -> None:
        if not self._doubtful:
            self._kept = self._taken - self._file.waiting

    def _tell(self, error: OSError) -> None:
        self._troubles.put(error.strerror or str(error))
