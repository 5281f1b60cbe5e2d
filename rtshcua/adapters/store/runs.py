"""The folder of one run: `runs/<utc>-<bundle>/`."""

from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from rtshcua.adapters.store.evidence_file import SYSTEM, Disk, EvidenceFile
from rtshcua.adapters.store.reading import walk
from rtshcua.adapters.store.telemetry import TelemetryFile
from rtshcua.adapters.store.writing import PUBLIC_FOLDER, make_folder, naming, replace, sync_folder, write_new

BUNDLE, LOG, TELEMETRY, SUMMARY = "mission.bundle", "log.jsonl", "telemetry.tlog", "summary.json"

_PLAIN = frozenset("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_.-")


def logs_of(given: Path) -> list[Path]:
    """The logs that a path means: the file itself, the log in a run's folder, or the logs in all folders below. Raises
    OSError for a folder that cannot be read.
    """
    if not given.is_dir():
        return [given]
    own = given / LOG
    if own.is_file():
        return [own]
    return sorted(Path(place, LOG) for place, folders, files in walk(given, every=True) if LOG in (*folders, *files))


def lines_below(folder: Path) -> list[Path]:
    """The files in a folder and below with the suffix of logs, whatever their names. Raises OSError for a folder that
    cannot be read.
    """
    suffix = Path(LOG).suffix
    return sorted(
        Path(place, name)
        for place, folders, files in walk(folder, every=True)
        for name in (*(each for each in folders if each == LOG), *files)
        if name.lower().endswith(suffix)
    )


class RunFolder:
    """A new folder with the bundle, for the log, the telemetry and the summary of a run. It is removed again where the
    bundle cannot be written.
    """

    def __init__(self, runs: Path, *, name: str, bundle: bytes, utc_us: int) -> None:
        self.path = _new_folder(runs, _folder_name(name, utc_us))
        try:
            write_new(self.path / BUNDLE, bundle)
        except OSError:
            with suppress(OSError):
                self.path.rmdir()
            raise

    def log(self, disk: Disk = SYSTEM) -> EvidenceFile:
        """Create the evidence log; to be called once."""
        return EvidenceFile(self.path / LOG, disk)

    def telemetry(self, disk: Disk = SYSTEM) -> TelemetryFile:
        """Create the telemetry log; to be called once."""
        return TelemetryFile(self.path / TELEMETRY, disk)

    def write_summary(self, summary: dict[str, object]) -> None:
        """Write the summary, for people and scripts; only the log proves anything."""
        replace(self.path / SUMMARY, msgspec.json.format(msgspec.json.encode(summary), indent=2) + b"\n")


def _folder_name(name: str, utc_us: int) -> str:
    stamp = datetime.fromtimestamp(utc_us // 1_000_000, UTC).strftime("%Y%m%dT%H%M%SZ")
    plain = "".join(letter if letter in _PLAIN else "_" for letter in name)
    return f"{stamp}-{plain[:80] or 'run'}"


def _new_folder(runs: Path, name: str) -> Path:
    """A new folder: the second run within a second gets `-2`."""
    make_folder(runs)
    number = 1
    while True:
        path = runs / (name if number == 1 else f"{name}-{number}")
        try:
            with naming(path):
                path.mkdir(PUBLIC_FOLDER)
        except FileExistsError:
            number += 1
            continue
        sync_folder(runs)
        return path
