"""E0717: whatever a step may be deferred for can come in the time for which it waits.

A deferral for an approval is bounded by the rule's `within` (E0707 asks for it, E0806 that it fits the validity), one
for a phase by the mission itself (E0803). What remains is UNKNOWN: of a signal, which a report resolves, or of a
temporal monitor, which time resolves. Each must be able to before the deadline. A reflex does not wait: what is unknown
to it falls back at once or within its 200 ms, as it should; but no person can approve it in that time, nor anything in
less than `PERSON_US`. A step's own block may make its contract's deadline shorter, so each such step is asked again.
"""

from collections.abc import Iterator, Mapping, Sequence

from rtshcua.decision import tree
from rtshcua.decision.evaluate import Environment, build
from rtshcua.decision.rates import awaited
from rtshcua.decision.values import FALSE, TRUE
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.prove.certain_refusal import refusing_rules
from rtshcua.ground.prove.observability import (
    arrives,
    duration,
    most_frequent,
    report_interval,
    report_intervals,
    signals_read,
)
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.step_times import MissionStep, approval
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Contract, TimingClass
from rtshcua.model.flat.policy import MonitorKind, RuleKind
from rtshcua.model.flat.signal import Signal

#: no person sees what is asked, judges it and answers in less, us
PERSON_US = 2_000_000
#: us, longer than anything lasts
NEVER = 1 << 62


def prove_deferrals(proof: ProofContext) -> None:
    """Report the deferrals of each skill that no report can end, and approvals that come too late by their nature."""
    policy = proof.policy
    often = report_intervals(policy)
    reported: set[str] = set()
    for number, contract in enumerate(policy.contracts):
        if contract.timing_class == TimingClass.REFLEX:
            _report_reflex_approval(proof, number, contract)
            continue
        watched = {signal.name for signal in signals_read(proof, *contract.assume, *contract.maintain)}
        for clause, signal in _awaited(proof, number, contract):
            if not arrives(signal):
                if signal.name not in watched | reported:  # else it is E1201
                    reported.add(signal.name)
                    _report_never(proof, signal, clause)
            elif report_interval(signal, often) > contract.deadline_us and contract.name not in reported:
                reported.add(contract.name)
                _report_late(proof, contract, signal, clause, often)
    _prove_approval_times(proof)


def prove_step_deferral(proof: ProofContext, step: MissionStep) -> None:
    """Report a step whose own deadline or clauses leave its contract no time for a report, as the skill's do not."""
    flat = step.flat
    if step.overrides is None or flat.contract.timing_class == TimingClass.REFLEX:
        return
    policy = proof.policy
    skills, often = policy.contracts[flat.skill], report_intervals(policy, (flat.contract,))
    if any(report_interval(signal, often) > skills.deadline_us for _, signal in _awaited(proof, flat.skill, skills)):
        return  # said of the skill
    for clause, signal in _awaited(proof, flat.skill, flat.contract):
        if arrives(signal) and report_interval(signal, often) > flat.contract.deadline_us:
            own = step.overrides.deadline
            _report_late(proof, flat.contract, signal, clause, often, step.span if own is None else own.span)
            return


def _awaited(proof: ProofContext, number: int, contract: Contract) -> Iterator[tuple[Clause, Signal]]:
    """The signals that a decision on a contract may wait for, and what reads them."""
    for clause in awaited(proof.policy, number, contract):
        for signal in signals_read(proof, clause):
            yield clause, signal


def _prove_approval_times(proof: ProofContext) -> None:
    """Approvals that are awaited for less time than a person takes."""
    for rule in proof.policy.rules:
        if rule.kind == RuleKind.CONFIRM and rule.within_us < PERSON_US:
            written = proof.lowered.written[rule].within
            proof.report.add(
                codes.NO_RESOLVER,
                proof.span(rule) if written is None else written.span,
                f"an approval is awaited for {duration(rule.within_us)}, and a person takes {duration(PERSON_US)} "
                "at least",
                help=f"wait for `{duration(PERSON_US)}` or longer: 30 s leave time to look",
            )


def prove_observation_time(proof: ProofContext, steps: Sequence[MissionStep]) -> None:
    """Report the first step that needs to have observed something for longer than the whole flight up to it.

    Observation begins with the run, with which the first step begins to wait: the time since the issue does not count.
    """
    if not proof.policy.monitors:
        return
    latest = 0
    for step in steps:
        contract = step.contract
        if _unpermitted(proof, step, latest):
            return
        latest += approval(proof, step.prepared) + contract.deadline_us
        for clause in (*contract.require, *contract.assume):
            at = proof.around(step.prepared)
            window = _needed(proof, at, proof.prepared.compiler.node(clause, contract), True)
            if latest < window < NEVER:
                proof.report.add(
                    codes.NO_RESOLVER,
                    step.span,
                    f"`{clause.text}` is unknown until {duration(window)} were observed, and this step waits no longer "
                    f"than {duration(latest)} after the run began, with which observation begins",
                    help="take a shorter window, or ask for it in a later step",
                    labels=[(proof.span(clause), "the contract asks for this")],
                )
                return
        if _forbidden(proof, step, latest):
            return
        latest += contract.duration_us


