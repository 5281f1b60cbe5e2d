"""`rtshcua report`: flights as pages to look at, and a logbook of several."""

import gc
import json
import os
import re
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated
from urllib.parse import quote

import typer

from rtshcua.adapters.store.writing import make_folder, replace_inside
from rtshcua.app.documents import no_log
from rtshcua.app.files import PAGES, overwriting_another
from rtshcua.app.flights.flight_report import FlightReportRequest, ReportedFlight, flight_report
from rtshcua.app.flights.redaction import REDACTABLE, Redaction, redaction_of
from rtshcua.app.logs import NO_LOG_HELP, is_log, logs_meant
from rtshcua.app.pin import trusted
from rtshcua.app.wording import moment, utc
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import fail, refuse, say
from rtshcua.front.cli.render.progress import octets_of
from rtshcua.front.cli.stdout import out, out_json, out_rendered
from rtshcua.ground.flight.flight_content import FlightReport, as_plain

app = typer.Typer(add_completion=False)

_PAGE, _INDEX = ".html", "index.html"

Runs = Annotated[list[Path], typer.Argument(metavar="RUN...", help="run folders, parents of these, or logs")]
Output = Annotated[
    Path | None,
    typer.Option(
        "-o", "--output", metavar="FILE|FOLDER",
        help="the page, or for several flights the folder to write "
        "[default: RUN.html or `logbook`, flight-1.html if redacted; standard output if piped]",
    ),
]  # fmt: skip
Root = Annotated[
    str | None, typer.Option(metavar="FILE|KEY", help="trust root or its public key [default: the key store's]")
]
Sources = Annotated[
    list[Path] | None,
    typer.Option(metavar="FOLDER", help="where the sources are sought, to name lines (repeatable) [default: here]"),
]
Redact = Annotated[
    str | None, typer.Option(metavar="WHAT", help=f"leave out {' or '.join(REDACTABLE)}, or both: `position,names`")
]
Tiles = Annotated[
    str | None,
    typer.Option(metavar="URL", help="let readers switch on map tiles of this address, with {z}, {x} and {y}"),
]
At = Annotated[str | None, typer.Option(help="date of the page, such as 2026-01-31T08:00:00Z [default: now]")]
AsJson = Annotated[bool, typer.Option("--json", help="print the content of each page as one JSON object a line")]


@app.command()
def report(
    runs: Runs,
    output: Output = None,
    root: Root = None,
    sources: Sources = None,
    redact: Redact = None,
    tiles: Tiles = None,
    at: At = None,
    as_json: AsJson = False,
) -> ExitCode:
    """Render a flight as one HTML page: what was asked, who allowed it, what flew, and how far that is proven.

    The page has a map, heights, a timeline and each decision in words. It works offline and prints. It embeds the log,
    which its reader's browser can verify under a key of the reader's. Several flights also get an index, a logbook.

    The log is verified first, as by `verify-log --audit`. A page is also made of a log that fails, and says so; the
    exit code is that of `verify-log`: of several logs, the first that is not 0. With --redact the page is a picture and
    no record.
    """
    pinned = trusted(root)
    if isinstance(pinned, Refusal):
        return refuse(pinned)
    removed = redaction_of(redact)
    if isinstance(removed, Refusal):
        return refuse(removed)
    wrong = None if tiles is None else _wrong_tiles(tiles)
    if wrong is not None:
        return refuse(wrong)
    made_at = time.time_ns() // 1_000 if at is None else moment(at)
    if made_at is None:
        return fail(ExitCode.USAGE, f"`{at}` is not a UTC time", "accepted: 2026-01-31T08:00:00Z")
    logs = list({os.path.realpath(log): log for log in reversed(logs_meant(runs))}.values())[::-1]
    for log in logs:
        if not is_log(log):
            return fail(ExitCode.INPUT, *no_log(log, log, NO_LOG_HELP))
    request = FlightReportRequest(logs[0], pinned, tuple(sources or (Path(),)), made_at, removed)
    target = _target(output, logs, redacted=bool(removed), as_json=as_json)
    if isinstance(target, Refusal):
        return refuse(target)
    return (
        _one(request, target, tiles or "", as_json=as_json)
        if len(logs) == 1
        else _several(logs, request, target, tiles or "", as_json=as_json)
    )


def _wrong_tiles(address: str) -> Refusal | None:
    """Why an address cannot be that of tiles."""
    plain = re.fullmatch(r"https://[A-Za-z0-9.-]+(?::\d+)?/[\x21-\x7e]*", address) is not None
    if plain and all(part in address for part in ("{z}", "{x}", "{y}")):
        return None
    help = "accepted: an https address with these three, such as https://tiles.example/{z}/{x}/{y}.png"
    return Refusal("usage", f"`{address}` is not an address of map tiles", help, code=ExitCode.USAGE)


