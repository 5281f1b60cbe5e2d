"""The file that evidence lines go to; who must not wait for the disk writes to it through `writer`."""

import os
from contextlib import suppress
from pathlib import Path

from rtshcua.adapters.files.durable import PUBLIC_FILE, open_new, sync_data


class EvidenceFile:
    """A log that is only ever appended to, and never replaces another: raises FileExistsError when `path` is there.

    The disk may refuse a line. It is then kept, so that the chain has no hole, and written before the next one or when
    the file is closed. What the disk took of a refused line is cut off again, so the log ends between two records.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._handle = open_new(path, mode=PUBLIC_FILE, append=True)
        self._length = 0  # of the whole lines in the file
        self._taken = 0  # bytes of the first waiting line that stand after them
        self._waiting: list[bytes] = []
        self._sync_error: OSError | None = None

    @property
    def waiting(self) -> int:
        """How many lines the disk has not taken yet."""
        return len(self._waiting)

    def append(self, line: bytes, durable: bool) -> None:
        """Writes one line; `durable` returns only when it is on the disk.

        Raises OSError when this line or one before it could not be written, and, for a durable one, from the first sync
        that failed on: what the system then reports of the disk cannot be believed any more.
        """
        self._waiting.append(line)
        self.flush()
        if durable:
            self.sync()

    def flush(self) -> None:
        """Writes what waits. Raises OSError where the disk refuses it still."""
        waiting = self._waiting
        while waiting:
            line = waiting[0]
            try:
                while self._taken < len(line):
                    self._taken += os.write(self._handle, line[self._taken :] if self._taken else line)
            except OSError:
                self._cut()
                raise
            self._length += len(line)
            self._taken = 0
            del waiting[0]

    def _cut(self) -> None:
        """Takes the beginning of a refused line off again; where even that is refused, the line goes on from there."""
        if self._taken:
            with suppress(OSError):
                os.ftruncate(self._handle, self._length)
                self._taken = 0

    def sync(self) -> None:
        """Returns when what was written is on the disk. Raises OSError, and from the first time on always."""
        if self._sync_error is not None:
            raise self._sync_error
        try:
            sync_data(self._handle)
        except OSError as error:
            self._sync_error = error
            raise

    def close(self) -> None:
        """Writes what waits, syncs, and closes, also when the first two fail. Closing twice does nothing."""
        if self._handle < 0:
            return
        handle = self._handle
        try:
            self.flush()
            self.sync()
        finally:
            self._handle = -1
            os.close(handle)
