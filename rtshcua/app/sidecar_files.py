"""The files beside a log that are compared with it: bundle, raw frames, summary, and notes of witnesses."""

from collections.abc import Callable, Generator, Iterable
from hashlib import file_digest
from pathlib import Path
from typing import Final, Protocol

from rtshcua.adapters.store.logs import read_anchors, read_named, unreadable
from rtshcua.adapters.store.reading import open_regular, read_regular
from rtshcua.adapters.store.runs import BUNDLE, LOG, SUMMARY, TELEMETRY
from rtshcua.evidence.finding import Claim, Finding
from rtshcua.evidence.report import LogReport
from rtshcua.ground.audit.frames import OTHERS, FrameAudit
from rtshcua.mavlink import tlog
from rtshcua.wire.bundle import MAX_BUNDLE


def run_folder(log: Path) -> Path | None:
    """The run folder of a log; None if the log is not in one."""
    return log.parent if log.name == LOG else None


def bundle_beside(log: Path) -> bytes | None:
    """The bundle in the run folder, which the log should belong to."""
    folder = run_folder(log)
    if folder is None or not (folder / BUNDLE).exists():
        return None
    return read_regular(folder / BUNDLE, MAX_BUNDLE, folder)


def anchors_beside(log: Path, more: Iterable[Path]) -> tuple[str, ...]:
    """The notes of witnesses beside a log, and in the named files `more`. Raises OSError if a named file cannot be
    read.
    """
    found = read_anchors(log)
    for path in more:
        found += read_named(path)
    return tuple(found)


def with_unread(report: LogReport, log: Path) -> LogReport:
    """Add to the report the anchor files beside the log that have no readable notes."""
    names = [] if report.failure is not None else [f"`{path.name}`" for path in unreadable(log)]
    if not names:
        return report
    text = f"the notes of witnesses in {', '.join(names)}: these files contain no readable notes"
    return report._replace(unproven=(*report.unproven, Claim("anchor/unreadable", text)))


def with_summary(report: LogReport, log: Path) -> LogReport:
    """Add to the report that the summary in the run folder proves nothing."""
    folder = run_folder(log)
    if folder is None or report.failure is not None or not (folder / SUMMARY).exists():
        return report
    claim = Claim("summary", f"`{SUMMARY}`: it is not signed and was not read; the log is the evidence")
    return report._replace(unproven=(*report.unproven, claim))


#: the sender and the number of the message in a frame's header
SENDER_AND_NUMBER: Final = slice(5, 10)


class FrameListener(Protocol):
    """Gets the frames that somebody reads anyway, but not those whose sender and number it skips; and how much of the
    file was read, in octets.
    """

    skipped: set[bytes]
    offset: int

    def take(self, entry: tlog.TlogEntry) -> None:
        """Take the next entry."""


class RawFrames:
    """The raw frames file at `path`, which may be missing. `frames` is for the auditor; what `heard` returns once the
    first frame is read gets what is read.
    """

    def __init__(self, path: Path, heard: Callable[[], FrameListener | None] = lambda: None) -> None:
        self._path, self._heard = path, heard
        self._damaged: int | None = None
        self._reading = self._entries()
        self.frames = FrameAudit(self._reading)

    def close(self) -> None:
        """End the reading, wherever it is."""
        self._reading.close()

    def _entries(self) -> Generator[tuple[int, bytes], None, None]:
        if not self._path.exists():
            return
        listener = self._heard()
        with open_regular(self._path, self._path.parent) as file:
            try:
                if listener is None:
                    for entry in tlog.stream(file):
                        yield entry.at_us, entry.frame
                    return
                skipped, take, key = listener.skipped, listener.take, SENDER_AND_NUMBER  # an hour has 300,000 frames
                for entry in tlog.stream(file):
                    frame = entry.frame
                    if frame[key] not in skipped:
                        take(entry)
                    yield entry.at_us, frame
            except tlog.DamagedTlog as damaged:
                self._damaged = damaged.offset
            finally:
                if listener is not None:
                    listener.offset = file.tell() if self._damaged is None else self._damaged

    def unread(self, report: LogReport) -> LogReport:
        """Add to the report that the frames were not read."""
        if report.failure is not None or not self._path.exists():
            return report
        return _unproven(report, f"the raw frames: `{self._path.name}` was not read: without `--fast`")

    def judged(self, report: LogReport, *, followed: bool) -> LogReport:
        """Add the result for the frames to the report. `followed`: the auditor has checked each frame."""
        close = report.close
        if close is None or report.failure is not None:
            return report
        name, there = self._path.name, self._path.exists()
        if close.tlog is None:
            text = f"the raw frames: the log has no digest of `{name}`, which is incomplete"
            return report if not there else _unproven(report, text)
        if not there:
            return _unproven(report, f"the raw frames: `{name}` is missing beside the log")
        with open_regular(self._path, self._path.parent) as file:
            digest = file_digest(file, "sha256").hexdigest()
        if digest != close.tlog:
            text = f"`{name}` was changed: its digest differs from the signed one in the close record"
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
            return _unproven(report, "the raw frames: the log has sent commands, but none of them is in the telemetry")
        many = "frame that commands" if count == 1 else "frames that command"
        claim = Claim("frames", f"{count} {many} the vehicle, each sent after the record that permits it")
        text = "commands of others: the telemetry has only frames that this program sent or received"
        return _unproven(report._replace(proven=(*report.proven, claim)), text)


def _unproven(report: LogReport, text: str) -> LogReport:
    return report._replace(unproven=(*report.unproven, Claim("telemetry", text)))


def raw_frames(log: Path, heard: Callable[[], FrameListener | None] = lambda: None) -> RawFrames | None:
    """The raw frames in the run folder of a log; None if it is not in one. `heard`: see `RawFrames`."""
    folder = run_folder(log)
    return None if folder is None else RawFrames(folder / TELEMETRY, heard)
