"""The raw frames that lie beside a log: whether they are those that the log vouches for, and agree with it."""

from collections.abc import Iterator
from hashlib import file_digest
from pathlib import Path

from rtshcua.adapters.store.reading import open_regular
from rtshcua.evidence.finding import Claim, Finding
from rtshcua.evidence.report import LogReport
from rtshcua.ground.audit.frames import OTHERS, Frames
from rtshcua.mavlink import tlog


class RawFrames:
    """The file at `path`, if there is one. `frames` is for the auditor to follow; without it only the digest counts."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._damaged: int | None = None
        self.frames = Frames(self._entries())

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
