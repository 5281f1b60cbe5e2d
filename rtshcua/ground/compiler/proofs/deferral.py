"""E0717: whatever a step may be deferred for can come in the time for which it waits.

A deferral for an approval is bounded by the rule's `within` (E0707 asks for it, E0806 that it fits the validity), one
for a phase by the mission itself (E0803). What remains is UNKNOWN: of a signal, which a report resolves, or of a
temporal monitor, which time resolves. Each must be able to before the deadline. A reflex does not wait: what is unknown
to it falls back at once or within its 200 ms, as it should; but no person can approve it in that time.
"""

from collections.abc import Iterator, Mapping, Sequence

from rtshcua.decision import tree
from rtshcua.decision.prepared import PreparedInvocation
from rtshcua.decision.reads import slots_read
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.compiler.proofs.rates import RATES, arrives, interval, signal_of
from rtshcua.ground.compiler.proofs.situation import Ground
from rtshcua.ground.compiler.proofs.timing import START_WINDOW_US, approval
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Contract, TimingClass
from rtshcua.model.flat.policy import MonitorKind, RuleKind
from rtshcua.model.flat.signal import Signal
from rtshcua.model.ir.missions import Step
from rtshcua.model.quantity import Dimension, display


def prove(ground: Ground) -> None:
    """Report the deferrals of each skill that no report can end, and approvals that come too late by their nature."""
    policy = ground.prepared.policy
    intervals = RATES.intervals(policy)
    reported: set[str] = set()
    for number, contract in enumerate(policy.contracts):
        if contract.timing_class == TimingClass.REFLEX:
            _approved(ground, number, contract)
            continue
        watched = {signal.name for signal in _signals(ground, (*contract.assume, *contract.maintain))}
        forbids = tuple(
            rule.when
            for rule in policy.rules
            if rule.kind == RuleKind.FORBID and rule.when is not None and number in (rule.skills or (number,))
        )
        for clause in (*contract.require, *contract.assume, *contract.maintain, *forbids):
            for signal in _signals(ground, (clause,)):
                if not arrives(signal):
                    if signal.name not in watched | reported:  # else it is E1201
                        reported.add(signal.name)
                        _never(ground, signal, clause)
                elif interval(signal, intervals) > contract.deadline_us and contract.name not in reported:
                    reported.add(contract.name)
                    _late(ground, contract, signal, clause, intervals)


def prove_mission(ground: Ground, steps: Sequence[Step], invocations: Sequence[PreparedInvocation]) -> None:
    """Report the first step that needs to have observed something for longer than the whole flight up to it."""
    if not ground.prepared.policy.monitors:
        return
    latest = START_WINDOW_US
    for step, invocation in zip(steps, invocations, strict=True):
        contract = invocation.invocation.contract
        latest += approval(ground, invocation) + contract.deadline_us
        for clause in (*contract.require, *contract.assume):
            window = max(_needed(ground, ground.prepared.compiler.node(clause, contract)), default=0)
            if window > latest:
                ground.context.report.add(
                    codes.NO_RESOLVER,
                    step.span,
                    f"`{clause.text}` is unknown until {_time(window)} were observed, and this step waits no longer "
                    f"than {_time(latest)} after the mission was issued",
                    help="take a shorter window, or ask for it in a later step",
                    labels=[(ground.span(clause), "the contract asks for this")],
                )
                return
        latest += contract.duration_us


def _needed(ground: Ground, node: tree.Node) -> Iterator[int]:
    """How long must have been observed for a condition to be true, as far as its conjuncts say."""
    if isinstance(node, tree.Both):
        yield from _needed(ground, node.left)
        yield from _needed(ground, node.right)
    elif isinstance(node, tree.Monitored):
        monitor = ground.prepared.policy.monitors[node.monitor]
        if monitor.kind == MonitorKind.FOR_LAST:
            yield monitor.window_us


def _signals(ground: Ground, clauses: Sequence[Clause]) -> Iterator[Signal]:
    policy = ground.prepared.policy
    for slot in slots_read(clauses, policy.vehicle, policy.monitors):
        yield signal_of(policy, slot)


def _never(ground: Ground, signal: Signal, clause: Clause) -> None:
    message = ground.context.symbols.signals[signal.name].sources[0].message
    ground.context.report.add(
        codes.NO_RESOLVER,
        ground.span(clause),
        f"`{signal.name}` stays unknown: `{message.text}` is a message that vehicles are sent and never report",
        help="read the signal from a message that the vehicle reports",
        labels=[(message.span, "read from this message")],
    )


def _late(ground: Ground, contract: Contract, signal: Signal, clause: Clause, intervals: Mapping[str, int]) -> None:
    deadline = ground.context.symbols.skills[contract.name].deadline
    assert deadline is not None
    often = interval(signal, intervals)
    ground.context.report.add(
        codes.NO_RESOLVER,
        deadline.span,
        f"`{contract.name}` waits {_time(contract.deadline_us)} at most, and while `{signal.name}` is unknown its next "
        f"report may take {_time(often)}",
        help=f"let the deadline be {_time(often)} or more, or let `{signal.name}` go stale sooner, so that it is "
        "asked for more often",
        labels=[(ground.span(clause), "this waits for it")],
    )


def _approved(ground: Ground, number: int, contract: Contract) -> None:
    """A reflex that a person would have to approve."""
    for rule in ground.prepared.policy.rules:
        if rule.kind == RuleKind.CONFIRM and number in rule.skills:
            ground.context.report.add(
                codes.NO_RESOLVER,
                ground.span(rule),
                f"`{contract.name}` is a reflex, and no person approves within its {_time(contract.deadline_us)}",
                help="leave the reflex out of the rule",
                labels=[(_class(ground, contract), "its class")],
            )


def _class(ground: Ground, contract: Contract) -> Span:
    written = ground.context.symbols.skills[contract.name].timing_class
    assert written is not None
    return written.span


def _time(us: int) -> str:
    return display(us, Dimension.DURATION)
