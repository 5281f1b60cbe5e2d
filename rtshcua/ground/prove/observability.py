"""Prove that the conditions monitored in flight are observable (E1201, E1203), and in time for a reaction (E0808).

Vehicles must report each signal that `assume`, `maintain`, a `degrade` rule or a temporal monitor reads, at least as
often as it goes stale, and so must they report place and charge, and the velocity where the vehicle declares `brakes`.
A clause of `assume` or `maintain` must read a value that can change. The report rates are those that the adapters
request (`decision.rates`).

A violated condition and a lost signal must both be noticed while the skill still runs. The reaction time is the time to
the next report (or until the signal is stale and the grace is over), plus the decision, plus one round trip of the
command that begins the fallback. A step's own block may shorten the duration or add clauses, so such a step is proved
again.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from operator import attrgetter
from typing import NamedTuple, TypeAlias

from rtshcua.decision import rates
from rtshcua.decision.rates import signal_of
from rtshcua.decision.tree import slots_read, where
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.step_times import MissionStep
from rtshcua.mavlink.dialect import Dialect
from rtshcua.model.flat.code import Clause, Op
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.policy import MonitorKind, Policy, RuleKind
from rtshcua.model.flat.signal import Signal
from rtshcua.model.quantity import Dimension, display

#: messages that a vehicle receives, and never sends as telemetry
COMMAND_MESSAGES = frozenset({
    "COMMAND_INT", "COMMAND_LONG", "FILE_TRANSFER_PROTOCOL", "GPS_INJECT_DATA", "GPS_RTCM_DATA",
    "LOG_ERASE", "LOG_REQUEST_DATA", "LOG_REQUEST_END", "LOG_REQUEST_LIST", "MANUAL_CONTROL", "MANUAL_SETPOINT",
    "MISSION_CLEAR_ALL", "MISSION_REQUEST_LIST", "MISSION_SET_CURRENT", "PARAM_REQUEST_LIST", "PARAM_REQUEST_READ",
    "PARAM_SET", "RC_CHANNELS_OVERRIDE", "REQUEST_DATA_STREAM", "SET_ACTUATOR_CONTROL_TARGET", "SET_ATTITUDE_TARGET",
    "SET_GPS_GLOBAL_ORIGIN", "SET_HOME_POSITION", "SET_MODE", "SET_POSITION_TARGET_GLOBAL_INT",
    "SET_POSITION_TARGET_LOCAL_NED", "SETUP_SIGNING",
})  # fmt: skip


#: message fields that carry the time of the measurement
STAMPS = frozenset({"time_boot_ms", "time_usec"})


class SignalInterval(NamedTuple):
    """The interval in us between two reports of a signal, and the message that is reported most often. `assumed`: it is
    not the requested interval, but what is known of the senders of that message.
    """

    us: int
    message: str
    assumed: bool


Intervals: TypeAlias = Mapping[str, SignalInterval]


def report_intervals(proof: ProofContext, contracts: Sequence[Contract] = ()) -> Intervals:
    """Return the interval between two reports of each signal.

    It is the requested interval, or a longer one if autopilots do not report so often, or the signal declares that its
    sender does not (`every`).
    """
    asked, declared = rates.rates(proof.policy, contracts), proof.context.symbols.signals
    found: dict[str, SignalInterval] = {}
    for signal in proof.policy.signals:
        every = declared[signal.name].every
        each = [
            SignalInterval(
                rates.delivered(asked, message, None if every is None else every.value),
                message,
                every is None and rates.AT_BEST.get(message, 0) > asked[message].asked,
            )
            for message in (source.message for source in signal.sources)
        ]
        found[signal.name] = min(each, key=attrgetter("us"))
    return found


def older_by(message: str, dialect: Dialect) -> int:
    """Return by how many us a measurement may be older than the message that carries it, on a link without delay."""
    if message == "GPS_RAW_INT":
        return rates.FIX
    known = dialect.messages.get(message)
    return rates.UNSTAMPED if known is None or STAMPS.isdisjoint(known.fields) else 0


def arrives(signal: Signal) -> bool:
    """Whether a vehicle ever reports a signal."""
    return any(source.message not in COMMAND_MESSAGES for source in signal.sources)


#: `L_rem`, as assumed on board until it is measured, us; a test compares the two constants
DECIDE_US = 20_000
#: round trip of a command, after which the adapters send it again, us; a test compares the two constants
ACTUATE_US = 1_000_000
#: a loss of signal may always take this long to be noticed, us, even if the skill is shorter
BLIND_US = 30_000_000

_CHANGING = frozenset({
    Op.SIGNAL, Op.SIGNAL_IN, Op.KNOWN, Op.POSITION_IN, Op.POSITION_IN_ARGUMENT, Op.TIME_IN, Op.WEEK_IN, Op.MONITOR,
})  # fmt: skip


class WatchedSignal(NamedTuple):
    """A signal, and the first monitored condition that reads it."""

    signal: Signal
    span: Span


def prove_observability(proof: ProofContext) -> None:
    """Report signals and windows that cannot be observed, clauses that cannot change, and late reactions."""
    policy = proof.policy
    intervals = report_intervals(proof)
    found: dict[str, WatchedSignal] = {}
    for clause in _watched(proof):
        for signal in signals_read(proof, clause):
            found.setdefault(signal.name, WatchedSignal(signal, proof.span(clause)))
    for watched in found.values():
        _observable(proof, watched, intervals)
    for clause in _checked_once(policy):
        for signal in signals_read(proof, clause):
            if signal.name not in found and arrives(signal):
                found[signal.name] = WatchedSignal(signal, proof.span(clause))
                _stays_known(proof, found[signal.name], intervals, "this reads it")
    vehicle = policy.vehicle
    for signal in signals_in(policy, (*where(vehicle), vehicle.battery, vehicle.north, vehicle.east, vehicle.down)):
        if signal.name not in found and arrives(signal):
            name = proof.context.symbols.signals[signal.name].name
            _stays_known(proof, WatchedSignal(signal, name.span), intervals, "it is read in every flight")
    _windows(proof, intervals)
    for contract in policy.contracts:
        for clause in (*contract.assume, *contract.maintain):
            if _CHANGING.isdisjoint(clause.code[::3]):
                _unwatched(proof, clause)
        skill = proof.skills[contract.name]
        if skill.duration is not None:
            _reaction(proof, contract, intervals, skill.duration.span)


def prove_step_observability(proof: ProofContext, step: MissionStep) -> None:
    """Report faults that a step's own block adds to the contract of its skill."""
    own = step.overrides
    if own is None:
        return
    flat = step.flat
    intervals = report_intervals(proof, (flat.contract,))
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
    """Yield the conditions that are monitored in flight."""
    policy = proof.policy
    for contract in policy.contracts:
        yield from contract.assume
        yield from contract.maintain
    for rule in policy.rules:
        if rule.kind == RuleKind.DEGRADE and rule.when is not None:
            yield rule.when
    for monitor in policy.monitors:
        yield monitor.when