def _forbidden(proof: ProofContext, step: MissionStep, latest: int) -> bool:
    """Whether a rule that defers while it is unknown must observe longer than the flight up to a step; reports it."""
    at, compiler = proof.around(step.prepared), proof.prepared.compiler
    for rule in refusing_rules(step.prepared):
        node = compiler.when(rule)
        window = 0 if node is None else _needed(proof, at, node, False)
        if latest < window < NEVER:
            proof.report.add(
                codes.NO_RESOLVER,
                step.span,
                f"a rule defers this step until {duration(window)} were observed, and it waits no longer than "
                f"{duration(latest)} after the run began, with which observation begins",
                help="take a shorter window, let the step wait for longer, or ask for it in a later step",
                labels=[(proof.span(rule), "this is unknown until then")],
            )
            return True
    return False


def _unpermitted(proof: ProofContext, step: MissionStep, latest: int) -> bool:
    """Whether each permit that may cover a step must observe for longer than the flight up to its release; reports it.
    A step does not wait for a permit: it is denied.
    """
    at, compiler = proof.around(step.prepared), proof.prepared.compiler
    permits = [permit.rule for permit in step.prepared.candidates.permits if permit.condition(at) & TRUE]
    nodes = [(rule, compiler.when(rule)) for rule in permits]
    needed = [(rule, 0 if node is None else _needed(proof, at, node, True)) for rule, node in nodes]
    least = min((window for _, window in needed), default=0)
    if not latest < least < NEVER:
        return False
    proof.report.add(
        codes.NO_RESOLVER,
        step.span,
        f"nothing permits this step before {duration(least)} were observed, and it is released "
        + (f"no later than {duration(latest)} after the run began" if latest else "when the run begins")
        + ", with which observation begins: it is denied then",
        help="ask for it in a later step, or write a `forbid` of the opposite `within the last`: a step waits for that",
        labels=[(proof.span(rule), f"this permits it after {duration(window)}") for rule, window in needed],
    )
    return True


def _needed(proof: ProofContext, at: Environment, node: tree.Node, wanted: bool) -> int:
    """How long must have been observed at least for a condition to be true (or false, where that is wanted)."""
    match node:
        case tree.Negation(operand):
            return _needed(proof, at, operand, not wanted)
        case tree.Both(left, right) | tree.Either(left, right):
            each = _needed(proof, at, left, wanted), _needed(proof, at, right, wanted)
            return max(each) if isinstance(node, tree.Both) == wanted else min(each)
        case tree.MonitorSays(number):
            monitor = proof.policy.monitors[number]
            kind = MonitorKind.FOR_LAST if wanted else MonitorKind.WITHIN_LAST
            return monitor.window_us if monitor.kind == kind else 0
        case _:
            possible = build(node, proof.prepared.tables)(at) & (TRUE if wanted else FALSE)
            return 0 if possible else NEVER


def _report_never(proof: ProofContext, signal: Signal, clause: Clause) -> None:
    message = proof.context.symbols.signals[signal.name].sources[0].message
    proof.report.add(
        codes.NO_RESOLVER,
        proof.span(clause),
        f"`{signal.name}` stays unknown: `{message.text}` is a message that vehicles are sent and never report",
        help="read the signal from a message that the vehicle reports",
        labels=[(message.span, "read from this message")],
    )


def _report_late(
    proof: ProofContext,
    contract: Contract,
    signal: Signal,
    clause: Clause,
    often: Mapping[str, int],
    span: Span | None = None,
) -> None:
    deadline = proof.skills[contract.name].deadline
    assert deadline is not None
    every = duration(report_interval(signal, often))
    proof.report.add(
        codes.NO_RESOLVER,
        span or deadline.span,
        f"`{contract.name}` waits {duration(contract.deadline_us)} at most, and while `{signal.name}` is unknown its "
        f"next report may take {every}: `{most_frequent(signal, often).message}` comes every {every} at best",
        help=f"let the deadline be {every} or more, or read `{signal.name}` from a message that comes more often",
        labels=[(proof.span(clause), "this waits for it")],
    )


def _report_reflex_approval(proof: ProofContext, number: int, contract: Contract) -> None:
    """A reflex that a person would have to approve."""
    for rule in proof.policy.rules:
        if rule.kind == RuleKind.CONFIRM and number in rule.skills:
            proof.report.add(
                codes.NO_RESOLVER,
                proof.span(rule),
                f"`{contract.name}` is a reflex, and no person approves within its {duration(contract.deadline_us)}",
                help="leave the reflex out of the rule",
                labels=[(_class(proof, contract), "its class")],
            )


def _class(proof: ProofContext, contract: Contract) -> Span:
    written = proof.skills[contract.name].timing_class
    assert written is not None
    return written.span
