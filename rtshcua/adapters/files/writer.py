"""Evidence off the reflex path: a thread that owns the evidence file, fed without waiting (docs/adr/0016)."""

import errno
from contextlib import suppress
from queue import Empty, SimpleQueue
from threading import Event, Thread
from time import monotonic

from rtshcua.adapters.files.evidence import EvidenceFile
from rtshcua.adapters.files.keeper import SYNC_AFTER_S, Keeper
from rtshcua.adapters.files.lateness import STUCK_S, Lateness

#: More lines than this that are not kept mean that the disk does not keep up, and evidence fails. They are not dropped,
#: for the chain has no holes: it goes on, while the flight comes down, up to `TIMES_MOST` times as many.
MOST_WAITING = 1_000
TIMES_MOST = 64
#: What was written is synced once nothing has come for this time, in seconds, so that a sync stands in nobody's way.
SYNC_S = 0.2
#: a disk that hangs is waited for this long at the end, in seconds
CLOSE_S = 10.0

_BEHIND = OSError(errno.ENOBUFS, "the disk does not keep up")
_OVER = OSError(errno.ENOSPC, "the disk did not keep up, and the log ends before this")


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
        keeper = self._keeper
        if not keeper.troubles.empty():  # nobody else takes from it
            return keeper.troubles.get_nowait()
        if keeper.failing or self._lateness.kept(keeper.synced):
            return None
        return self._lateness.stuck(keeper.synced, monotonic())

    def late(self) -> str | None:
        """That a line was not on the disk in time, once for each time that it falls behind."""
        keeper = self._keeper
        if keeper.failing or self._lateness.kept(keeper.synced):
            return None
        return self._lateness.late(keeper.synced, monotonic())

    def settle(self) -> None:
        """Waits until all that was given is on the disk. Raises OSError when it is not, or not in time."""
        until_s = monotonic() + self._close_s
        while self._keeper.synced < self._given:
            if self._keeper.failing:
                raise OSError(errno.EIO, self.trouble() or "the disk does not take everything")
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