def _checked_once(policy: Policy) -> Iterator[Clause]:
    """Yield the conditions that are evaluated before a step begins."""
    for contract in policy.contracts:
        yield from contract.require
    for rule in policy.rules:
        if rule.when is not None:
            yield rule.when


def signals_read(proof: ProofContext, *clauses: Clause) -> Iterator[Signal]:
    """Yield the signals that clauses read, each once."""
    policy = proof.policy
    slots = slots_read(clauses, policy.vehicle, policy.monitors)
    yield from {signal.name: signal for slot in slots for signal in (signal_of(policy, slot),)}.values()


def signals_in(policy: Policy, slots: Collection[int]) -> Iterator[Signal]:
    """Yield the signals that have one of these slots."""
    for signal in policy.signals:
        if not set(slots).isdisjoint(signal.slots):
            yield signal


def _observable(proof: ProofContext, watched: WatchedSignal, intervals: Intervals) -> None:
    signal, span = watched
    declared = proof.context.symbols.signals[signal.name]
    if not arrives(signal):
        proof.report.add(
            codes.UNOBSERVABLE,
            declared.sources[0].message.span,
            f"`{signal.name}` is read from `{signal.sources[0].message}`, which vehicles receive but never send",
            help="read it from a message that the vehicle reports",
            labels=[(span, "this monitors it in flight")],
        )
        return
    _stays_known(proof, watched, intervals, "this monitors it in flight")


