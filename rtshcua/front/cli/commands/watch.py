"""`rtshcua watch`: a flight in a browser of this machine, while it flies."""

import json
import time
from pathlib import Path
from typing import Annotated, Final

import typer

from rtshcua.app.flights.flight_report import FlightReportRequest
from rtshcua.app.flights.watched import WatchedPage, log_of_flight
from rtshcua.app.pin import trusted
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import fail, refuse, say
from rtshcua.front.cli.interrupts import StopRequest
from rtshcua.front.cli.stdout import out, out_json
from rtshcua.front.web.page_server import PageServer, served

app = typer.Typer(add_completion=False)

#: how often the log is read, s
_EVERY_S: Final = 0.5


@app.command()
def watch(
    flight: Annotated[Path, typer.Argument(metavar="SOCKET|RUN", help="the flight's socket, or its run folder")],
    web: Annotated[bool, typer.Option("--web", help="serve the page of the flight on this machine")] = False,
    runs: Annotated[Path, typer.Option(metavar="FOLDER", help="where the flight of a socket keeps its log")]
    = Path("runs"),
    port: Annotated[int, typer.Option(min=0, max=65_535, help="port on 127.0.0.1; 0: any free one")] = 0,
    root: Annotated[
        str | None, typer.Option(metavar="FILE|KEY", help="root to verify the closed log [default: the key store's]")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object with the address, and one at the end")]
    = False,
) -> ExitCode:  # fmt: skip
    """Serve the page of `rtshcua report` while a flight lasts; it grows as the flight is recorded.

    The page is on the loopback interface, and its address has a secret token: whoever knows it can read the page and
    change nothing. The flight is not asked anything: its log and its telemetry are read from the disk. When the log is
    closed, it is verified, and the page has the result.

    The command ends with Ctrl-C. In the terminal of `rtshcua run` the flight's own view stays.
    """
    if not web:
        help = "`rtshcua run` shows the flight in its own terminal, and `rtshcua operator` follows it in another"
        return fail(ExitCode.USAGE, "`--web` is missing: without it there is nothing to serve", help)
    log = log_of_flight(flight, runs)
    if isinstance(log, Refusal):
        return refuse(log)
    pinned = trusted(root)
    if isinstance(pinned, Refusal):
        say(f"the closed log will not be verified: {pinned.text}")
    request = None if isinstance(pinned, Refusal) else FlightReportRequest(log, pinned, (Path(),), 0)
    page = WatchedPage(log, request)
    with PageServer(lambda: served(page.current()), port) as server, StopRequest() as stop:
        if as_json:
            out_json(json.dumps({"address": server.address, "log": str(log)}))
        else:
            out(server.address)
            say(f"the page of {log}, for this machine alone; Ctrl-C ends")
        while not stop.asked:
            time.sleep(_EVERY_S)
            page.update()
            if server.fault is not None:
                raise server.fault
    if as_json:
        page.current()  # a closed log is verified, also if nobody looked
        out_json(json.dumps({"closed": page.closed, "verdict": page.verdict}))
    return ExitCode.OK
