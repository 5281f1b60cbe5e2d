"""The service `report`: verify a flight, and say what it was, as the content of a page; or what it is so far."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from rtshcua.adapters.store.logs import lines
from rtshcua.adapters.store.reading import open_regular
from rtshcua.adapters.store.verification import Progress
from rtshcua.app.autopilot_bindings import roots_of, trusted_bindings
from rtshcua.app.flights.collected_flight import CollectedFlight
from rtshcua.app.flights.flight_view import flight_view
from rtshcua.app.flights.redaction import Redaction, bare_flight, bare_report, may_stay
from rtshcua.app.logs import report_code
from rtshcua.app.pin import Pin
from rtshcua.app.verify_log import VerifyRequest, verify_log
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import Close
from rtshcua.ground.flight.embedding import MOST_OCTETS, embed, redact
from rtshcua.ground.flight.flight_content import FlightReport, GapView

#: the most letters of an embedded log
_MOST_EMBEDDED: Final = 4 << 20


class FlightReportRequest(NamedTuple):
    """A log, the root to trust, the folders in which sources are sought, the time of the page, and what is left out."""

    log: Path
    pin: Pin
    sources: Sequence[Path]
    made_at_us: int
    removed: tuple[str, ...] = ()


class ReportedFlight(NamedTuple):
    """The content of a page, the exit code of the verification, and, if it is redacted, what searches the page for what
    should be gone.
    """

    report: FlightReport
    code: ExitCode
    redaction: Redaction | None


def flight_report(request: FlightReportRequest, progress: Progress = lambda _: None) -> ReportedFlight | Refusal:
    """Verify a flight with all its decisions, and tell it. Raises OSError."""
    collected = CollectedFlight(request.log, request.sources)
    size = request.log.stat().st_size  # of a log that grows, what comes later is not embedded
    verify = VerifyRequest(request.pin.key, request.pin.roots, audit=True)
    audit = verify_log(request.log, verify, progress, collected.take, lambda: collected.heard)
    collected.update_telemetry()  # what the audit did not read
    flight = collected.flight()
    if isinstance(flight, Refusal):
        return flight
    redaction, found = None, audit.report
    if request.removed:
        redaction = Redaction(flight, collected.persons, request.removed, (collected.mission(),))
        found, flight = bare_report(found), bare_flight(flight)
    roots = roots_of(None if audit.basis is None else audit.basis.root, request.pin.roots)
    told = flight_view(
        found, flight, collected, trusted_bindings(audit.report, request.log, roots),
        made_at_us=request.made_at_us, pinned=f"root key `{request.pin.key.hex()}`", details=not request.removed,
    )  # fmt: skip
    if redaction is not None:
        told = redaction.report(told, flight)
        left = redaction.left_in(told)
        if left is not None:
            return left
    return ReportedFlight(_with_log(told, request, audit.report.records, size), report_code(audit.report), redaction)


def _with_log(report: FlightReport, request: FlightReportRequest, records: int, size: int) -> FlightReport:
    """The report with the log, or of a redacted one with what may stay of it. Raises OSError."""
    with open_regular(request.log) as file:
        data = file.read(min(size, MOST_OCTETS + 1))
    if request.removed and len(data) <= MOST_OCTETS:
        kept = data.splitlines(keepends=True)[:records]
        data = redact(kept, may_stay(request.removed), checkpoints="names" not in request.removed)
    text = "" if len(data) > MOST_OCTETS else embed(data)
    if not text or len(text) > _MOST_EMBEDDED:
        gap = GapView("page", "the log is too large to be embedded: verify the file itself with `rtshcua verify-log`")
        return report._replace(gaps=(*report.gaps, gap))
    return report._replace(log=text)


class LiveFlight:
    """A flight that is still being recorded, read again and again from its growing log and telemetry."""

    def __init__(self, log: Path, sources: Sequence[Path]) -> None:
        self._log = log
        self._collected = CollectedFlight(log, sources)
        self._offset = self._records = 0
        #: whether the log was closed: nothing follows
        self.closed = False

    def update(self) -> bool:
        """Read what is new; return whether there was anything. Raises OSError."""
        before, self._collected.flaw = (self._offset, self._collected.flaw), ""
        with open_regular(self._log) as file:
            if os.fstat(file.fileno()).st_size < self._offset:
                self._collected.flaw = f"the log became shorter than its first {self._records} records"
                return before != (self._offset, self._collected.flaw)
            file.seek(self._offset)
            for line in lines(file):
                if not line.endswith(b"\n"):
                    break  # the rest is still to be written
                record = read(line)
                if isinstance(record, Flaw):
                    self._collected.flaw = f"record {self._records} {record.text}"
                    break
                self._records += 1
                self._collected.take(record)
                self._offset += len(line)
                self.closed = isinstance(record, Close)
        return self._collected.update_telemetry() or (self._offset, self._collected.flaw) != before

    def report(self, made_at_us: int) -> FlightReport | Refusal:
        """The content of the page so far."""
        flight = self._collected.flight(growing=not self.closed)
        if isinstance(flight, Refusal):
            return flight
        return flight_view(None, flight, self._collected, made_at_us=made_at_us, pinned="no key")
