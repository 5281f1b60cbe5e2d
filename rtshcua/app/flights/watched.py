"""Find the log of a flight that is under way: in a run folder, or by the flight's id that its socket tells."""

from collections.abc import Iterator
from pathlib import Path
from stat import S_ISSOCK

from rtshcua.adapters.agent_socket import FlightFollower
from rtshcua.adapters.store.reading import open_regular
from rtshcua.adapters.store.runs import LOG, logs_of
from rtshcua.app.documents import no_log
from rtshcua.app.logs import NO_LOG_HELP, is_log
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.reading import LONGEST, read
from rtshcua.evidence.records import Genesis


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
