"""Write the raw frames of a flight in a format that every MAVLink tool reads."""

import errno
import shutil
from collections import deque
from contextlib import suppress
from hashlib import file_digest
from pathlib import Path
from threading import Event, Thread

from rtshcua.adapters.store.evidence_file import SYSTEM, Disk, write_all
from rtshcua.adapters.store.reading import open_regular
from rtshcua.mavlink import tlog

#: the most frames that wait for a slow disk
MOST_WAITING = 100_000
#: Free bytes on the disk that are reserved for the log and the summary: a flight's log is a few hundred KB.
LEFT_TO_THE_LOG = 4 << 20
_EVERY_S = 0.1
#: how long to wait for a hanging disk at the end, in seconds
FINISH_S = 10.0


def free_bytes(folder: Path) -> int:
    """The free space on the disk of `folder`."""
    return shutil.disk_usage(folder).free


class TelemetryFile:
    """A tlog during a flight. Telemetry explains a flight but does not decide it: a full disk ends the tlog, not the
    flight.

    A thread writes a few times a second, so that keeping a frame neither waits for the disk nor wakes a thread.
    """

    def __init__(self, path: Path, disk: Disk = SYSTEM) -> None:
        self.path = path
        self.error: OSError | None = None
        self.lost = 0  # frames that are not in the file; after an error, the final number once it is finished
        self._given = 0
        self._file = disk.create(path)
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._over = Event()
        self._thread = Thread(target=self._run, name="telemetry", daemon=True)
        self._thread.start()

    def write(self, utc_us: int, frame: bytes) -> None:
        """Keep a frame that arrived at `utc_us`; nothing more after the first error, which is kept in `error`."""
        self._given += 1
        if self.error is None and len(self._waiting) < MOST_WAITING:
            self._waiting.append((utc_us, frame))
        else:
            self.lost += 1

    def finish(self, within_s: float = FINISH_S) -> bytes:
        """Close the file and return the SHA-256 of its content on the disk; `lost` then counts the missing frames.
        Raises OSError, also when the disk does not answer in time: its content is then unknown.
        """
        self._over.set()
        self._thread.join(within_s)
        if self._thread.is_alive():
            raise OSError(errno.ETIMEDOUT, f"the disk has not answered for {within_s:g} s")
        if self.error is not None:
            self.lost = self._given - self._whole()
        try:
            self._file.close()
        except OSError as error:
            self.error = self.error or error
        with open_regular(self.path) as file:
            return file_digest(file, "sha256").digest()

    def _whole(self) -> int:
        """The number of whole frames in the file; a frame that a full disk cut off is removed."""
        count = 0
        try:
            with open_regular(self.path) as file:
                for _ in tlog.stream(file):
                    count += 1
        except tlog.DamagedTlog as damaged:
            with suppress(OSError):
                self._file.truncate(damaged.offset)
        return count

    def _run(self) -> None:
        over = False
        while not over:
            over = self._over.wait(_EVERY_S)
            batch = [self._waiting.popleft() for _ in range(len(self._waiting))]
            if not batch or self.error is not None:
                continue
            try:
                self._look_for_room()
                write_all(self._file, b"".join(tlog.encode(utc_us, frame) for utc_us, frame in batch))
            except OSError as error:
                self.error = error

        try:
            self._file.sync()
        except OSError as error:
            self.error = self.error or error

    def _look_for_room(self) -> None:
        try:
            free = free_bytes(self.path.parent)
        except OSError:
            return  # then writing tells
        if free < LEFT_TO_THE_LOG:
            raise OSError(errno.ENOSPC, "the last free space on the disk is reserved for the log")
