"""`rtshcua check`: report everything that is wrong with sources."""

from pathlib import Path
from typing import Annotated

import typer

from rtshcua.cli.findings import Findings, exit_code
from rtshcua.cli.sources import check_sources
from rtshcua.diagnostics.exits import ExitCode

app = typer.Typer(add_completion=False)


@app.command()
def check(
    paths: Annotated[list[Path], typer.Argument(help="sources (.rts), or a mission specification (.json) first")],
    deny_warnings: Annotated[bool, typer.Option("--deny-warnings", help="warnings are errors")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object on the standard output")] = False,
) -> ExitCode:
    """Report everything that is wrong with sources and what they import. Needs no keys, and writes nothing."""
    findings = Findings(json=as_json, deny_warnings=deny_warnings)
    found, sources = check_sources(paths)
    if findings.report(found, sources):
        return findings.finish(exit_code(found))
    if not as_json:
        print(f"no errors in {len(sources)} file{'s' * (len(sources) > 1)}")
    return findings.finish(ExitCode.OK)
