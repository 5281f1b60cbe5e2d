"""`rtshcua lint`: report what `check` reports, and warnings about code that compiles."""

from pathlib import Path
from typing import Annotated

import typer

from rtshcua.app.lint.scope import LintOptions
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.render.lint_report import run

app = typer.Typer(add_completion=False)


@app.command()
def lint(
    paths: Annotated[
        list[Path] | None,
        typer.Argument(help="sources (.rts), folders (default: here), or first a mission specification (.json)"),
    ] = None,
    format: Annotated[str, typer.Option(help="format of the report: human, json, sarif, github or junit")] = "human",
    output: Annotated[Path | None, typer.Option("--output", "-o", help="write the report to this file")] = None,
    fail_on: Annotated[
        str | None, typer.Option(help="lowest level that fails: error, warning (default), note or never")
    ] = None,
    with_: Annotated[
        list[Path] | None,
        typer.Option("--with", help="additional sources, such as a specification's policy (repeatable)"),
    ] = None,
    changed: Annotated[
        bool, typer.Option("--changed", help="only files changed according to git, and files that import them")
    ] = False,
    base: Annotated[
        str | None, typer.Option(help="like --changed, compared with the merge base of this branch")
    ] = None,
    fix: Annotated[bool, typer.Option("--fix", help="apply the fixes that preserve the meaning")] = False,
    unsafe_fixes: Annotated[
        bool, typer.Option("--unsafe-fixes", help="apply also fixes that need review; see --diff first")
    ] = False,
    diff: Annotated[bool, typer.Option("--diff", help="print the changes of the fixes without applying them")] = False,
    config: Annotated[Path | None, typer.Option(help="use this configuration for all files, not the nearest")] = None,
    isolated: Annotated[bool, typer.Option("--isolated", help="ignore all configuration files")] = False,
    no_cache: Annotated[bool, typer.Option("--no-cache", help="neither read nor write the cache")] = False,
    statistics: Annotated[bool, typer.Option("--statistics", help="count the findings by code")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="the same as --format json")] = False,
) -> ExitCode:
    """Report what `check` reports, and warnings about code that compiles.

    Rules, configuration (rtshcua.toml), ignores with a reason, fixes and the cache: docs/linting.md.

    Exit codes: 0 no finding at or above the level of --fail-on; 1 at least one (with --diff: a fix would change a
    file); 2 wrong command line; 3 a file or configuration cannot be read, or git fails; 74 a fix or report cannot be
    written.
    """
    return run(
        LintOptions(
            tuple(paths or [Path()]),
            format=format,
            output=output,
            fail_on=fail_on,
            with_=tuple(with_ or ()),
            changed=changed,
            base=base,
            fix=fix,
            unsafe_fixes=unsafe_fixes,
            diff=diff,
            config=config,
            isolated=isolated,
            no_cache=no_cache,
            statistics=statistics,
            json=as_json,
        )
    )
