"""What becomes of evidence lines, batch by batch: written, synced in time, and what is kept of them told truly.

It neither waits nor looks at a clock: the thread of `writer` does, or a test.
"""

from collections.abc import Sequence
from contextlib import suppress
from queue import SimpleQueue

from rtshcua.adapters.files.evidence import EvidenceFile
from rtshcua.evidence.durability import SYNC_US, SYNCED, SYNCED_FIRST, WRITTEN
from rtshcua.evidence.records import is_signed

#: A line of class `SYNCED` is synced this long after it was taken at the latest, in seconds: half of what is promised,
#: for the sync takes its time too.
SYNC_AFTER_S = SYNC_US / 1e6 / 2


class Keeper:
    """Feeds one evidence file. `written` and `synced` count lines from the first on, and never more than is certain.

    They may be read in another thread. `troubles` is what the disk refused, in its words, each refusal once.
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
