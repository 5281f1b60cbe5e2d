"""`rtshcua replace`: hand a flight the mission that takes the place of its own."""

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
    replacement: Annotated[Path, typer.Argument(help="what `rtshcua compile --replaces` made")],
    to: Annotated[Path, typer.Option(metavar="SOCKET", help="the flight's operator or agent socket")],
    as_json: AsJson = False,
) -> ExitCode:
    """Hand a flight a signed replacement: steps that were not released yet become those of another mission.

    It is verified on board like the mission itself, under the same policy. `rtshcua compile --replaces` makes one.
    """
    document = read_regular(replacement, MAX_DOCUMENT)
    try:
        kind = kind_of(document)
    except Untrusted as error:
        return fail(ExitCode.INPUT, f"`{replacement}` is no replacement: {error}")
    if kind is not names.REPLACEMENT:
        return fail(ExitCode.INPUT, f"`{replacement}` is no replacement, but `{kind.name}`")
    return deliver(document, f"replaced by `{replacement}`", to=to, output=None, as_json=as_json)
