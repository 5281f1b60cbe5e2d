"""`rtshcua why`: one decision, step by step."""

import json
import time
from base64 import b64decode
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from rtshcua.adapters.files.logs import lines
from rtshcua.adapters.files.runs import LOG
from rtshcua.cli.faults import fail
from rtshcua.cli.findings import Findings, exit_code
from rtshcua.cli.moments import moment
from rtshcua.cli.showing.bundle import claimed, replaced
from rtshcua.cli.showing.page import Page, for_terminal
from rtshcua.cli.showing.why import Case, show_why
from rtshcua.cli.shown import utc
from rtshcua.cli.sources import compile_sources
from rtshcua.decision.prepare import Malformed, prepare, prepare_mission
from rtshcua.decision.prepared import PreparedInvocation, PreparedPolicy
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import Decision, Effect, Genesis
from rtshcua.ground.why.given import Refused, given
from rtshcua.ground.why.nominal import lasting, nominal
from rtshcua.ground.why.recorded import context_of, now_of, state_of
from rtshcua.ground.why.trace import trace
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import Context, Now
from rtshcua.onboard.runtime.remaining import CONSERVATIVE_US
from rtshcua.wire.binding import bind
from rtshcua.wire.bundle import MAX_BUNDLE, policy_digest, policy_payload
from rtshcua.wire.request import STEP
from rtshcua.wire.untrusted import Untrusted

app = typer.Typer(add_completion=False)

_LOG = b'{"_prev":"'
_SOURCES = (".rts", ".json")


class Subject(NamedTuple):
    """A mission under its policy, ready to be decided on."""

    policy: PreparedPolicy
    mission: Mission
    invocations: tuple[PreparedInvocation, ...]

    @property
    def phases(self) -> tuple[str, ...]:
        """The names of the mission's phases."""
        return self.mission.phases


