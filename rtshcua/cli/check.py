"""`rtshcua check`: report everything that is wrong with sources."""

from pathlib import Path
from typing import Annotated

import typer

from rtshcua.cli.bounds import bounds_told
from rtshcua.cli.checking import Mission, check_all
from rtshcua.cli.earlier import Earlier, earlier_policies
from rtshcua.cli.findings import Findings, exit_code
from rtshcua.cli.programs import Unusable, programs, unfolded
from rtshcua.cli.progress import watched
from rtshcua.diagnostics.exits import ExitCode

app = typer.Typer(add_completion=False)


@app.command()
def check(
    paths: Annotated[
        list[Path], typer.Argument(help="sources (.rts), folders of them, or a mission specification (.json) first")
    ],
    since: Annotated[
        Path | None, typer.Option(help="an earlier bundle, source or folder: a policy that differs needs a new version")
    ] = None,
    with_: Annotated[
        list[Path] | None, typer.Option("--with", help="further sources: a specification's policy (repeatable)")
    ] = None,
    deny_warnings: Annotated[bool, typer.Option("--deny-warnings", help="warnings are errors; notes are not")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object on the standard output")] = False,
) -> ExitCode:
    """Report everything that is wrong with sources and what they import. Needs no keys, and writes nothing.

    Each source is a program of its own with what it imports; one that another of them imports is checked with that. A
    mission specification takes all other sources as its policy's. What is worth a second look (E1301 to E1305) is said
    of the sources that were asked for alone.

    Ends with 0 where there are no errors, 1 where there are, 2 where the command line is wrong, 3 where a file cannot
    be read, 4 where --since names a bundle of a version that is not known here.
    """
    findings = Findings(json=as_json, deny_warnings=deny_warnings)
    files = unfolded(paths)
    if isinstance(files, Unusable):
        return findings.refuse(*files)
    earlier = Earlier("", ()) if since is None else earlier_policies(since)
    if isinstance(earlier, Unusable):
        return findings.refuse(*earlier)
    found = check_all(watched(programs(files, tuple(with_ or ()))), earlier)
    code = exit_code(found.diagnostics) if findings.report(found.diagnostics, found.sources) else ExitCode.OK
    if code is ExitCode.OK and not as_json:
        print(f"no errors in {len(found.sources)} file{'s' * (len(found.sources) > 1)}")
        for mission in found.missions:
            print(f"{_named(mission, found.missions)}: {bounds_told(mission.bounds)}")
        for each in found.versions:
            print(f"{each.name}: version {each.version}, and {each.earlier} in {since}")
        if since is not None and not found.versions:
            print(f"nothing in {since} is an earlier version of a policy here")
    return findings.finish(
        code,
        missions=[{"mission": each.name, "file": each.file} | each.bounds._asdict() for each in found.missions],
        versions=[{"policy": each.name, "version": each.version, "earlier": each.earlier} for each in found.versions],
    )


def _named(mission: Mission, missions: tuple[Mission, ...]) -> str:
    """A mission's name; with its file, where another has the same."""
    alone = sum(each.name == mission.name for each in missions) == 1
    return mission.name if alone else f"{mission.name} ({mission.file})"
