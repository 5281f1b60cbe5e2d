"""Prove that every deferral of a step can end before its deadline (E0717).

Two kinds of deferral are proved elsewhere: one for an approval is bounded by the rule's `within` (E0707, E0806),
one for
a phase by the mission itself (E0803). The other deferrals are for an UNKNOWN condition. A report resolves an unknown
signal, and time resolves an unknown temporal monitor, and both must be possible before the deadline. A reflex does not
wait: it falls back within its 200 ms. A person cannot approve a reflex in that time, nor any step in less than
`PERSON_US`. A step may shorten the deadline in its own block, so such a step is proved again.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from rtshcua.decision import tree
from rtshcua.decision.evaluate import Environment, build
from rtshcua.decision.rates import MOST_OFTEN, awaited
from rtshcua.decision.tree import where
from rtshcua.decision.values import FALSE, TRUE
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.prove.certain_refusal import refusing_rules
from rtshcua.ground.prove.observability import (
    Intervals,
    arrives,
    duration,
    report_intervals,
    signals_in,
    signals_read,
)
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.step_times import MissionStep, approval
from rtshcua.model.flat.contract import Contract, TimingClass
from rtshcua.model.flat.policy import MonitorKind, RuleKind
from rtshcua.model.flat.signal import Signal

#: least time in us that a person needs to read a request, judge it and answer
PERSON_US = 2_000_000
#: us, longer than any duration
NEVER = 1 << 62


def prove_deferrals(proof: ProofContext) -> None:
    """Report deferrals of skills that no report can end in time, and approvals that no person can give in time."""
    policy = proof.policy
    often = report_intervals(proof)
    reported: set[str] = set()
    for number, contract in enumerate(policy.contracts):
        if contract.timing_class == TimingClass.REFLEX:
            _report_reflex_approval(proof, number, contract)
            continue
        watched = {signal.name for signal in signals_read(proof, *contract.assume, *contract.maintain)}
        for each in _awaited(proof, number, contract):
            signal = each.signal
            if not arrives(signal):
                if signal.name not in watched | reported:  # else it is E1201
                    reported.add(signal.name)
                    _report_never(proof, each)
            elif often[signal.name].us > contract.deadline_us and contract.name not in reported:
                reported.add(contract.name)
                _report_late(proof, contract, each, often)
    _prove_approval_times(proof)


def prove_step_deferral(proof: ProofContext, step: MissionStep) -> None:
    """Report a step whose own deadline or clauses leave no time for a report. The skill's own are reported already."""
    flat = step.flat
    if step.overrides is None or flat.contract.timing_class == TimingClass.REFLEX:
        return
    policy = proof.policy
    skills, often = policy.contracts[flat.skill], report_intervals(proof, (flat.contract,))
    if any(often[each.signal.name].us > skills.deadline_us for each in _awaited(proof, flat.skill, skills)):
        return  # already reported for the skill
    for each in _awaited(proof, flat.skill, flat.contract):
        if arrives(each.signal) and often[each.signal.name].us > flat.contract.deadline_us:
            own = step.overrides.deadline
            _report_late(proof, flat.contract, each, often, step.span if own is None else own.span)
            return


class _Awaited(NamedTuple):
    """A signal for which a decision may wait, where that is written, and how the place is labelled."""

    signal: Signal
    span: Span
    label: str


def _awaited(proof: ProofContext, number: int, contract: Contract) -> Iterator[_Awaited]:
    """Yield the signals for which a decision on a contract may wait: of its clauses, then place and charge."""
    policy, declared = proof.policy, proof.context.symbols.signals
    for clause in awaited(policy, number, contract):
        for signal in signals_read(proof, clause):
            yield _Awaited(signal, proof.span(clause), "this condition waits for the signal")
    for signal in signals_in(policy, (*where(policy.vehicle), policy.vehicle.battery)):
        yield _Awaited(signal, declared[signal.name].name.span, "every step waits for this signal")


def _prove_approval_times(proof: ProofContext) -> None:
    """Report approvals with a shorter timeout than a person needs."""
    for rule in proof.policy.rules:
        if rule.kind == RuleKind.CONFIRM and rule.within_us < PERSON_US:
            written = proof.lowered.written[rule].within
            proof.report.add(
                codes.NO_RESOLVER,
                proof.span(rule) if written is None else written.span,
                f"the time for an approval is {duration(rule.within_us)}, but a person needs at least "
                f"{duration(PERSON_US)}",
                help=f"allow `{duration(PERSON_US)}` or more; 30 s leave time to check the request",
            )


