"""`rtshcua check`: report everything that is wrong with sources."""

from pathlib import Path
from typing import Annotated

import typer

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.render.check_report import check_sources

app = typer.Typer(add_completion=False)


@app.command()
def check(
    paths: Annotated[
        list[Path] | None,
        typer.Argument(help="sources (.rts), folders of them (this one), or a mission specification (.json) first"),
    ] = None,
    since: Annotated[
        Path | None, typer.Option(help="an earlier bundle, source or folder: a policy that differs needs a new version")
    ] = None,
    with_: Annotated[
        list[Path] | None, typer.Option("--with", help="further sources: a specification's policy (repeatable)")
    ] = None,
    map_: Annotated[
        Path | None, typer.Option("--map", metavar="FILE.html", help="draw the missions: zones, way, where it fails")
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="as if the missions were issued then, UTC: the dates of zones count"),
    ] = None,
    deny_warnings: Annotated[bool, typer.Option("--deny-warnings", help="warnings are errors; notes are not")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object on the standard output")] = False,
) -> ExitCode:
    """Report everything that is wrong with sources and what they import. Needs no keys, and writes nothing but --map.

    Each source is a program of its own with what it imports; one that another of them imports is checked with that. A
    mission specification takes all other sources as its policy's. What is worth a second look besides, and how to
    ignore, fix and report it in CI: `rtshcua lint`.

    Without --at, hours count and the dates of zones do not, so that no check fails because of another day; where such a
    zone exists now, it is told what would be refused now.

    With --map the missions are drawn as one HTML page, whether or not they are refused, as far as their way is planned.

    With --since some policy here must have an earlier version there, by its name and vehicle: else nothing was
    compared, which is an error (3). An earlier policy that none here was compared with is told.

    Ends with 0 where there are no errors, 1 where there are, 2 where the command line is wrong, 3 where a file cannot
    be read or nothing was compared, 4 where --since names a bundle of a version that is not known here.
    """
    return check_sources(
        paths or [Path()],
        since=since,
        with_=with_ or (),
        map_=map_,
        at=at,
        deny_warnings=deny_warnings,
        as_json=as_json,
    )
