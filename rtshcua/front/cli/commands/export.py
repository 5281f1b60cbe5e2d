"""`rtshcua export`: write a flight as a file for maps, spreadsheets and ground stations."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.app.flights import flight_export as service
from rtshcua.app.flights.flight_export import ExportedFile, ExportRequest
from rtshcua.app.wording import many
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import fail, refuse, say
from rtshcua.front.cli.stdout import out, out_bytes, out_json
from rtshcua.ground.flight.export import BINARY, FORMATS, GEOTAG, PLAN, TLOG

_POINTS = {PLAN: "item", TLOG: "frame", GEOTAG: "image"}

app = typer.Typer(add_completion=False)


@app.command()
def export(
    run: Annotated[Path, typer.Argument(help="a run folder, or its log")],
    to: Annotated[str, typer.Option("--to", metavar="FORMAT", help=f"one of {', '.join(FORMATS)}")],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="the file to write [default: RUN.FORMAT, or standard output if piped]"),
    ] = None,
    images: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="the image files of a geotag export, to find their names")
    ] = None,
    tag: Annotated[bool, typer.Option("--tag", help="write the places into these files too, by ExifTool")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="describe the written file as one JSON object")] = False,
) -> ExitCode:
    """Write a flight as a file for other programs: the recorded telemetry, with the decisions of the log.

    kml, gpx and geojson: track, planned path, zones and decisions, for maps. csv: track, signals and decisions in one
    table. plan: the planned mission for QGroundControl, which needs no telemetry. mcap: everything with its time, for
    Foxglove and PlotJuggler; requires the extra `export`. tlog: the telemetry up to its last whole frame. geotag: the
    places of the recorded images as `geo.txt` for WebODM, and with `--tag` in the files themselves.

    The log is verified with the key store's root. The result is on standard error and in the file, except in tlog. An
    export is never a record: only the log is evidence.

    Exit codes: 0 written, whether or not the log verifies; 2 wrong format or output; 3 no log or no telemetry; 9 the
    log is damaged.
    """
    refused = service.accepted(to)
    if refused is not None:
        return refuse(refused)
    target = _target(run, to, output, as_json=as_json)
    if target is None and as_json:
        return fail(ExitCode.USAGE, "`--json` and the file cannot both be on standard output", "name a file with `-o`")
    if target is None and to in BINARY and sys.stdout.isatty():
        return fail(ExitCode.USAGE, f"`{to}` is binary, and is not written to a terminal", "name a file with `-o`")
    made = service.export(ExportRequest(run, to, target, images, tag))
    if isinstance(made, Refusal):
        return refuse(made)
    for warning in made.warnings:
        say(f"warning: {warning}")
    say(f"log: {made.log.text}")
    if target is None:
        out_bytes(made.data)
        return ExitCode.OK
    if as_json:
        out_json(json.dumps(_object(to, target, made), ensure_ascii=False))
    else:
        points = many(made.points, _POINTS.get(to, "point"))
        out(f"wrote `{target}`: {points}, {many(len(made.data), 'byte')}", f"  heights  {made.datum}")
    return ExitCode.OK


def _target(run: Path, to: str, output: Path | None, *, as_json: bool) -> Path | None:
    """Return the file to write; None for standard output."""
    if output is not None:
        return None if str(output) == "-" else output
    return service.name_for(run, to) if as_json or sys.stdout.isatty() else None


def _object(to: str, target: Path, made: ExportedFile) -> dict[str, object]:
    verdict = None if made.log.verdict is None else made.log.verdict.value
    return {
        "format": to,
        "file": str(target),
        "bytes": len(made.data),
        "points": made.points,
        "datum": {"horizontal": "WGS 84", "vertical": made.datum},
        "log": {"verified": made.log.verified, "verdict": verdict, "text": made.log.text},
        "warnings": list(made.warnings),
        "exit_code": 0,
    }
