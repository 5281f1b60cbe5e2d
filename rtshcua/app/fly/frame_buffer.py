"""The raw frames of a run, from the first that was heard: kept in memory until there is a file for them."""

from rtshcua.adapters.store.telemetry import TelemetryFile

_MOST = 100_000


class Tape:
    """Takes frames from the link, and hands them to a file once it is attached."""

    def __init__(self) -> None:
        self._early: list[tuple[int, bytes]] = []
        self._file: TelemetryFile | None = None

    def keep(self, utc_us: int, frame: bytes) -> None:
        """One good frame, and when it came or went, UTC in us."""
        if self._file is not None:
            self._file.write(utc_us, frame)
        elif len(self._early) < _MOST:
            self._early.append((utc_us, frame))

    def attach(self, file: TelemetryFile) -> None:
        """Write what was kept, and everything from now on."""
        self._file = file
        for utc_us, frame in self._early:
            file.write(utc_us, frame)
        self._early.clear()