def _target(output: Path | None, logs: Sequence[Path], *, redacted: bool, as_json: bool) -> Path | Refusal | None:
    """The file or folder to write; None for standard output."""
    several = len(logs) > 1
    if output is None:
        if as_json or (not several and not sys.stdout.isatty()):
            return None
        output = Path("logbook") if several else Path(_name(logs[0], 1, redacted=redacted) + _PAGE)
    elif str(output) == "-" and not several:
        return None
    if several:
        if output.exists() and not output.is_dir():
            return Refusal("output", f"`{output}` is a file; several flights make a folder of pages")
        return output
    if output.is_dir():
        output /= _name(logs[0], 1, redacted=redacted) + _PAGE
    if output.exists() and not output.is_file():
        return Refusal("output", f"`{output}` is not a regular file, and is not overwritten by a page")
    if not output.parent.is_dir():
        return Refusal("output", f"there is no folder `{output.parent}` to write to", code=ExitCode.INPUT)
    return overwriting_another(output, PAGES, "a page") or output


def _name(log: Path, number: int, *, redacted: bool) -> str:
    """The name of a page: that of the run folder, or of the log; of a redacted page only a number."""
    if redacted:
        return f"flight-{number}"
    folder = log.resolve().parent.name
    name = folder if log.name == "log.jsonl" and folder else log.stem
    return os.fsencode(name).decode("utf-8", "replace")


def _one(request: FlightReportRequest, target: Path | None, tiles: str, *, as_json: bool) -> ExitCode:
    found = _reported(request)
    if isinstance(found, Refusal):
        return refuse(found)
    told, text = found.report, _written(found, target, tiles)
    if isinstance(text, Refusal):
        return refuse(text)
    if as_json:
        out_json(_line(told, target))
    elif target is None:
        out_rendered(text, end="")
    else:
        out(f"{told.verdict}, {told.ending}: written to {target}")
    return found.code


def _several(
    logs: Sequence[Path], request: FlightReportRequest, folder: Path | None, tiles: str, *, as_json: bool
) -> ExitCode:
    from rtshcua.ground.flight.logbook_page import LogbookEntry, logbook_page

    if folder is not None:
        make_folder(folder)
    entries: list[LogbookEntry] = []
    redactions: list[Redaction] = []
    code, names = ExitCode.OK, {Path(_INDEX).stem}
    for number, log in enumerate(logs, 1):
        found = _reported(request._replace(log=log))
        if isinstance(found, Refusal):
            code = code or refuse(found)
            continue
        name = _unlike(_name(log, number, redacted=bool(request.removed)), names)
        page = None if folder is None else folder / (name + _PAGE)
        another = None if page is None else overwriting_another(page, PAGES, "a page")
        told, text = found.report, another or _written(found, page, tiles)
        if isinstance(text, Refusal):
            code = code or refuse(text)
            continue
        if as_json:
            out_json(_line(told, page))
        else:
            out(f"{number} of {len(logs)}: {name}: {told.verdict}, {told.ending}")
        entries.append(LogbookEntry(f"./{quote(name + _PAGE)}", told.without_log()))
        redactions += [found.redaction] if found.redaction is not None else []
        code = code or found.code
    if folder is not None:
        made_by = entries[0].flight.made_by if entries else "rtshcua"
        text = logbook_page(entries, utc(request.made_at_us), made_by)
        left = next((left for each in redactions if (left := each.left(text)) is not None), None)
        if left is not None:
            return refuse(left)
        another = overwriting_another(folder / _INDEX, PAGES, "a page")
        if another is not None:
            return refuse(another)
        replace_inside(folder / _INDEX, text.encode("utf-8"))
        say(f"{len(entries)} flights: open {folder / _INDEX}")
    return code


def _unlike(name: str, names: set[str]) -> str:
    """A name that differs from all others, also where capitals do not count; it becomes one of them."""
    found, number = name, 1
    while found.casefold() in names:
        number += 1
        found = f"{name}-{number}"
    names.add(found.casefold())
    return found


def _reported(request: FlightReportRequest) -> ReportedFlight | Refusal:
    with octets_of("verifying", request.log.stat().st_size) as progress:
        return flight_report(request, progress)


def _written(found: ReportedFlight, target: Path | None, tiles: str) -> str | Refusal:
    from rtshcua.ground.flight.flight_page import page

    gc.freeze()  # what is there stays until the end: looking through it again and again takes a third of the time
    text = page(found.report, tiles=tiles)
    gc.unfreeze()
    left = None if found.redaction is None else found.redaction.left(text)
    if left is not None:
        return left
    if target is not None:
        replace_inside(target, text.encode("utf-8"))
    return text


def _line(found: FlightReport, target: Path | None) -> str:
    content = as_plain(found.without_log())
    return json.dumps({"page": None if target is None else str(target), **content}, ensure_ascii=False)
