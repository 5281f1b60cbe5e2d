"""The service `why`: explain the decision on a step of a mission in an assumed state."""

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from rtshcua.adapters.store.logs import begins_as_log
from rtshcua.adapters.store.reading import read_regular
from rtshcua.adapters.store.runs import LOG
from rtshcua.app.documents import no_bundle
from rtshcua.app.prepared_mission import Subject, prepared, unpacked
from rtshcua.app.programs import compile_sources
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.temporal import lasting
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Source
from rtshcua.ground.why.assumed_state import nominal, overridden, read_overrides
from rtshcua.ground.why.trace import Trace, trace
from rtshcua.mavlink import dialect
from rtshcua.model.flat.situation import ConfirmAnswer, Context, Now, State
from rtshcua.model.step_number import index_of, number_of
from rtshcua.onboard.runtime.dispatcher import CONSERVATIVE_US
from rtshcua.wire.binding import bind
from rtshcua.wire.bundle import MAX_BUNDLE, policy_digest, policy_payload

_SOURCES: Final = (".rts", ".json")


class AssumedCase(NamedTuple):
    """An assumed case: the step, the `signals` as `NAME=VALUE`, the time, the time since the release, and approvals.

    Other signals fulfil the conditions of the step's contract.
    """

    step: int | None
    signals: Sequence[str] = ()
    at_us: int | None = None
    waited_ms: int = 0
    approved: bool = False


class AssumedDecision(NamedTuple):
    """A decision on an assumed state: its inputs, its trace, and the roles that approved."""

    invocation: PreparedInvocation
    state: State
    context: Context
    now: Now
    trace: Trace
    roles: tuple[str, ...]


class CompiledSubject(NamedTuple):
    """The mission of sources, and their diagnostics; no mission if they have errors."""

    subject: Subject | Refusal | None
    diagnostics: tuple[Diagnostic, ...]
    sources: Mapping[str, Source]


def log_meant(path: Path) -> Path | None:
    """Return the log that a file or run folder contains; None if it is something else."""
    file = path / LOG if path.is_dir() else path
    return file if begins_as_log(file) else None


def subject_of(path: Path, mission: str | None, at_us: int | None) -> CompiledSubject:
    """Return the mission of a source, issued at this time or now, or of a bundle. Raises OSError."""
    if path.is_dir():
        path /= LOG
    if path.suffix.lower() in _SOURCES:
        issued_at_us = time.time_ns() // 1_000 if at_us is None else at_us
        compiled, sources = compile_sources([path], mission=mission, issued_at_us=issued_at_us)
        if compiled.policy is None or compiled.mission is None:
            return CompiledSubject(None, compiled.diagnostics, sources)
        bound = bind(compiled.mission, policy_digest(policy_payload(compiled.policy)))
        return CompiledSubject(prepared(compiled.policy, bound), compiled.diagnostics, sources)
    return CompiledSubject(_in_bundle(path), (), {})


def _in_bundle(path: Path) -> Subject | Refusal:
    mistaken = no_bundle(path)
    if mistaken is not None:
        text = f"{str(mistaken).removesuffix(', not a bundle')}, not a source, a bundle or a log"
        return Refusal(mistaken.slug, text, mistaken.help, code=ExitCode.INPUT)
    return unpacked(read_regular(path, MAX_BUNDLE), f"`{path}`")


def decide_assumed(subject: Subject, case: AssumedCase) -> AssumedDecision | Refusal:
    """Return the decision on a step in a state that fulfils its contract, except where the case says otherwise."""
    policy, step = subject.policy, case.step
    if step is None or not 1 <= step <= len(subject.invocations):
        what = "`--step` is missing" if step is None else f"the mission has no step {step}"
        steps = "; ".join(
            f"{number_of(each.invocation.step)} {each.invocation.contract.name}" for each in subject.invocations
        )
        return Refusal("usage", what, f"accepted: {steps}")
    index = index_of(step)
    invocation = subject.invocations[index]
    flat = invocation.invocation
    now = Now(case.waited_ms * 1_000, flat.issued_at_us if case.at_us is None else case.at_us, 0)
    state = _state(subject, index, case.signals, now)
    if isinstance(state, Refusal):
        return state
    answers = _approvals(invocation) if case.approved else ()
    roles = tuple(dict.fromkeys(policy.policy.roles[each.role] for each in answers))
    vehicle, version = policy.policy.vehicle.identity, policy.policy.version
    context = Context(flat.binding, vehicle, version, 0, 0, flat.phase, CONSERVATIVE_US, answers)
    return AssumedDecision(
        invocation, state, context, now, trace(invocation, state, policy, context, now), roles
    )  # fmt: skip


def _state(subject: Subject, index: int, signals: Sequence[str], now: Now) -> State | Refusal:
    """Return a state that fulfils the contract's conditions, except for these signals."""
    policy, settings = subject.policy, read_overrides(signals)
    if isinstance(settings, Refusal):
        return settings
    spoken = dialect.load()
    state = nominal(subject.invocations, index, policy, now)
    for last in (False, True):  # settings of temporal conditions override what follows from the signals
        for setting in settings:
            changed = overridden(state, setting, policy.policy, spoken)
            if isinstance(changed, Refusal):
                return changed
            state = changed
        if not last:
            state = lasting(state, policy, now)
    return state


def _approvals(invocation: PreparedInvocation) -> tuple[ConfirmAnswer, ...]:
    """Return an approval for each role of the step's `confirm` rules, each by a different person."""
    return tuple(
        ConfirmAnswer(confirm.number, role, 1, 0, person)
        for confirm in invocation.candidates.confirms
        for person, role in enumerate((confirm.rule.approver, confirm.rule.second))
        if role != -1
    )
