"""`rtshcua replace`: send a replacement mission to a flight."""

from pathlib import Path
from typing import Annotated

import typer

from rtshcua.adapters.store.reading import read_regular
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.documents import deliver
from rtshcua.front.cli.faults import fail
from rtshcua.front.cli.options.document_options import AsJson
from rtshcua.wire import names
from rtshcua.wire.document import MAX_DOCUMENT, kind_of
from rtshcua.wire.untrusted import Untrusted

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
    document = read_regular(replacement, MAX_DOCUMENT)
    try:
        kind = kind_of(document)
    except Untrusted as error:
        return fail(ExitCode.INPUT, f"`{replacement}` is not a replacement: {error}")
    if kind is not names.REPLACEMENT:
        return fail(ExitCode.INPUT, f"`{replacement}` is not a replacement but `{kind.name}`")
    return deliver(document, f"replaced by `{replacement}`", to=to, output=None, as_json=as_json)
