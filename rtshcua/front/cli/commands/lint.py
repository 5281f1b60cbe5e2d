"""`rtshcua lint`: everything that `check` finds, and what is worth a second look."""

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
        typer.Argument(help="sources (.rts), folders of them (this one), or a mission specification (.json) first"),
    ] = None,
    format: Annotated[str, typer.Option(help="human, json, sarif, github or junit")] = "human",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="write the report of that format to a file instead")
    ] = None,
    fail_on: Annotated[
        str | None, typer.Option(help="error, warning, note or never: from which level on the run fails (warning)")
    ] = None,
    with_: Annotated[
        list[Path] | None, typer.Option("--with", help="further sources: a specification's policy (repeatable)")
    ] = None,
    changed: Annotated[
        bool, typer.Option("--changed", help="only what git says has changed, and what imports it")
    ] = False,
    base: Annotated[str | None, typer.Option(help="--changed, and since this branch left that one")] = None,
    fix: Annotated[bool, typer.Option("--fix", help="make the fixes that keep your meaning")] = False,
    unsafe_fixes: Annotated[
        bool, typer.Option("--unsafe-fixes", help="make also those that need your judgement; look at --diff first")
    ] = False,
    diff: Annotated[bool, typer.Option("--diff", help="print what fixes would change, and change nothing")] = False,
    config: Annotated[
        Path | None, typer.Option(help="this configuration for all files, instead of the nearest to each")
    ] = None,
    isolated: Annotated[bool, typer.Option("--isolated", help="no configuration at all")] = False,
    no_cache: Annotated[bool, typer.Option("--no-cache", help="examine everything anew, and remember nothing")] = False,
    statistics: Annotated[bool, typer.Option("--statistics", help="say how often each code was found")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="the same as --format json")] = False,
) -> ExitCode:
    """Report everything that `check` finds, and what is worth a second look in the sources that were asked for.

    Rules, configuration (rtshcua.toml), ignores with a reason, fixes and the cache: docs/linting.md.

    Ends with 0 where nothing was found of the level that fails, 1 where something was (with --diff: where a fix would
    change something), 2 where the command line is wrong, 3 where a file or a configuration cannot be read, or git
    cannot say what has changed, 74 where a fix or a report cannot be written.
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
