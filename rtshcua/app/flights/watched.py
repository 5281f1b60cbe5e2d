"""A flight that is under way: its log, in a run folder or by the flight's id that its socket tells, and its page."""

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from stat import S_ISSOCK

from rtshcua.adapters.agent_socket import FlightFollower
from rtshcua.adapters.store.reading import open_regular
from rtshcua.adapters.store.runs import LOG, logs_of
from rtshcua.app.documents import no_log
from rtshcua.app.flights.flight_report import FlightReportRequest, LiveFlight, flight_report
from rtshcua.app.logs import NO_LOG_HELP, is_log
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.reading import LONGEST, read
from rtshcua.evidence.records import Genesis
from rtshcua.ground.flight.flight_content import FlightReport
from rtshcua.ground.flight.flight_page import page, refused_page


def log_of_flight(given: Path, runs: Path) -> Path | Refusal:
    """The log of the flight at a socket, sought below `runs`; or that of a run folder. Raises OSError."""
    if not S_ISSOCK(given.stat().st_mode):
        log = given / LOG if given.is_dir() else given
        if not log.is_file() or not is_log(log):
            return Refusal("input", *no_log(log, given, NO_LOG_HELP), code=ExitCode.INPUT)
        return log
    follower = FlightFollower(given)
    follower.close()
    for log in _latest_first(runs):
        if _flight_of(log) == follower.flight.hex():
            return log
    help = "name the folder of its runs with `--runs`, or the run folder itself in place of the socket"
    text = f"no log of the flight {follower.flight.hex()} is below `{runs}`"
    return Refusal("input", text, help, code=ExitCode.INPUT)


def _latest_first(runs: Path) -> Iterator[Path]:
    if runs.is_dir():
        yield from sorted((log for log in logs_of(runs) if log.is_file()), reverse=True)


def _flight_of(log: Path) -> str | None:
    with open_regular(log) as file:
        record = read(file.readline(LONGEST))
    return record.boot if isinstance(record, Genesis) else None


class WatchedPage:
    """The page of a flight, made anew when there is something new and somebody asks. A closed log is verified under the
    root of `request`, if there is one.
    """

    def __init__(self, log: Path, request: FlightReportRequest | None) -> None:
        self._live = LiveFlight(log, (Path(),))
        self._request = request
        self._lock = threading.Lock()
        self._page: str | None = None
        self.closed, self.verdict = False, "growing"
        self._live.update()

    def update(self) -> None:
        """Read what is new of the log."""
        with self._lock:
            if not self.closed and self._live.update():
                self._page = None
            self.closed = self._live.closed

    def current(self) -> str:
        """The page as it is now."""
        with self._lock:
            if self._page is None:
                found = self._report()
                self._page = (
                    refused_page(found.text)
                    if isinstance(found, Refusal)
                    else page(found, live=found.verdict == "growing")
                )
            return self._page

    def _report(self) -> FlightReport | Refusal:
        made_at_us = time.time_ns() // 1_000
        if self._live.closed and self._request is not None:
            found = flight_report(self._request._replace(made_at_us=made_at_us))
            if not isinstance(found, Refusal):
                self.verdict = found.report.verdict
                return found.report
        live = self._live.report(made_at_us)
        if not isinstance(live, Refusal):
            self.verdict = live.verdict
        return live
