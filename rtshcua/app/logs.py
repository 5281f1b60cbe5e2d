"""Which files are logs, how the verification of one ends for the shell, and how long a flight lasted."""

from collections.abc import Iterable
from pathlib import Path

from rtshcua.adapters.store.logs import START, lines
from rtshcua.adapters.store.reading import open_regular
from rtshcua.adapters.store.runs import LOG, lines_below, logs_of
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.reading import read
from rtshcua.evidence.report import LogReport, LogVerdict

_MARK = b'"format":"rtshcua/log"'
_HEAD = 1 << 26

#: of a log whose first record is not whole, in every command
CUT_AT_FIRST = "the log is cut inside its first record, or that record is damaged"

#: where a file is no log
NO_LOG_HELP = "accepted: a log, the folder of a run, or a folder of these"

_EXITS = {
    "trust": ExitCode.UNTRUSTED,
    "decision": ExitCode.DECISION,
    "document": ExitCode.DECISION,
    "dispatch": ExitCode.DECISION,
    "preparation": ExitCode.DECISION,
    "frames": ExitCode.DECISION,
    "anchor": ExitCode.ANCHOR,
    "boundary": ExitCode.BOUNDARY,
}


def log_of(given: Path) -> Path:
    """The log that is meant: itself, or that in the folder of a run."""
    return given / LOG if given.is_dir() else given


def logs_meant(given: Iterable[Path]) -> list[Path]:
    """The logs that are meant by files, folders of runs and folders of these; where there is none, the missing one."""
    return [log for path in given for log in logs_of(path) or [path / LOG]]


def logs_and_others(given: Iterable[Path]) -> tuple[list[Path], list[Path]]:
    """The logs that are meant, of folders all that lie there or below, whatever they are called; and what lies there
    that has a log's suffix, and is none. What cannot be read is taken for a log: whoever opens it says why.
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
    """Whether a file looks like a log, or is empty, as one is of which all was cut off; its first line may be cut."""
    with open_regular(path) as file:
        line = file.readline(_HEAD)
    return not line or line.startswith(START) or _MARK in line


def report_code(report: LogReport) -> ExitCode:
    """The exit code for a report."""
    if report.failure is None:
        return ExitCode.OK if report.verdict is LogVerdict.VERIFIED else ExitCode.INCOMPLETE
    return finding_code(report.failure.slug)


def finding_code(slug: str) -> ExitCode:
    """The exit code for what makes a log fail."""
    if slug == "genesis/format":
        return ExitCode.UNTRUSTED
    return _EXITS.get(slug.partition("/")[0], ExitCode.EVIDENCE)


_RECOVER = b',"type":"recover"'


def lasted_us(report: LogReport, log: Path) -> int:
    """From the first record of a verified log to the last one that the flight wrote, in us."""
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
