"""The raw frames of a flight, as every MAVLink tool reads them."""

from collections import deque
from hashlib import file_digest
from io import BufferedWriter, FileIO
from pathlib import Path
from threading import Event, Thread

from rtshcua.adapters.files.durable import PUBLIC_FILE, open_new
from rtshcua.mavlink import tlog

#: frames kept for a disk that does not keep up
MOST_WAITING = 100_000
_EVERY_S = 0.1


class TelemetryFile:
    """A tlog in the making. Telemetry explains a flight and does not decide it: a full disk ends it, not the flight.

    A thread of its own writes, a few times a second, so that who keeps a frame neither waits for the disk nor wakes
    anybody.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.error: OSError | None = None
        self.lost = 0  # frames that came while too many waited
        self._file = BufferedWriter(FileIO(open_new(path, mode=PUBLIC_FILE), "wb"), 1 << 16)
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._over = Event()
        self._thread = Thread(target=self._run, name="telemetry", daemon=True)
        self._thread.start()

    def write(self, utc_us: int, frame: bytes) -> None:
        """Keeps a frame that arrived at `utc_us`; after the first error, which stays in `error`, nothing more."""
        if self.error is None and len(self._waiting) < MOST_WAITING:
            self._waiting.append((utc_us, frame))
        else:
            self.lost += 1

    def finish(self) -> bytes:
        """Closes the file and gives the SHA-256 of what is on the disk, which the log's close then signs."""
        self._over.set()
        self._thread.join()
        try:
            self._file.close()
        except OSError as error:
            self.error = self.error or error
        with self.path.open("rb") as file:
            return file_digest(file, "sha256").digest()

    def _run(self) -> None:
        over = False
        while not over:
            over = self._over.wait(_EVERY_S)
            batch = [self._waiting.popleft() for _ in range(len(self._waiting))]
            if not batch or self.error is not None:
                continue
            try:
                self._file.write(b"".join(tlog.encode(utc_us, frame) for utc_us, frame in batch))
                self._file.flush()
            except OSError as error:
                self.error = error
