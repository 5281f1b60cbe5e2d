"""`rtshcua why`: one decision, step by step."""

import json
import time
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.adapters.store.logs import begins_as_log
from rtshcua.adapters.store.reading import read_regular
from rtshcua.adapters.store.runs import LOG
from rtshcua.app.documents import no_bundle
from rtshcua.app.exit_codes import exit_code
from rtshcua.app.programs import compile_sources
from rtshcua.app.wording import moment, utc
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.temporal import lasting
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import fail, refuse
from rtshcua.front.cli.render.findings import Findings
from rtshcua.front.cli.render.showing.page import TextPage, for_terminal
from rtshcua.front.cli.render.showing.why import Case, show_why
from rtshcua.front.cli.stdout import out_json, out_rendered
from rtshcua.front.cli.subject import Subject, prepared, unpacked
from rtshcua.front.cli.why_log import from_log
from rtshcua.ground.why.assumed_state import nominal, overridden, read_overrides
from rtshcua.ground.why.trace import trace
from rtshcua.mavlink import dialect
from rtshcua.model.flat.situation import ConfirmAnswer, Context, Now
from rtshcua.model.step_number import index_of, number_of
from rtshcua.onboard.runtime.dispatcher import CONSERVATIVE_US
from rtshcua.wire.binding import bind
from rtshcua.wire.bundle import MAX_BUNDLE, policy_digest, policy_payload

app = typer.Typer(add_completion=False)

_SOURCES = (".rts", ".json")


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
    mission: Annotated[str | None, typer.Option(help="which mission, where the source has several")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object on the standard output")] = False,
) -> ExitCode:
    """Show a decision step by step: what each step looked at, what decided, and what would have passed.

    By hand: the step of a mission in a state in which its own conditions hold, but for what --state says, each signal
    once; a member under `unknown at` is missing, as in a test. --approved grants what a `confirm` waits for. From a
    log: the inputs that the record holds, and how the flight ended; without --record the last decision on a step that
    was not `allow`, else the last on a step. Nothing is verified; `rtshcua verify-log` does that.
    """
    page = for_terminal()
    file = path / LOG if path.is_dir() else path
    if begins_as_log(file):
        if step is not None or state or at is not None or waited or approved or mission is not None:
            return fail(ExitCode.USAGE, "a log says itself what was decided on", "only --record goes with a log")
        shown = from_log(page, file, record)
    elif record is not None:
        return fail(ExitCode.USAGE, f"`{path}` is no log", "--record goes with a log or a run's folder")
    else:
        utc_us = None if at is None else moment(at)
        if at is not None and utc_us is None:
            return fail(ExitCode.USAGE, f"`{at}` is not a UTC time", "accepted: 2026-01-31T08:00:00Z")
        subject = _subject(file, mission, utc_us, as_json)
        if isinstance(subject, ExitCode):
            return subject
        shown = _by_hand(page, subject, step, state or [], utc_us, waited, approved=approved)
    if isinstance(shown, ExitCode):
        return shown
    if as_json:
        out_json(json.dumps(shown, indent=2, ensure_ascii=False))
    else:
        out_rendered(str(page))
    return ExitCode.OK


def _subject(path: Path, mission: str | None, at_us: int | None, as_json: bool) -> Subject | ExitCode:
    """What is decided on, issued at the time that is asked about, if it was not issued yet; an exit code on refusal."""
    if path.suffix.lower() in _SOURCES:
        issued_at_us = time.time_ns() // 1_000 if at_us is None else at_us
        compiled, sources = compile_sources([path], mission=mission, issued_at_us=issued_at_us)
        findings = Findings(json=as_json)
        if findings.report(compiled.diagnostics, sources) or compiled.policy is None or compiled.mission is None:
            return findings.finish(exit_code(compiled.diagnostics))
        bound = bind(compiled.mission, policy_digest(policy_payload(compiled.policy)))
        return prepared(compiled.policy, bound)
    mistaken = no_bundle(path)
    if mistaken is not None:
        text = f"{str(mistaken).removesuffix(', and no bundle')}, and neither a source, a bundle nor a log"
        return fail(ExitCode.INPUT, text, mistaken.help, slug=mistaken.slug)
    return unpacked(read_regular(path, MAX_BUNDLE), f"`{path}`")


def _by_hand(
    page: TextPage,
    subject: Subject,
    step: int | None,
    texts: list[str],
    at_us: int | None,
    waited_ms: int,
    *,
    approved: bool,
) -> dict[str, object] | ExitCode:
    policy, count = subject.policy, len(subject.invocations)
    if step is None or not 1 <= step <= count:
        what = "say which step" if step is None else f"there is no step {step}"
        steps = "; ".join(
            f"{number_of(each.invocation.step)} {each.invocation.contract.name}" for each in subject.invocations
        )
        return fail(ExitCode.USAGE, what, f"--step takes one of: {steps}")
    index = index_of(step)
    invocation = subject.invocations[index]
    flat = invocation.invocation
    utc_us = flat.issued_at_us if at_us is None else at_us
    now = Now(waited_ms * 1_000, utc_us, 0)
    said, spoken = read_overrides(texts), dialect.load()
    if isinstance(said, Refusal):
        return refuse(said)
    situation = nominal(subject.invocations, index, policy, now)
    for last in (False, True):  # what is set over time outweighs what follows from what is set of signals
        for setting in said:
            changed = overridden(situation, setting, policy.policy, spoken)
            if isinstance(changed, Refusal):
                return refuse(changed)
            situation = changed
        if not last:
            situation = lasting(situation, policy, now)
    vehicle = policy.policy.vehicle.identity
    answers = _approvals(invocation) if approved else ()
    context = Context(flat.binding, vehicle, policy.policy.version, 0, 0, flat.phase, CONSERVATIVE_US, answers)
    case = Case(invocation, situation, context, now, subject.phases)
    shown = show_why(page, trace(invocation, situation, policy, context, now), case)
    page.head("Assumed")
    page.row(
        "state",
        "the contract's conditions hold, for long enough; the vehicle is where the plan has it; --state overrides",
    )
    page.row("time", f"{utc(utc_us)}, {waited_ms} ms after the release")
    if answers:
        roles = dict.fromkeys(policy.policy.roles[each.role] for each in answers)
        page.row("approvals", f"{' and '.join(roles)}, when the step was released")
    return shown


def _approvals(invocation: PreparedInvocation) -> tuple[ConfirmAnswer, ...]:
    """A grant of each role that a `confirm` asks, by as many people."""
    return tuple(
        ConfirmAnswer(confirm.number, role, 1, 0, person)
        for confirm in invocation.candidates.confirms
        for person, role in enumerate((confirm.rule.approver, confirm.rule.second))
        if role != -1
    )