def prove_observation_time(proof: ProofContext, steps: Sequence[MissionStep]) -> None:
    """Report the first step that needs a longer observation than the flight up to it can last.

    Observation begins with the run. The time between the mission's issue and the run does not count.
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
                    f"`{clause.text}` is unknown for the first {duration(window)} of the run, and this step waits at "
                    f"most until {duration(latest)} after the run begins",
                    help="use a shorter window, or move the step to a later position",
                    labels=[(proof.span(clause), "the contract contains this condition")],
                )
                return
        if _forbidden(proof, step, latest):
            return
        latest += contract.duration_us


def _forbidden(proof: ProofContext, step: MissionStep, latest: int) -> bool:
    """Whether a rule must observe longer than the flight up to a step, and defers it until then. Reports the rule."""
    at, compiler = proof.around(step.prepared), proof.prepared.compiler
    for rule in refusing_rules(step.prepared):
        node = compiler.when(rule)
        window = 0 if node is None else _needed(proof, at, node, False)
        if latest < window < NEVER:
            proof.report.add(
                codes.NO_RESOLVER,
                step.span,
                f"a rule defers this step for the first {duration(window)} of the run, and the step waits at most "
                f"until {duration(latest)} after the run begins",
                help="use a shorter window, a longer deadline, or move the step to a later position",
                labels=[(proof.span(rule), "the condition of this rule is unknown until then")],
            )
            return True
    return False


def _unpermitted(proof: ProofContext, step: MissionStep, latest: int) -> bool:
    """Whether each permit for a step must observe longer than the flight up to its release. Reports the step.

    A step does not wait for a permit: without one it is denied.
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
        f"this step is denied: no permit can hold in the first {duration(least)} of the run, and the step is released "
        + (f"at most {duration(latest)} after the run begins" if latest else "when the run begins"),
        help="move the step to a later position, or replace the permit's condition by a `forbid` of the opposite "
        "`within the last`: a step waits for a forbid",
        labels=[(proof.span(rule), f"this permits it after {duration(window)}") for rule, window in needed],
    )
    return True


def _needed(proof: ProofContext, at: Environment, node: tree.Node, wanted: bool) -> int:
    """Return the least observation time, in us, after which a condition can have the `wanted` truth value."""
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


def _report_never(proof: ProofContext, late: _Awaited) -> None:
    signal = late.signal
    message = proof.context.symbols.signals[signal.name].sources[0].message
    proof.report.add(
        codes.NO_RESOLVER,
        late.span,
        f"`{signal.name}` is always unknown: vehicles receive `{message.text}` but never send it",
        help="read the signal from a message that the vehicle reports",
        labels=[(message.span, "read from this message")],
    )


def _report_late(
    proof: ProofContext,
    contract: Contract,
    late: _Awaited,
    often: Intervals,
    span: Span | None = None,
) -> None:
    deadline = proof.skills[contract.name].deadline
    assert deadline is not None
    signal = late.signal
    us, message, assumed = often[signal.name]
    every = duration(us)
    help = f"set the deadline to {every} or more"
    if us <= MOST_OFTEN:
        help += ": no message is requested more often"
    elif assumed:
        help += f", read `{signal.name}` from another message, or write `every` if its sender reports it more often"
    else:
        help += f", or read `{signal.name}` from another message"
    proof.report.add(
        codes.NO_RESOLVER,
        span or deadline.span,
        f"`{contract.name}` waits at most {duration(contract.deadline_us)} for `{signal.name}`, but "
        f"`{message}` is sent only every {every}",
        help=help,
        labels=[(late.span, late.label)],
    )


def _report_reflex_approval(proof: ProofContext, number: int, contract: Contract) -> None:
    """Report a rule that requires a person's approval for a reflex."""
    for rule in proof.policy.rules:
        if rule.kind == RuleKind.CONFIRM and number in rule.skills:
            proof.report.add(
                codes.NO_RESOLVER,
                proof.span(rule),
                f"`{contract.name}` is a reflex, and no person can approve it within {duration(contract.deadline_us)}",
                help="remove the reflex from the rule",
                labels=[(_class(proof, contract), "its class")],
            )


def _class(proof: ProofContext, contract: Contract) -> Span:
    written = proof.skills[contract.name].timing_class
    assert written is not None
    return written.span
