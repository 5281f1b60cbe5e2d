"""`rtshcua why`: one decision, step by step."""

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
    path: Annotated[Path, typer.Argument(help="a source with a mission, a bundle, a log, or a run's folder")],
    step: Annotated[int | None, typer.Option(help="the number of the mission's step, from 1")] = None,
    state: Annotated[
        list[str] | None, typer.Option("--state", help="a signal's value: `battery=20 %`, `gps.fix=unknown`")
    ] = None,
    at: Annotated[
        str | None, typer.Option(help="the time of the decision [default: that of the issue, or now]")
    ] = None,
    waited: Annotated[int, typer.Option(min=0, help="ms since the step was released")] = 0,
    record: Annotated[
        int | None, typer.Option(help="the number of a record in a log: a decision on a step or link, or an effect")
    ] = None,
    approved: Annotated[
        bool, typer.Option("--approved", help="whoever a `confirm` asks approved, when the step was released")
    ] = False,
    mission: Annotated[str | None, typer.Option(help="the mission to use if the source has several")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object on standard output")] = False,
) -> ExitCode:
    """Show a decision step by step: what each step looked at, what decided, and what would have passed.

    By hand: the step of a mission in a state in which its own conditions hold, but for what --state says, each signal
    once; a member under `unknown at` is missing, as in a test. --approved grants what a `confirm` waits for. From a
    log: the inputs that the record holds, and how the flight ended; without --record the last decision on a step that
    was not `allow`, else the last on a step. Nothing is verified; `rtshcua verify-log` does that.
    """
    page = for_terminal()
    log = service.log_meant(path)
    if log is not None:
        if step is not None or state or at is not None or waited or approved or mission is not None:
            return fail(ExitCode.USAGE, "a log says itself what was decided on", "only --record goes with a log")
        shown = from_log(page, log, record)
    elif record is not None:
        return fail(ExitCode.USAGE, f"`{path}` is no log", "--record goes with a log or a run's folder")
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
