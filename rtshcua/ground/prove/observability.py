"""E1201, E1203, E0808: what a running skill is watched by can be seen, in time for something to come of it.

A signal that `assume`, `maintain`, a `degrade` rule or a temporal monitor reads must be reported by vehicles, at least
as often as it goes stale. A clause of `assume` or `maintain` must read something that can change. How often reports
come is what the adapters ask for (`decision.rates`).

A breach, and the loss of a signal, must be noticed while the skill still runs: from one report to the next (or until
the signal is stale and the grace is over), then the decision, then one round trip of the command that begins the
fallback. A step's own block may shorten the time or add clauses, so each such step is asked again.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from rtshcua.decision import rates
from rtshcua.decision.rates import signal_of
from rtshcua.decision.tree import slots_read
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.step_times import MissionStep
from rtshcua.mavlink.dialect import Dialect
from rtshcua.model.flat.code import Clause, Op
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.policy import MonitorKind, Policy, RuleKind
from rtshcua.model.flat.signal import Signal, SignalSource
from rtshcua.model.quantity import Dimension, display

#: messages that a vehicle is sent and never sends itself as telemetry
COMMAND_MESSAGES = frozenset({
    "COMMAND_INT", "COMMAND_LONG", "FILE_TRANSFER_PROTOCOL", "GPS_INJECT_DATA", "GPS_RTCM_DATA",
    "LOG_ERASE", "LOG_REQUEST_DATA", "LOG_REQUEST_END", "LOG_REQUEST_LIST", "MANUAL_CONTROL", "MANUAL_SETPOINT",
    "MISSION_CLEAR_ALL", "MISSION_REQUEST_LIST", "MISSION_SET_CURRENT", "PARAM_REQUEST_LIST", "PARAM_REQUEST_READ",
    "PARAM_SET", "RC_CHANNELS_OVERRIDE", "REQUEST_DATA_STREAM", "SET_ACTUATOR_CONTROL_TARGET", "SET_ATTITUDE_TARGET",
    "SET_GPS_GLOBAL_ORIGIN", "SET_HOME_POSITION", "SET_MODE", "SET_POSITION_TARGET_GLOBAL_INT",
    "SET_POSITION_TARGET_LOCAL_NED", "SETUP_SIGNING",
})  # fmt: skip


#: what tells when the vehicle measured, among a message's fields
STAMPS = frozenset({"time_boot_ms", "time_usec"})


def report_intervals(policy: Policy, contracts: Sequence[Contract] = ()) -> dict[str, int]:
    """How long it is between two reports of each message that a policy's signals are read from, in us: as asked for,
    where any autopilot reports so often.
    """
    return rates.delivered(rates.rates(policy, contracts))


def older_by(message: str, dialect: Dialect) -> int:
    """How much older than its report what a message carries may be, in us, on a link without delay."""
    if message == "GPS_RAW_INT":
        return rates.FIX
    known = dialect.messages.get(message)
    return rates.UNSTAMPED if known is None or STAMPS.isdisjoint(known.fields) else 0


def arrives(signal: Signal) -> bool:
    """Whether a vehicle ever reports a signal."""
    return any(source.message not in COMMAND_MESSAGES for source in signal.sources)


def most_frequent(signal: Signal, intervals: Mapping[str, int]) -> SignalSource:
    """The source of a signal that reports most often."""
    return min(signal.sources, key=lambda source: intervals[source.message])


def report_interval(signal: Signal, intervals: Mapping[str, int]) -> int:
    """How long it is at most between two reports of a signal, from the most frequent of its messages."""
    return intervals[most_frequent(signal, intervals).message]


#: `L_rem` as it is assumed on board until it was measured (a test compares them), us
DECIDE_US = 20_000
#: one round trip of a command, after which the adapters send it again (a test compares them), us
ACTUATE_US = 1_000_000
#: a lost signal is noticed within this time at least, however long the skill lasts, us
BLIND_US = 30_000_000

_CHANGING = frozenset({
    Op.SIGNAL, Op.SIGNAL_IN, Op.KNOWN, Op.POSITION_IN, Op.POSITION_IN_ARGUMENT, Op.TIME_IN, Op.WEEK_IN, Op.MONITOR,
})  # fmt: skip


class WatchedSignal(NamedTuple):
    """A signal and the first condition that is watched by it in flight."""

    signal: Signal
    span: Span


def prove_observability(proof: ProofContext) -> None:
    """Report every signal, window and clause of a policy that nothing comes of, and contracts that react too late."""
    policy = proof.policy
    intervals = report_intervals(policy)
    found: dict[str, WatchedSignal] = {}
    for clause in _watched(proof):
        for signal in signals_read(proof, clause):
            found.setdefault(signal.name, WatchedSignal(signal, proof.span(clause)))
    for watched in found.values():
        _observable(proof, watched, intervals)
    for clause in _asked(policy):
        for signal in signals_read(proof, clause):
            if signal.name not in found and arrives(signal):
                found[signal.name] = WatchedSignal(signal, proof.span(clause))
                _stays_known(proof, found[signal.name], intervals, "this asks for it")
    _windows(proof, intervals)
    for contract in policy.contracts:
        for clause in (*contract.assume, *contract.maintain):
            if _CHANGING.isdisjoint(clause.code[::3]):
                _unwatched(proof, clause)
        skill = proof.skills[contract.name]
        if skill.duration is not None:
            _reaction(proof, contract, intervals, skill.duration.span)


def prove_step_observability(proof: ProofContext, step: MissionStep) -> None:
    """Report what a step's own block makes of its contract, where the skill's alone was found good."""
    own = step.overrides
    if own is None:
        return
    flat = step.flat
    intervals = report_intervals(proof.policy, (flat.contract,))
    contract, skills = flat.contract, proof.policy.contracts[flat.skill]
    watched = (*contract.assume[len(skills.assume) :], *contract.maintain[len(skills.maintain) :])
    before = {signal.name for clause in _watched(proof) for signal in signals_read(proof, clause)}
    for clause in watched:
        if _CHANGING.isdisjoint(clause.code[::3]):
            _unwatched(proof, clause)
        for signal in signals_read(proof, clause):
            if signal.name not in before:
                before.add(signal.name)
                _observable(proof, WatchedSignal(signal, proof.span(clause)), intervals)
    if _late_reaction(proof, skills, intervals) is None:
        _reaction(proof, contract, intervals, step.span if own.duration is None else own.duration.span)


def _watched(proof: ProofContext) -> Iterator[Clause]:
    """What is evaluated again and again in flight."""
    policy = proof.policy
    for contract in policy.contracts:
        yield from contract.assume
        yield from contract.maintain
    for rule in policy.rules:
        if rule.kind == RuleKind.DEGRADE and rule.when is not None:
            yield rule.when
    for monitor in policy.monitors:
        yield monitor.when


def _asked(policy: Policy) -> Iterator[Clause]:
    """What is evaluated before a step begins, and not again."""
    for contract in policy.contracts:
        yield from contract.require
    for rule in policy.rules:
        if rule.when is not None:
            yield rule.when


def signals_read(proof: ProofContext, *clauses: Clause) -> Iterator[Signal]:
    """The signals that some clauses read, each once."""
    policy = proof.policy
    slots = slots_read(clauses, policy.vehicle, policy.monitors)
    yield from {signal.name: signal for slot in slots for signal in (signal_of(policy, slot),)}.values()


def _observable(proof: ProofContext, watched: WatchedSignal, intervals: Mapping[str, int]) -> None:
    signal, span = watched
    declared = proof.context.symbols.signals[signal.name]
    if not arrives(signal):
        proof.report.add(
            codes.UNOBSERVABLE,
            declared.sources[0].message.span,
            f"`{signal.name}` is read from `{signal.sources[0].message}`, which vehicles are sent and never report",
            help="read it from a message that the vehicle reports",
            labels=[(span, "this watches it in flight")],
        )
        return
    _stays_known(proof, watched, intervals, "this watches it in flight")


def _stays_known(proof: ProofContext, watched: WatchedSignal, intervals: Mapping[str, int], reads: str) -> None:
    """A signal that is stale before its next report can come is unknown again and again, whatever is asked for."""
    signal, span = watched
    often, message = report_interval(signal, intervals), most_frequent(signal, intervals).message
    older = older_by(message, proof.context.dialect)
    if signal.stale_us >= often + older:
        return
    why = f", and what it says may be {duration(older)} old then" if older else ""
    proof.report.add(
        codes.UNOBSERVABLE,
        proof.context.symbols.signals[signal.name].stale_after.span,
        f"`{signal.name}` is stale after {duration(signal.stale_us)}, and `{message}` comes every {duration(often)} at "
        f"best{why}: it is unknown again and again",
        help=f"let it be stale after {duration(2 * often + older)} or more",
        labels=[(span, reads)],
    )


def _windows(proof: ProofContext, intervals: Mapping[str, int]) -> None:
    """A window that no two reports fit into says nothing that the last report does not say."""
    for monitor in proof.policy.monitors:
        signals = [signal for signal in signals_read(proof, monitor.when) if arrives(signal)]
        if monitor.kind not in (MonitorKind.FOR_LAST, MonitorKind.WITHIN_LAST) or not signals:
            continue
        often = min(report_interval(signal, intervals) for signal in signals)
        if monitor.window_us < often:
            names = ", ".join(f"`{signal.name}`" for signal in signals)
            proof.report.add(
                codes.UNOBSERVABLE,
                proof.span(monitor.when),
                f"this is looked at over {duration(monitor.window_us)}, and {names} comes every {duration(often)} "
                "at best",
                help="take a longer window, or ask for the present value alone",
            )


def _unwatched(proof: ProofContext, clause: Clause) -> None:
    proof.report.add(
        codes.UNWATCHED,
        proof.span(clause),
        f"`{clause.text}` reads nothing that can change while the skill runs",
        help="write it under `require`, or compare a signal, as in `maintain height <= altitude + 5 m`",
    )


class _LateReaction(NamedTuple):
    """The signal that tells of a cause too late, how long it all takes in us, and what that is made of."""

    signal: Signal
    takes: int
    what: str


def _late_reaction(proof: ProofContext, contract: Contract, intervals: Mapping[str, int]) -> _LateReaction | None:
    """What cannot be answered while a skill runs: a breach, or the loss of a signal."""
    signals = [signal for signal in signals_read(proof, *contract.assume, *contract.maintain) if arrives(signal)]
    lasts = contract.duration_us
    if not signals or not lasts:
        return None
    seldom = max(signals, key=lambda signal: report_interval(signal, intervals))
    late = max(signals, key=lambda signal: signal.stale_us)
    breach = report_interval(seldom, intervals) + DECIDE_US + ACTUATE_US
    lost = late.stale_us + contract.grace_us + DECIDE_US + ACTUATE_US
    if breach > lasts:
        return _LateReaction(
            seldom, breach, f"{duration(report_interval(seldom, intervals))} until `{seldom.name}` tells"
        )
    if lost > max(lasts, BLIND_US):
        what = f"{duration(late.stale_us)} until `{late.name}` is stale, {duration(contract.grace_us)} of grace"
        return _LateReaction(late, lost, what)
    return None


def _reaction(proof: ProofContext, contract: Contract, intervals: Mapping[str, int], span: Span) -> None:
    """Whether a breach and the loss of a signal can both be answered while the skill runs."""
    late = _late_reaction(proof, contract, intervals)
    if late is None:
        return
    vehicle = proof.policy.vehicle
    metres = display(late.takes * vehicle.speed // 1_000_000 // 1_000 * 1_000, Dimension.LENGTH)
    stale = proof.context.symbols.signals[late.signal.name].stale_after.span
    proof.report.add(
        codes.SLOW_REACTION,
        span,
        f"`{contract.name}` lasts at most {duration(contract.duration_us)}, and a fallback may begin only "
        f"{duration(late.takes)} after its cause",
        help=f"that is {late.what}, {duration(DECIDE_US)} to decide and {duration(ACTUATE_US)} for the command; at top "
        f"speed `{vehicle.name}` flies {metres} meanwhile",
        labels=[(stale, "this signal is the last to tell")],
    )


def duration(us: int) -> str:
    """A duration as sources write it."""
    return display(us, Dimension.DURATION)
