"""A flight that is under way: its log, in a run folder or by the flight's id that its socket tells, and its page."""

import threading
import time
from pathlib import Path
from stat import S_ISSOCK

from rtshcua.adapters.agent_socket import FlightFollower
from rtshcua.adapters.store.runs import LOG
from rtshcua.app.documents import no_log
from rtshcua.app.flights.flight_report import FlightReportRequest, LiveFlight, flight_report
from rtshcua.app.logs import NO_LOG_HELP, is_log, log_below
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
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
    found = log_below(runs, follower.flight)
    if found is not None:
        return found
    help = "name the folder of its runs with `--runs`, or the run folder itself in place of the socket"
    text = f"no log of the flight {follower.flight.hex()} is below `{runs}`"
    return Refusal("input", text, help, code=ExitCode.INPUT)


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