def _stays_known(proof: ProofContext, watched: WatchedSignal, intervals: Intervals, reads: str) -> None:
    """Report a signal that goes stale before its next report can arrive."""
    signal, span = watched
    often, message, _ = intervals[signal.name]
    older = older_by(message, proof.context.dialect)
    if signal.stale_us >= often + older:
        return
    aged = f", with measurements up to {duration(older)} old" if older else ""
    proof.report.add(
        codes.UNOBSERVABLE,
        proof.context.symbols.signals[signal.name].stale_after.span,
        f"`{signal.name}` is unknown between reports: it is stale after {duration(signal.stale_us)}, but `{message}` "
        f"is sent only every {duration(often)}{aged}",
        help=f"set `stale after` to {duration(2 * often + older)} or more",
        labels=[(span, reads)],
    )


def _windows(proof: ProofContext, intervals: Intervals) -> None:
    """Report windows shorter than the time between two reports: they add nothing to the last report."""
    for monitor in proof.policy.monitors:
        signals = [signal for signal in signals_read(proof, monitor.when) if arrives(signal)]
        if monitor.kind not in (MonitorKind.FOR_LAST, MonitorKind.WITHIN_LAST) or not signals:
            continue
        often = min(intervals[signal.name].us for signal in signals)
        if monitor.window_us < often:
            names = ", ".join(f"`{signal.name}`" for signal in signals)
            proof.report.add(
                codes.UNOBSERVABLE,
                proof.span(monitor.when),
                f"the window is {duration(monitor.window_us)}, but {names} is reported only every {duration(often)}",
                help="use a longer window, or only the present value",
            )


def _unwatched(proof: ProofContext, clause: Clause) -> None:
    proof.report.add(
        codes.UNWATCHED,
        proof.span(clause),
        f"`{clause.text}` reads nothing that can change while the skill runs",
        help="move it to `require`, or compare a signal, as in `maintain height <= altitude + 5 m`",
    )


class _LateReaction(NamedTuple):
    """A signal that is too slow, the reaction time in us, and a description of the time until the cause is noticed."""

    signal: Signal
    takes: int
    delay: str


def _late_reaction(proof: ProofContext, contract: Contract, intervals: Intervals) -> _LateReaction | None:
    """Return a reaction, to a violated condition or a lost signal, that takes longer than the skill runs; else None."""
    signals = [signal for signal in signals_read(proof, *contract.assume, *contract.maintain) if arrives(signal)]
    lasts = contract.duration_us
    if not signals or not lasts:
        return None
    seldom = max(signals, key=lambda signal: intervals[signal.name].us)
    late = max(signals, key=lambda signal: signal.stale_us)
    breach = intervals[seldom.name].us + DECIDE_US + ACTUATE_US
    lost = late.stale_us + contract.grace_us + DECIDE_US + ACTUATE_US
    if breach > lasts:
        delay = f"{duration(intervals[seldom.name].us)} until `{seldom.name}` is reported"
        return _LateReaction(seldom, breach, delay)
    if lost > max(lasts, BLIND_US):
        delay = f"{duration(late.stale_us)} until `{late.name}` is stale, {duration(contract.grace_us)} of grace"
        return _LateReaction(late, lost, delay)
    return None


def _reaction(proof: ProofContext, contract: Contract, intervals: Intervals, span: Span) -> None:
    """Report a contract whose fallback may begin only after the skill has ended."""
    late = _late_reaction(proof, contract, intervals)
    if late is None:
        return
    vehicle = proof.policy.vehicle
    metres = display(late.takes * vehicle.speed // 1_000_000 // 1_000 * 1_000, Dimension.LENGTH)
    stale = proof.context.symbols.signals[late.signal.name].stale_after.span
    proof.report.add(
        codes.SLOW_REACTION,
        span,
        f"`{contract.name}` lasts at most {duration(contract.duration_us)}, but its fallback may begin as late as "
        f"{duration(late.takes)} after the cause",
        help=f"the delay is {late.delay}, {duration(DECIDE_US)} to decide and {duration(ACTUATE_US)} for the command; "
        f"`{vehicle.name}` flies up to {metres} in that time",
        labels=[(stale, "this signal is the slowest")],
    )


def duration(us: int) -> str:
    """Format a duration in us as in sources."""
    return display(us, Dimension.DURATION)
