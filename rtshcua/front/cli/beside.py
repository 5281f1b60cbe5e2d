"""What lies beside a log and is held against it: the bundle, the raw frames, the summary, the notes of witnesses."""

from collections.abc import Iterable
from pathlib import Path

from rtshcua.adapters.store.logs import read_anchors, read_named, unreadable
from rtshcua.adapters.store.reading import read_regular
from rtshcua.adapters.store.runs import BUNDLE, LOG, SUMMARY, TELEMETRY
from rtshcua.evidence.finding import Claim
from rtshcua.evidence.report import LogReport
from rtshcua.front.cli.raw_frames import RawFrames
from rtshcua.wire.bundle import MAX_BUNDLE


def run_folder(log: Path) -> Path | None:
    """The folder of the run that a log is of, if it still lies in one."""
    return log.parent if log.name == LOG else None


def bundle_beside(log: Path) -> bytes | None:
    """The bundle in a run's folder: the log should be of it."""
    folder = run_folder(log)
    if folder is None or not (folder / BUNDLE).exists():
        return None
    return read_regular(folder / BUNDLE, MAX_BUNDLE, folder)


def anchors_beside(log: Path, more: Iterable[Path]) -> tuple[str, ...]:
    """The notes in the files of anchors beside a log, and in those that were named. Raises OSError where one of these
    cannot be read to its end: who names it relies on it.
    """
    found = read_anchors(log)
    for path in more:
        found += read_named(path)
    return tuple(found)


def with_unread(report: LogReport, log: Path) -> LogReport:
    """The report, with the files of anchors beside the log that hold none."""
    names = [] if report.failure is not None else [f"`{path.name}`" for path in unreadable(log)]
    if not names:
        return report
    text = f"what witnesses would say in {', '.join(names)}: nothing there can be read as their notes"
    return report._replace(unproven=(*report.unproven, Claim("anchor/unreadable", text)))


def raw_frames(log: Path) -> RawFrames | None:
    """The raw frames in a run's folder."""
    folder = run_folder(log)
    return None if folder is None else RawFrames(folder / TELEMETRY)


def with_summary(report: LogReport, log: Path) -> LogReport:
    """The report, with what it says of the summary in a run's folder."""
    folder = run_folder(log)
    if folder is None or report.failure is not None or not (folder / SUMMARY).exists():
        return report
    claim = Claim("summary", f"`{SUMMARY}`: nothing signs it, and it was not read; what counts stands in the log")
    return report._replace(unproven=(*report.unproven, claim))
