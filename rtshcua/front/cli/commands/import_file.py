"""`rtshcua import`: turn a file of the trade into a source."""

from pathlib import Path
from typing import Annotated

import typer

from rtshcua.app import importing as service
from rtshcua.app.importing import PROPOSERS, TARGETS, USES, ImportedSource, ImportRequest
from rtshcua.app.wording import many
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import say
from rtshcua.front.cli.render.findings import Findings
from rtshcua.front.cli.stdout import out, out_source

app = typer.Typer(add_completion=False)


@app.command("import")
def import_file(
    file: Annotated[Path, typer.Argument(help="a plan (.plan), KML, KMZ, GeoJSON, ED-269 or ED-318")],
    to: Annotated[
        str, typer.Option("--to", metavar="TARGET", help=f"one of {', '.join(TARGETS)} [default: by the file]")
    ] = "",
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="the source to write, a new file [default: standard output]")
    ] = None,
    policy: Annotated[
        Path | None, typer.Option(help="the source of the policy of a mission [default: one is made for the file]")
    ] = None,
    skip: Annotated[
        list[str] | None, typer.Option(help="leave out a part that is not kept: its name or place, or `all`")
    ] = None,
    proposer: Annotated[str, typer.Option(help=f"who proposes a mission: {' or '.join(PROPOSERS)}")] = PROPOSERS[0],
    use: Annotated[
        str, typer.Option("--as", metavar="USE", help=f"what plain areas are for: {' or '.join(USES)}")
    ] = USES[0],
    terrain: Annotated[
        str, typer.Option(metavar="LOW..HIGH", help="the lowest and the highest ground of the site, in m above sea")
    ] = "",
    clock: Annotated[str, typer.Option(metavar="OFFSET", help="the fixed offset of the vehicle's clock: +02:00")] = "",
    width: Annotated[str, typer.Option(metavar="METRES", help="the width of the corridors along lines, in m")] = "",
    legs: Annotated[
        bool, typer.Option("--legs", help="keep the planned legs of surveys, instead of steps with pictures")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object on standard output")] = False,
) -> ExitCode:
    """Turn a plan of QGroundControl into a source with its mission or fence, and KML, GeoJSON or official zones into
    zones (docs/import.md).

    Each loss is named, with its place in the file and its consequence. A part that cannot be kept, because it would
    change where the vehicle flies or where a zone is, is an error; nothing is written unless `--skip` leaves it out.
    What is written is formatted, and checked as `rtshcua check` does.

    Exit codes: 0 written, and the checker finds no error; 1 a part is not kept, or the checker finds errors in what was
    written; 2 wrong command line; 3 the file is missing, malformed or too large.
    """
    findings = Findings(json=as_json)
    request = ImportRequest(file, to, output, policy, tuple(skip or ()), proposer, use, terrain, clock, width, legs)
    found = service.import_file(request)
    if isinstance(found, Refusal):
        return findings.end(found)
    if not as_json:
        for line in found.told():
            say(line)
        _write(found, output)
    findings.report(found.diagnostics, found.sources)
    source = found.text if output is None else None
    written = None if output is None or found.not_kept else str(output)
    return findings.finish(found.code, **found.as_object(), file=written, source=source)


def _write(found: ImportedSource, output: Path | None) -> None:
    """Say what was written, or print it."""
    if found.not_kept:
        return
    if output is None:
        out_source(found.text)
    else:
        out(f"wrote `{output}`: {many(found.steps, 'step')}, {many(found.zones, 'zone')}")
