"""`rtshcua why`: explain one decision."""

import json
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.app import why as service
from rtshcua.app.exit_codes import exit_code
from rtshcua.app.prepared_mission import Subject
from rtshcua.app.why import AssumedCase
from rtshcua.app.wording import moment
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import fail, refuse
from rtshcua.front.cli.render.findings import Findings
from rtshcua.front.cli.render.showing.page import for_terminal
from rtshcua.front.cli.render.showing.why import show_assumed
from rtshcua.front.cli.render.showing.why_log import from_log
from rtshcua.front.cli.stdout import out_json, out_rendered

app = typer.Typer(add_completion=False)


@app.command()
def why(
    path: Annotated[Path, typer.Argument(help="a source with a mission, a bundle, a log, or a run folder")],
    step: Annotated[int | None, typer.Option(help="number of the mission's step, from 1")] = None,
    state: Annotated[
        list[str] | None,
        typer.Option("--state", help="value of a signal: `battery=20 %`, `gps.fix=unknown` (repeatable)"),
    ] = None,
    at: Annotated[str | None, typer.Option(help="time of the decision [default: time of issue, or now]")] = None,
    waited: Annotated[int, typer.Option(min=0, help="time since the release of the step, ms")] = 0,
    record: Annotated[
        int | None, typer.Option(help="number of a record in a log: a decision on a step or fallback, or an effect")
    ] = None,
    approved: Annotated[
        bool, typer.Option("--approved", help="assume all required approvals at the release of the step")
    ] = False,
    mission: Annotated[str | None, typer.Option(help="the mission to use if the source has several")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object on standard output")] = False,
) -> ExitCode:
    """Explain a decision: the inputs of each stage of the check, what decided, and which values would have passed.

    For a source or bundle: the decision on a step in a state that fulfils the step's own conditions, except for --state
    (each signal once; a member listed under `unknown at` is missing, as in a test). --approved grants the approvals
    that `confirm` rules require.

    For a log: the recorded inputs, and how the flight ended. Without --record, the last decision on a step that was not
    `allow`, or else the last one. Nothing is verified; use `rtshcua verify-log` for that.
    """
    page = for_terminal()
    log = service.log_meant(path)
    if log is not None:
        if step is not None or state or at is not None or waited or approved or mission is not None:
            return fail(ExitCode.USAGE, "a log contains its own inputs", "for a log, only `--record` is accepted")
        shown = from_log(page, log, record)
    elif record is not None:
        return fail(ExitCode.USAGE, f"`{path}` is not a log", "`--record` requires a log or a run folder")
    else:
        at_us = None if at is None else moment(at)
        if at is not None and at_us is None:
            return fail(ExitCode.USAGE, f"`{at}` is not a UTC time", "accepted: 2026-01-31T08:00:00Z")
        subject = _subject(path, mission, at_us, as_json)
        if isinstance(subject, ExitCode):
            return subject
        shown = show_assumed(page, subject, AssumedCase(step, state or (), at_us, waited, approved))
    if isinstance(shown, Refusal):
        return refuse(shown)
    if as_json:
        out_json(json.dumps(shown, indent=2, ensure_ascii=False))
    else:
        out_rendered(str(page))
    return ExitCode.OK


def _subject(path: Path, mission: str | None, at_us: int | None, as_json: bool) -> Subject | ExitCode:
    """What is decided on; an exit code where there is nothing, told."""
    found = service.subject_of(path, mission, at_us)
    findings = Findings(json=as_json)
    if findings.report(found.diagnostics, found.sources) or found.subject is None:
        return findings.finish(exit_code(found.diagnostics))
    return refuse(found.subject) if isinstance(found.subject, Refusal) else found.subject
