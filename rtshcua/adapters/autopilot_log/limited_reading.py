"""Read an autopilot's log in a process with limits, and check what it reports."""

import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from hashlib import file_digest
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

import msgspec

from rtshcua.adapters.autopilot_log.reports import NO_LIBRARY, NO_TRACK, ReadFailed, ReadLog, ReadSoFar, Report
from rtshcua.adapters.store.reading import open_regular
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.kinds import DATAFLASH, EMPTY, LOOKED_AT, ULOG, recognised
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.flight.autopilot_log import (
    AutopilotLog,
    AutopilotLogKind,
    AutopilotPoint,
    LogCondition,
    utc_of_boot,
)

#: a larger file is refused unread, in octets
LARGEST: Final = 4 << 30
#: the longest report that is accepted, in octets: two million points
_LONGEST: Final = 128 << 20
#: points at a shorter distance are left out, in us
_CLOSE_US: Final = 20_000
#: the end of plausible times, in us: 100 years after a boot, and the year 10000
_BOOT_END_US: Final = 3_155_760_000_000_000
_UTC_END_US: Final = 253_402_300_800_000_000
_MODULE: Final = "rtshcua.adapters.autopilot_log"
_ACCEPTED: Final = "accepted: a PX4 log (.ulg) or an ArduPilot log (.bin)"


class ReadFile(NamedTuple):
    """A log that was read: its SHA-256 and size, and its content."""

    digest: bytes
    size: int
    log: AutopilotLog


def read_autopilot_log(
    path: Path, progress: Callable[[int, int], None] = lambda _done, _all: None
) -> ReadFile | Refusal:
    """Read an autopilot's log. `progress` gets the octets that were read and their number. Raises OSError."""
    with open_regular(path) as file:
        before = os.fstat(file.fileno())
        kind = _kind(path, file)
        if isinstance(kind, Refusal):
            return kind
        if before.st_size > LARGEST:
            text = f"`{path}` is {before.st_size} bytes; the limit is {LARGEST}"
            return Refusal("too-large", text, "", ExitCode.INPUT)
        file.seek(0)
        digest = file_digest(file, "sha256").digest()
        found = _read(path, file, kind, lambda done: progress(done, before.st_size))
        progress(before.st_size, before.st_size)
        after = os.fstat(file.fileno())
    if (before.st_size, before.st_mtime_ns) != (after.st_size, after.st_mtime_ns):
        return Refusal("changed", f"`{path}` was changed while it was read", "try again after it was copied")
    return found if isinstance(found, Refusal) else ReadFile(digest, before.st_size, found)


def _kind(path: Path, file: BinaryIO) -> AutopilotLogKind | Refusal:
    head = file.read(LOOKED_AT)
    kind = recognised(head, path.name) if head else EMPTY
    if kind is ULOG:
        return AutopilotLogKind.ULOG
    if kind is DATAFLASH:
        return AutopilotLogKind.DATAFLASH
    if kind is None:
        return Refusal("wrong-kind", f"`{path}` is not an autopilot's log", _ACCEPTED)
    return Refusal("wrong-kind", f"`{path}` is {kind.name}, not an autopilot's log", _ACCEPTED)


def _read(
    path: Path, file: BinaryIO, kind: AutopilotLogKind, progress: Callable[[int], None]
) -> AutopilotLog | Refusal:
    file.seek(0)
    report = _reported(file, kind, progress)
    if isinstance(report, ReadLog):
        track = _track(report.track)
        if len(track) > 1:
            utc = [(boot, at) for boot, at in report.utc if 0 <= boot < _BOOT_END_US and 0 <= at < _UTC_END_US]
            return AutopilotLog(kind, LogCondition(report.condition), report.source, track, utc_of_boot(utc))
        report = ReadFailed(NO_TRACK, "it has fewer than two positions")
    if report is not None and report.slug == NO_LIBRARY:
        text = f"reading `{path}` requires the package `{report.text.partition('.')[0]}`, which is not installed"
        return Refusal(
            NO_LIBRARY, text, "install rtshcua with its extra `bind`: `pip install 'rtshcua[bind]'`", ExitCode.INPUT
        )
    if report is not None and report.slug == NO_TRACK:
        return Refusal(NO_TRACK, f"`{path}`: {report.text}", "", ExitCode.INPUT)
    why = "reading it takes too much time or memory" if report is None else report.text
    return Refusal("malformed", f"`{path}` cannot be read: {why}", "")


def _reported(file: BinaryIO, kind: AutopilotLogKind, progress: Callable[[int], None]) -> ReadLog | ReadFailed | None:
    """The last report of the process; None if it was ended by its limits."""
    ours, its = os.pipe()
    try:
        command = [sys.executable, "-P", "-m", _MODULE, kind.value, str(its)]
        process = subprocess.Popen(
            command,
            stdin=file,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=(its,),
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        )
    except BaseException:
        os.close(ours)
        raise
    finally:
        os.close(its)
    found: ReadLog | ReadFailed | None = None
    try:
        with os.fdopen(ours, "rb") as reports:
            while line := reports.readline(_LONGEST):
                report = _parsed(line)
                if isinstance(report, ReadSoFar):
                    progress(report.octets)
                else:
                    found = report
    finally:
        process.kill()
        process.wait()
    return found


def _parsed(line: bytes) -> Report | None:
    with suppress(msgspec.DecodeError):
        report: Report = msgspec.json.decode(line, type=Report)
        return report
    return None


def _track(reported: list[tuple[int, int, int, int]]) -> tuple[AutopilotPoint, ...]:
    """The plausible points in order of time, thinned."""
    kept, last_us = [], -_CLOSE_US
    for each in sorted(AutopilotPoint(*point) for point in reported):
        plausible = (
            0 < each.boot_us < _BOOT_END_US
            and abs(each.latitude) <= 900_000_000
            and abs(each.longitude) <= 1_800_000_000
            and abs(each.above_sea) <= 100_000_000
        )
        if plausible and each.boot_us >= last_us + _CLOSE_US:
            kept.append(each)
            last_us = each.boot_us
    return tuple(kept)
