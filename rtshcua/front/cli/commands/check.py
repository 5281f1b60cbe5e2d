"""`rtshcua check`: report the errors in sources and mission specifications."""

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
        typer.Argument(help="sources (.rts), folders (default: here), or first a mission specification (.json)"),
    ] = None,
    since: Annotated[
        Path | None, typer.Option(help="an earlier bundle, source or folder; a changed policy needs a new version")
    ] = None,
    with_: Annotated[
        list[Path] | None,
        typer.Option("--with", help="additional sources, such as a specification's policy (repeatable)"),
    ] = None,
    map_: Annotated[
        Path | None, typer.Option("--map", metavar="FILE.html", help="draw zones, routes and errors of the missions")
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(metavar="FILE.svg", help="draw the missions from above and from the side (-: standard output)"),
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="assume this time of issue (UTC) and apply the dates of zones"),
    ] = None,
    deny_warnings: Annotated[
        bool, typer.Option("--deny-warnings", help="treat warnings as errors; notes stay notes")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object on standard output")] = False,
) -> ExitCode:
    """Report all errors in sources and in what they import. Needs no keys, and writes only --map and --picture.

    Each source and its imports form one program. A source that another one imports is checked as part of it. With a
    mission specification, all other sources belong to its policy. `rtshcua lint` also reports warnings about code that
    compiles, and can fix, ignore and export findings.

    Without --at, the hours of zones are checked and their dates are not, so that the result does not depend on today's
    date. If a zone with dates is in force now, the command also prints what would be refused now.

    With --map, the missions are drawn on one HTML page as far as their routes are planned, also if they have errors;
    with --picture in one SVG file, one below the other: zones, routes, margins, ways home, heights and errors.

    With --since, at least one policy must have an earlier version of the same name and vehicle there; otherwise
    nothing was compared, which is an error (3). Earlier policies without a counterpart here are listed.

    Exit codes: 0 no errors; 1 errors; 2 wrong command line; 3 a file cannot be read, or nothing was compared; 4 the
    format version of the --since bundle is unknown.
    """
    return check_sources(
        paths or [Path()],
        since=since,
        with_=with_ or (),
        map_=map_,
        picture=picture,
        at=at,
        deny_warnings=deny_warnings,
        as_json=as_json,
    )
