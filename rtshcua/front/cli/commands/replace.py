"""`rtshcua replace`: send a replacement mission to a flight."""

from pathlib import Path
from typing import Annotated

import typer

from rtshcua.app.flight_documents import replacement_in
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.documents import deliver
from rtshcua.front.cli.faults import refuse
from rtshcua.front.cli.options.document_options import AsJson

app = typer.Typer(add_completion=False)


@app.command()
def replace(
    replacement: Annotated[Path, typer.Argument(help="a replacement from `rtshcua compile --replaces`")],
    to: Annotated[Path, typer.Option(metavar="SOCKET", help="the flight's operator or agent socket")],
    as_json: AsJson = False,
) -> ExitCode:
    """Send a signed replacement to a flight: it replaces the steps that have not been released yet.

    The vehicle verifies it like the mission, under the same policy. `rtshcua compile --replaces` makes one.
    """
    document = replacement_in(replacement)
    if isinstance(document, Refusal):
        return refuse(document)
    return deliver(document, f"replaced by `{replacement}`", to=to, output=None, as_json=as_json)
