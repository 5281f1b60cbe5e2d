"""`rtshcua lsp`: the language server for editors."""

from typing import Annotated

import typer

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.faults import fail
from rtshcua.front.cli.interrupts import breakable
from rtshcua.library import root

app = typer.Typer(add_completion=False)


@app.command()
def lsp(
    tcp: Annotated[
        int | None, typer.Option(help="listen on this port of 127.0.0.1 for one editor, instead of the streams")
    ] = None,
    stdio: Annotated[bool, typer.Option("--stdio", help="speak over the standard streams, as without options")] = False,
) -> ExitCode:
    """Serve an editor: findings while you write, hover, definitions, renaming, completion, formatting.

    Speaks the Language Server Protocol over the standard streams until the editor ends; docs/editor.md says how to set
    editors up. Needs the extra `editor`. Runs nothing that a workspace holds.

    Ends with 0, with 2 where the command line is wrong or the extra is missing.
    """
    try:
        from rtshcua.front.lsp.server import serve
    except ModuleNotFoundError as missing:
        if (missing.name or "").partition(".")[0] not in ("pygls", "lsprotocol"):
            raise
        return fail(
            ExitCode.USAGE, "the language server is not installed", 'in the checkout: `pip install ".[editor]"`'
        )
    if tcp is not None and (stdio or not 0 < tcp < 1 << 16):
        return fail(ExitCode.USAGE, "`--tcp` takes a port from 1 to 65535, and goes without `--stdio`")
    with breakable():
        serve(str(root()), tcp)
    return ExitCode.OK
