"""`rtshcua report`: flights as pages to look at, and a logbook of several."""

import json
import os
import re
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.app.documents import no_log
from rtshcua.app.flights.flight_report import FlightReportRequest
from rtshcua.app.flights.redaction import REDACTABLE, redaction_of
from rtshcua.app.flights.report_pages import FlightPage, Logbook, default_target, flight_page, target_of
from rtshcua.app.logs import NO_LOG_HELP, is_log, logs_or_unread, worst
from rtshcua.app.pin import trusted
from rtshcua.app.wording import many, moment
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import fail, refuse, say
from rtshcua.front.cli.render.progress import octets_of
from rtshcua.front.cli.stdout import out, out_json, out_rendered
from rtshcua.ground.flight.flight_content import as_plain

app = typer.Typer(add_completion=False)

Runs = Annotated[list[Path], typer.Argument(metavar="RUN...", help="run folders, parents of these, or logs")]
Output = Annotated[
    Path | None,
    typer.Option(
        "-o", "--output", metavar="FILE|FOLDER",
        help="the page, or for several flights the folder to write "
        "[default: RUN.html or `logbook`, flight-1.html if redacted; one page is piped]",
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
    exit code is that of `verify-log`. Of several logs it is the worst: 12, 15, 11, 9 for evidence that fails, then any
    other code such as 3 for a log that could not be read, then 10, then 0. With --redact the page is a picture and no
    record.
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
    logs = list({os.path.realpath(log): log for log in reversed(logs_or_unread(runs))}.values())[::-1]
    if len(logs) == 1 and not is_log(logs[0]):
        return fail(ExitCode.INPUT, *no_log(logs[0], logs[0], NO_LOG_HELP))
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
        output = default_target(logs, redacted=redacted)
    elif str(output) == "-":
        text = "several flights make a folder of pages, which cannot be on standard output"
        return Refusal("usage", text, "name a folder with `-o`", code=ExitCode.USAGE) if several else None
    return target_of(output, logs, redacted=redacted)


def _one(request: FlightReportRequest, target: Path | None, tiles: str, *, as_json: bool) -> ExitCode:
    with octets_of("verifying", request.log.stat().st_size) as progress:
        made = flight_page(request, target, tiles, progress)
    if isinstance(made, Refusal):
        return refuse(made)
    if as_json:
        out_json(_line(made))
    elif target is None:
        out_rendered(made.text, end="")
    else:
        out(f"{made.report.verdict}, {made.report.ending}: written to {target}")
    return made.code


def _several(
    logs: Sequence[Path], request: FlightReportRequest, folder: Path | None, tiles: str, *, as_json: bool
) -> ExitCode:
    logbook, codes, number = Logbook(folder, request, tiles), list[ExitCode](), 0
    for log in logs:
        with octets_of("verifying", _octets(log)) as progress:
            made = logbook.add(log, progress)
        if isinstance(made, Refusal):
            codes.append(refuse(made))
            continue
        number += 1
        codes.append(made.code)
        if as_json:
            out_json(_line(made))
        else:
            name = log.parent.name if made.file is None else made.file.stem
            out(f"{number} of {len(logs)}: {name}: {made.report.verdict}, {made.report.ending}")
    index = logbook.finish()
    if isinstance(index, Refusal):
        return refuse(index)
    if index is not None:
        say(f"{many(number, 'flight')}: open {index}")
    return worst(codes)


def _octets(log: Path) -> int:
    """The size of a log; 0 if it cannot be read, which is told later."""
    try:
        return log.stat().st_size if log.is_file() else 0
    except OSError:
        return 0


def _line(made: FlightPage) -> str:
    content = as_plain(made.report.without_log())
    return json.dumps({"page": None if made.file is None else str(made.file), **content}, ensure_ascii=False)
