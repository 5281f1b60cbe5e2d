"""Write the pages of flights: one, or a folder of them with a logbook. They replace pages and no other file."""

import gc
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple
from urllib.parse import quote

from rtshcua.adapters.store.verification import Progress
from rtshcua.adapters.store.writing import make_folder, replace_inside
from rtshcua.app.documents import no_log
from rtshcua.app.exit_codes import words_of
from rtshcua.app.files import PAGES, overwriting_another
from rtshcua.app.flights.flight_report import FlightReportRequest, ReportedFlight, flight_report
from rtshcua.app.flights.redaction import Redaction
from rtshcua.app.logs import NO_LOG_HELP, is_log
from rtshcua.app.wording import utc
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.flight.flight_content import FlightReport
from rtshcua.ground.flight.flight_page import page
from rtshcua.ground.flight.logbook_page import LogbookEntry, UnreadLog, logbook_page

_PAGE, _INDEX = ".html", "index.html"
_A_PAGE: Final = "a page"
#: in place of the reason in a redacted logbook, where a path could be a name
_NOT_TOLD: Final = "a log could not be read; why is not told in a redacted logbook"


class FlightPage(NamedTuple):
    """The page of a flight: what it shows, its text, the file that has it (None if none was asked for), and the exit
    code of the verification.
    """

    report: FlightReport
    text: str
    file: Path | None
    code: ExitCode


def default_target(logs: Sequence[Path], *, redacted: bool) -> Path:
    """What is written if nothing is named: a file, or for several flights a folder."""
    return Path("logbook") if len(logs) > 1 else Path(_name(logs[0], 1, redacted=redacted) + _PAGE)


def target_of(output: Path, logs: Sequence[Path], *, redacted: bool) -> Path | Refusal:
    """The file to write, or for several flights the folder. Raises OSError."""
    if len(logs) > 1:
        if output.exists() and not output.is_dir():
            return Refusal("output", f"`{output}` is a file; several flights make a folder of pages")
        return output
    if output.is_dir():
        output /= _name(logs[0], 1, redacted=redacted) + _PAGE
    if output.exists() and not output.is_file():
        return Refusal("output", f"`{output}` is not a regular file, and is not overwritten by a page")
    if not output.parent.is_dir():
        return Refusal("output", f"there is no folder `{output.parent}` to write to", code=ExitCode.INPUT)
    return overwriting_another(output, PAGES, _A_PAGE) or output


def flight_page(
    request: FlightReportRequest, file: Path | None, tiles: str, progress: Progress = lambda _: None
) -> FlightPage | Refusal:
    """Make the page of a flight, the last thing that a process does, and write it. Raises OSError."""
    found = flight_report(request, progress)
    if isinstance(found, Refusal):
        return found
    made = _written(found, file, tiles)
    gc.freeze()  # the search for cycles at the end of the process would find nothing to free
    return made


class Logbook:
    """Writes the pages of several flights, and last their index; without a folder it writes nothing."""

    def __init__(self, folder: Path | None, request: FlightReportRequest, tiles: str) -> None:
        if folder is not None:
            make_folder(folder)
        self._folder, self._request, self._tiles = folder, request, tiles
        self._names = {Path(_INDEX).stem}
        self._entries: list[LogbookEntry] = []
        self._redactions: list[Redaction] = []
        self._unread: list[UnreadLog] = []

    def add(self, log: Path, progress: Progress = lambda _: None) -> FlightPage | Refusal:
        """Add the page of the next flight; if its files cannot be read, a row that says why. Raises OSError if the page
        cannot be written.
        """
        found = self._reported(log, progress)
        if isinstance(found, Refusal):
            redacted = bool(self._request.removed)
            name, why = ("", _NOT_TOLD) if redacted else (_name(log, 0, redacted=False), found.text)
            self._unread.append(UnreadLog(name, why))
            return found
        name = self._unlike(_name(log, len(self._entries) + 1, redacted=bool(self._request.removed))) + _PAGE
        file = None if self._folder is None else self._folder / name
        made = (None if file is None else overwriting_another(file, PAGES, _A_PAGE)) or _written(
            found, file, self._tiles
        )
        if isinstance(made, FlightPage):
            self._entries.append(LogbookEntry(f"./{quote(name)}", made.report.without_log()))
            self._redactions += [] if found.redaction is None else [found.redaction]
        return made

    def _reported(self, log: Path, progress: Progress) -> ReportedFlight | Refusal:
        try:
            if not is_log(log):
                return Refusal("input", *no_log(log, log, NO_LOG_HELP), code=ExitCode.INPUT)
            return flight_report(self._request._replace(log=log), progress)
        except OSError as error:
            return Refusal("input", f"`{log}` cannot be read: {words_of(error)}", NO_LOG_HELP, code=ExitCode.INPUT)

    def finish(self) -> Path | Refusal | None:
        """Write the index; return its file, None without a folder. Raises OSError."""
        if self._folder is None:
            return None
        made_by = self._entries[0].flight.made_by if self._entries else "rtshcua"
        text = logbook_page(self._entries, utc(self._request.made_at_us), made_by, self._unread)
        index = self._folder / _INDEX
        left = next((left for each in self._redactions if (left := each.left(text)) is not None), None)
        refused = left or overwriting_another(index, PAGES, _A_PAGE)
        if refused is not None:
            return refused
        replace_inside(index, text.encode("utf-8"))
        return index

    def _unlike(self, name: str) -> str:
        """A name that differs from all others, also where capitals do not count."""
        found, number = name, 1
        while found.casefold() in self._names:
            number += 1
            found = f"{name}-{number}"
        self._names.add(found.casefold())
        return found


def _name(log: Path, number: int, *, redacted: bool) -> str:
    """The name of a page: that of the run folder, or of the log; of a redacted page only a number."""
    if redacted:
        return f"flight-{number}"
    folder = Path(os.path.realpath(log)).parent.name  # also of a link that leads to itself
    name = folder if log.name == "log.jsonl" and folder else log.stem
    return os.fsencode(name).decode("utf-8", "replace")


def _written(found: ReportedFlight, file: Path | None, tiles: str) -> FlightPage | Refusal:
    collecting = gc.isenabled()
    gc.disable()  # what is there stays until the end: searching it again and again takes a third of the time
    try:
        text = page(found.report, tiles=tiles)
    finally:
        if collecting:
            gc.enable()
    left = None if found.redaction is None else found.redaction.left(text)
    if left is not None:
        return left
    if file is not None:
        replace_inside(file, text.encode("utf-8"))
    return FlightPage(found.report, text, file, found.code)
