"""The raw frames of a flight, as every MAVLink tool reads them."""

from hashlib import file_digest
from io import BufferedWriter, FileIO
from pathlib import Path

from rtshcua.adapters.files.durable import PUBLIC_FILE, open_new
from rtshcua.mavlink import tlog


class TelemetryFile:
    """A tlog in the making. Telemetry explains a flight and does not decide it: a full disk ends it, not the flight."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.error: OSError | None = None
        self._file = BufferedWriter(FileIO(open_new(path, mode=PUBLIC_FILE), "wb"), 1 << 16)

    def write(self, utc_us: int, frame: bytes) -> None:
        """Keeps a frame that arrived at `utc_us`; after the first error, which stays in `error`, nothing more."""
        if self.error is not None:
            return
        try:
            self._file.write(tlog.encode(utc_us, frame))
        except OSError as error:
            self.error = error

    def finish(self) -> bytes:
        """Closes the file and gives the SHA-256 of what is on the disk, which the log's close then signs."""
        try:
            self._file.close()
        except OSError as error:
            self.error = self.error or error
        with self.path.open("rb") as file:
            return file_digest(file, "sha256").digest()
