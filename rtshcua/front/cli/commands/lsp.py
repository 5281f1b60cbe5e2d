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
    tcp: Annotated[int | None, typer.Option(help="listen on this port of 127.0.0.1 for one editor")] = None,
    stdio: Annotated[bool, typer.Option("--stdio", help="use the standard streams (default)")] = False,
) -> ExitCode:
    """Run the language server: live diagnostics, hover, definitions, renaming, completion and formatting.

    It speaks the Language Server Protocol over the standard streams until the editor ends the session. Editor setup:
    docs/editor.md. Requires the extra `editor`. It runs no code from the workspace.

    Exit codes: 0 the session ended; 2 wrong command line, or the extra is missing.
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
        return fail(ExitCode.USAGE, "`--tcp` requires a port from 1 to 65535, and cannot be combined with `--stdio`")
    with breakable():
        serve(str(root()), tcp)
    return ExitCode.OK
