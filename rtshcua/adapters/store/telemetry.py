"""The raw frames of a flight, as every MAVLink tool reads them."""

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

#: frames kept for a disk that does not keep up
MOST_WAITING = 100_000
#: Bytes on the disk that frames leave free, for the log and the summary: a flight's log is a few hundred KB.
LEFT_TO_THE_LOG = 4 << 20
_EVERY_S = 0.1
#: a disk that hangs is waited for this long at the end, in seconds
FINISH_S = 10.0


def free_bytes(folder: Path) -> int:
    """How much room the disk of `folder` has for us."""
    return shutil.disk_usage(folder).free


class TelemetryFile:
    """A tlog in the making. Telemetry explains a flight and does not decide it: a full disk ends it, not the flight.

    A thread of its own writes, a few times a second, so that who keeps a frame neither waits for the disk nor wakes
    anybody.
    """

    def __init__(self, path: Path, disk: Disk = SYSTEM) -> None:
        self.path = path
        self.error: OSError | None = None
        self.lost = 0  # frames that are not in the file; after an error, of all once it is finished
        self._given = 0
        self._file = disk.create(path)
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._over = Event()
        self._thread = Thread(target=self._run, name="telemetry", daemon=True)
        self._thread.start()

    def write(self, utc_us: int, frame: bytes) -> None:
        """Keeps a frame that arrived at `utc_us`; after the first error, which stays in `error`, nothing more."""
        self._given += 1
        if self.error is None and len(self._waiting) < MOST_WAITING:
            self._waiting.append((utc_us, frame))
        else:
            self.lost += 1

    def finish(self, within_s: float = FINISH_S) -> bytes:
        """Closes the file and gives the SHA-256 of what is on the disk; `lost` then says how much that is not.

        Raises OSError, also when the disk does not answer in time: what is there then is not known.
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
        """How many whole frames the file holds; what a full disk took of one more is cut off."""
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
