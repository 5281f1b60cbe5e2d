"""Find logs, the exit codes of their verification, and the duration of their flights."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

from rtshcua.adapters.store.logs import START, lines
from rtshcua.adapters.store.reading import open_regular
from rtshcua.adapters.store.runs import LOG, lines_below, logs_of
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.reading import LONGEST, read
from rtshcua.evidence.records import Genesis
from rtshcua.evidence.report import LogReport, LogVerdict

_MARK = b'"format":"rtshcua/log"'
_HEAD = 1 << 26

#: the text for a log with an incomplete first record
CUT_AT_FIRST = "the log is cut inside its first record, or that record is damaged"

#: the help for a file that is not a log
NO_LOG_HELP = "accepted: a log, the folder of a run, or a folder of these"

_EXITS = {
    "trust": ExitCode.UNTRUSTED,
    "decision": ExitCode.DECISION,
    "document": ExitCode.DECISION,
    "dispatch": ExitCode.DECISION,
    "image": ExitCode.DECISION,
    "preparation": ExitCode.DECISION,
    "frames": ExitCode.DECISION,
    "anchor": ExitCode.ANCHOR,
    "boundary": ExitCode.BOUNDARY,
}


def log_of(given: Path) -> Path:
    """The log at a path: the file itself, or the log in a run folder."""
    return given / LOG if given.is_dir() else given


def logs_meant(given: Iterable[Path]) -> list[Path]:
    """The logs at paths of files, run folders and folders of these; for a folder without a log, the missing path."""
    return [log for path in given for log in logs_of(path) or [path / LOG]]


def logs_or_unread(given: Iterable[Path]) -> list[Path]:
    """As `logs_meant`; a file or folder that cannot be read stands for itself, so that opening it tells why."""
    return [log for path in given for log in _found_or_unread(path) or [path / LOG]]


def _found_or_unread(path: Path) -> list[Path]:
    try:
        return logs_of(path)
    except OSError:
        pass
    try:  # something in it cannot be read, or the folder itself
        below = sorted(each for each in path.iterdir() if each.is_dir() and not each.is_symlink())
    except OSError:
        return [path]
    return [log for each in below for log in _found_or_unread(each)] or [path]


def logs_and_others(given: Iterable[Path]) -> tuple[list[Path], list[Path]]:
    """All logs at the paths and below folders, by content, and the other files with a log's suffix. An unreadable file
    counts as a log, so that opening it reports the error.
    """
    logs, others = list[Path](), list[Path]()
    for path in given:
        found = lines_below(path) if path.is_dir() else [path]
        mine = [each for each in found if each.name == LOG or not path.is_dir() or _may_be_log(each)]
        logs += mine or [path / LOG]
        others += [each for each in found if each not in mine]
    return logs, others


def _may_be_log(path: Path) -> bool:
    try:
        return path.stat().st_size > 0 and is_log(path)
    except OSError:
        return True


def is_log(path: Path) -> bool:
    """Whether a file looks like a log. An empty file or a cut first line counts too: the log may be cut."""
    with open_regular(path) as file:
        line = file.readline(_HEAD)
    return not line or line.startswith(START) or _MARK in line


def log_below(runs: Path, flight: bytes) -> Path | None:
    """The log of a flight, by its id, sought below `runs`. Raises OSError."""
    return next((log for log in _latest_first(runs) if _flight_of(log) == flight.hex()), None)


def _latest_first(runs: Path) -> Iterator[Path]:
    if runs.is_dir():
        yield from sorted((log for log in logs_of(runs) if log.is_file()), reverse=True)


def _flight_of(log: Path) -> str | None:
    with open_regular(log) as file:
        record = read(file.readline(LONGEST))
    return record.boot if isinstance(record, Genesis) else None


def report_code(report: LogReport) -> ExitCode:
    """The exit code for a report."""
    if report.failure is None:
        return ExitCode.OK if report.verdict is LogVerdict.VERIFIED else ExitCode.INCOMPLETE
    return finding_code(report.failure.slug)


#: of exit codes for logs the worst first; any other code stands between both
_EVIDENCE: Final = (ExitCode.ANCHOR, ExitCode.BOUNDARY, ExitCode.DECISION, ExitCode.EVIDENCE)
_LEAST: Final = (ExitCode.INCOMPLETE, ExitCode.OK)


def worst(codes: Iterable[ExitCode]) -> ExitCode:
    """The worst of the exit codes of several logs: a log that fails verification, then one that could not be read or
    written, then an incomplete one.
    """
    return min(codes, key=_severity, default=ExitCode.OK)


def _severity(code: ExitCode) -> tuple[int, int]:
    """A rank, the worst first; other codes by their number."""
    if code in _EVIDENCE:
        return 0, _EVIDENCE.index(code)
    return (2, _LEAST.index(code)) if code in _LEAST else (1, code)


def finding_code(slug: str) -> ExitCode:
    """The exit code for the slug of a finding."""
    if slug == "genesis/format":
        return ExitCode.UNTRUSTED
    return _EXITS.get(slug.partition("/")[0], ExitCode.EVIDENCE)


_RECOVER = b',"type":"recover"'


def lasted_us(report: LogReport, log: Path) -> int:
    """The time from the first record of a verified log to the last one of the flight, in us."""
    assert report.genesis is not None
    last_us = report.last_us
    if report.failure is None and report.counts.get("recover"):
        last_us = _before_recovery_us(log, last_us)
    return last_us - report.genesis.at_us


def _before_recovery_us(log: Path, otherwise_us: int) -> int:
    before = b""
    with open_regular(log) as file:
        for line in lines(file):
            if _RECOVER in line:
                break
            before = line
    record = read(before)
    return otherwise_us if isinstance(record, Flaw) else record.at_us