@app.command()
def why(
    path: Annotated[Path, typer.Argument(help="a source with a mission, a bundle, a log, or a run's folder")],
    step: Annotated[int | None, typer.Option(help="the number of the mission's step, from 0")] = None,
    state: Annotated[
        list[str] | None, typer.Option("--state", help="a signal's value: `battery=20 %`, `gps.fix=unknown`")
    ] = None,
    at: Annotated[
        str | None, typer.Option(help="the time of the decision [default: that of the issue, or now]")
    ] = None,
    waited: Annotated[int, typer.Option(min=0, help="ms since the step was released")] = 0,
    record: Annotated[int | None, typer.Option(help="the number of a decision's record in a log")] = None,
    mission: Annotated[str | None, typer.Option(help="which mission, where the source has several")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object on the standard output")] = False,
) -> ExitCode:
    """Show a decision step by step: what each step looked at, what decided, and what would have passed.

    By hand: the step of a mission in a state in which its own conditions hold, but for what --state says. From a log:
    the inputs that the record holds. Nothing is verified; `rtshcua verify-log` does that.
    """
    page = for_terminal()
    file = path / LOG if path.is_dir() else path
    with file.open("rb") as opened:
        logged = opened.read(len(_LOG)) == _LOG
    if logged:
        if step is not None or state or at is not None or waited or mission is not None:
            return fail(ExitCode.USAGE, "a log says itself what was decided on", "only --record goes with a log")
        shown = _from_log(page, file, record)
    elif record is not None:
        return fail(ExitCode.USAGE, f"`{path}` is no log", "--record goes with a log or a run's folder")
    else:
        utc_us = None if at is None else moment(at)
        if at is not None and utc_us is None:
            return fail(ExitCode.USAGE, f"`{at}` is not a UTC time", "accepted: 2026-01-31T08:00:00Z")
        subject = _subject(file, mission, utc_us, as_json)
        if isinstance(subject, ExitCode):
            return subject
        shown = _by_hand(page, subject, step, state or [], utc_us, waited)
    if isinstance(shown, ExitCode):
        return shown
    print(json.dumps(shown, indent=2, ensure_ascii=False) if as_json else page)
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
        return _prepared(compiled.policy, bound)
    with path.open("rb") as opened:
        data = opened.read(MAX_BUNDLE + 1)
    return _unpacked(data, f"`{path}`")


def _unpacked(data: bytes, name: str) -> Subject | ExitCode:
    try:
        bundle = claimed(data)
    except Untrusted as error:
        code = ExitCode.INPUT if error.slug == "malformed" else ExitCode.UNTRUSTED
        return fail(code, f"{name}: {error}", "accepted: a source (.rts, .json), a bundle, a log or a run's folder")
    return _prepared(bundle.policy, bundle.mission)


def _prepared(policy: Policy, mission: Mission) -> Subject | ExitCode:
    ready = prepare(policy)
    invocations = ready if isinstance(ready, Malformed) else prepare_mission(mission, ready)
    if isinstance(ready, Malformed) or isinstance(invocations, Malformed):
        what = ready.what if isinstance(ready, Malformed) else ""
        return fail(ExitCode.INPUT, f"this would be refused on board: {what}")
    return Subject(ready, mission, invocations)


def _replaced(subject: Subject, detail: str) -> Subject | ExitCode:
    """The mission after a recorded replacement; the steps that stay keep their bindings."""
    try:
        mission = replaced(detail, subject.mission)
    except Untrusted as error:
        return fail(ExitCode.INPUT, f"a replacement in the log: {error}")
    return _prepared(subject.policy.policy, mission)


def _by_hand(
    page: Page, subject: Subject, step: int | None, settings: list[str], at_us: int | None, waited_ms: int
) -> dict[str, object] | ExitCode:
    policy, count = subject.policy, len(subject.invocations)
    if step is None or not 0 <= step < count:
        what = "say which step" if step is None else f"there is no step {step}"
        steps = "; ".join(f"{each.invocation.step} {each.invocation.contract.name}" for each in subject.invocations)
        return fail(ExitCode.USAGE, what, f"--step takes one of: {steps}")
    invocation = subject.invocations[step]
    flat = invocation.invocation
    utc_us = flat.issued_at_us if at_us is None else at_us
    now = Now(waited_ms * 1_000, utc_us, 0)
    situation = nominal(subject.invocations, step, policy, now)
    for last in (False, True):  # what is set over time outweighs what follows from what is set of signals
        for setting in settings:
            changed = given(situation, setting, policy.policy)
            if isinstance(changed, Refused):
                return fail(ExitCode.USAGE, changed.what, changed.help)
            situation = changed
        if not last:
            situation = lasting(situation, policy, now)
    vehicle = policy.policy.vehicle.identity
    context = Context(flat.binding, vehicle, policy.policy.version, 0, 0, flat.phase, CONSERVATIVE_US, ())
    case = Case(invocation, situation, context, now, subject.phases)
    shown = show_why(page, trace(invocation, situation, policy, context, now), case)
    page.head("Taken for granted")
    page.row("state", "as the contract wants it, the vehicle where the plan has it, but for --state; and so for long")
    page.row("time", f"{utc(utc_us)}, {waited_ms} ms after the release")
    return shown


def _from_log(page: Page, path: Path, number: int | None) -> dict[str, object] | ExitCode:
    """A step's decision in a log: the one asked for, else the last that was not an `allow`, else the last."""
    subject: Subject | None = None
    chosen: Decision | None = None
    under: Subject | None = None  # the mission in force when it was decided
    with path.open("rb") as opened:
        for line in lines(opened):
            found = read(line)
            if isinstance(found, Flaw):
                break
            if isinstance(found, Genesis):
                unpacked = _unpacked(b64decode(found.bundle), f"the bundle in `{path}`")
                if isinstance(unpacked, ExitCode):
                    return unpacked
                subject = unpacked
            elif isinstance(found, Decision) and found.kind == STEP:
                if number == found.seq:
                    chosen, under = found, subject
                    break
                if number is None and (chosen is None or chosen.outcome == "allow" or found.outcome != "allow"):
                    chosen, under = found, subject
            elif isinstance(found, Effect) and found.event == "replacement" and subject is not None:
                after = _replaced(subject, found.detail)
                if isinstance(after, ExitCode):
                    return after
                subject = after
    subject = under
    if subject is None or chosen is None or not 0 <= chosen.step < len(subject.invocations):
        what = "no decision on a step" if number is None else f"no decision on a step with the number {number}"
        return fail(ExitCode.INPUT, f"`{path}` has {what}", "`rtshcua show` lists the records with their numbers")
    invocation, state = subject.invocations[chosen.step], state_of(chosen)
    if len(state.values) != subject.policy.policy.slots:
        return fail(ExitCode.INPUT, f"record {chosen.seq} has a state of another policy")
    page.text(f"record {chosen.seq} of {path}, {utc(chosen.utc_us)} (not verified)", indent=0)
    case = Case(invocation, state, context_of(chosen), now_of(chosen), subject.phases)
    shown = show_why(page, trace(invocation, state, subject.policy, case.context, case.now), case)
    return shown | {"record": chosen.seq}
