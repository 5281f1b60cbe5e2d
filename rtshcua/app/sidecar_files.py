"""What lies beside a log and is held against it: the bundle, the raw frames, the summary, the notes of witnesses."""

from collections.abc import Iterable, Iterator
from hashlib import file_digest
from pathlib import Path

from rtshcua.adapters.store.logs import read_anchors, read_named, unreadable
from rtshcua.adapters.store.reading import open_regular, read_regular
from rtshcua.adapters.store.runs import BUNDLE, LOG, SUMMARY, TELEMETRY
from rtshcua.evidence.finding import Claim, Finding
from rtshcua.evidence.report import LogReport
from rtshcua.ground.audit.frames import OTHERS, FrameAudit
from rtshcua.mavlink import tlog
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


def with_summary(report: LogReport, log: Path) -> LogReport:
    """The report, with what it says of the summary in a run's folder."""
    folder = run_folder(log)
    if folder is None or report.failure is not None or not (folder / SUMMARY).exists():
        return report
    claim = Claim("summary", f"`{SUMMARY}`: nothing signs it, and it was not read; what counts stands in the log")
    return report._replace(unproven=(*report.unproven, claim))


class RawFrames:
    """The file at `path`, if there is one. `frames` is for the auditor to follow; without it only the digest counts."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._damaged: int | None = None
        self.frames = FrameAudit(self._entries())

    def _entries(self) -> Iterator[tuple[int, bytes]]:
        if not self._path.exists():
            return
        with open_regular(self._path, self._path.parent) as file:
            try:
                for entry in tlog.stream(file):
                    yield entry.at_us, entry.frame
            except tlog.DamagedTlog as damaged:
                self._damaged = damaged.offset

    def unread(self, report: LogReport) -> LogReport:
        """The report, where nobody looked at these frames."""
        if report.failure is not None or not self._path.exists():
            return report
        return _unproven(report, f"the raw frames: `{self._path.name}` was not read: without `--fast`")

    def judged(self, report: LogReport, *, followed: bool) -> LogReport:
        """The report, with what it says of these frames; `followed` says that an audit has followed them."""
        close = report.close
        if close is None or report.failure is not None:
            return report
        name, there = self._path.name, self._path.exists()
        if close.tlog is None:
            text = f"the raw frames: the log does not vouch for `{name}`, which is not whole"
            return report if not there else _unproven(report, text)
        if not there:
            return _unproven(report, f"the raw frames: `{name}` does not lie beside the log")
        with open_regular(self._path, self._path.parent) as file:
            digest = file_digest(file, "sha256").hexdigest()
        if digest != close.tlog:
            text = f"`{name}` was changed: it is not the telemetry whose digest the close signs"
            return report._replace(failure=Finding("telemetry/changed", close.seq, text, digest, close.tlog))
        report = report._replace(proven=(*report.proven, Claim("telemetry", f"`{name}` is the one that was signed")))
        return self._followed(report) if followed else report

    def _followed(self, report: LogReport) -> LogReport:
        found, count = self.frames.over(), self.frames.count
        if found is not None and not (found.slug == OTHERS and self._damaged is not None):
            return report._replace(failure=found)
        if self._damaged is not None:
            return _unproven(report, f"the raw frames from byte {self._damaged} on, where no frame can be read")
        if self.frames.begun and not count:
            return _unproven(report, "the raw frames: the log has commands that were sent, and none of them is there")
        many = "frame that commands" if count == 1 else "frames that command"
        claim = Claim("frames", f"{count} {many} the vehicle, each sent after the record that permits it")
        text = "what others commanded: only what came and went by us is in the telemetry"
        return _unproven(report._replace(proven=(*report.proven, claim)), text)


def _unproven(report: LogReport, text: str) -> LogReport:
    return report._replace(unproven=(*report.unproven, Claim("telemetry", text)))


def raw_frames(log: Path) -> RawFrames | None:
    """The raw frames in a run's folder."""
    folder = run_folder(log)
    return None if folder is None else RawFrames(folder / TELEMETRY)
