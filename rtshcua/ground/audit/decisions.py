"""Derives each decision again from its recorded inputs, and checks the temporal monitors against earlier records.

A decision record holds the state of one observation and the values of the monitors. The observations between records
are not recorded, so a monitor's value cannot be computed again. But each record gives the truth of the monitor's
condition at that moment, and the monitor must not contradict it: `for the last 3 s` cannot be TRUE if a record of these
3 s has FALSE.
"""

from typing import Final

from msgspec.structs import astuple

from rtshcua.decision.durability import durability_of
from rtshcua.decision.evaluate import NO_PHASE
from rtshcua.decision.prepare import PreparedPolicy
from rtshcua.decision.session import Session
from rtshcua.decision.situation import SINGLE, environment, situation
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN, Truth
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.records import DECIDED, DecisionRecord, in_words
from rtshcua.ground.audit.dispatches import ref_words
from rtshcua.ground.audit.trust import Basis
from rtshcua.model.decision import Decision as Decided
from rtshcua.model.durability import WORDS, WRITTEN
from rtshcua.model.flat.policy import MonitorKind
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.model.outcome import Outcome
from rtshcua.model.step_number import step_words
from rtshcua.wire.request import CONTINGENCY_LINK, STEP, Ref
from rtshcua.wire.response import Status

_WORDS: Final = {TRUE: "true", FALSE: "false", UNKNOWN: "unknown"}
_ALL: Final = TRUE | FALSE | UNKNOWN
_NEVER: Final = -(1 << 62)


class MonitorHistory:
    """The times at which each truth of each monitor's condition was last recorded in one log."""

    def __init__(self, policy: PreparedPolicy) -> None:
        self._policy = policy
        self._last = [{TRUE: _NEVER, FALSE: _NEVER, UNKNOWN: _NEVER} for _ in policy.monitors]

    def check(self, state: State, now: Now) -> Flaw | None:
        """Return a flaw if a monitor contradicts this record or an earlier one, else None."""
        at_us = now.monotonic_us
        at = environment(situation(state, self._policy, now), self._policy, (), NO_PHASE)
        flaw: Flaw | None = None
        for monitor, last, recorded, flat in zip(
            self._policy.monitors, self._last, state.monitors, self._policy.policy.monitors, strict=True
        ):
            found = monitor.condition(at)
            truth = found if found in SINGLE else UNKNOWN  # as in `decision.temporal`
            last[truth] = at_us
            may = _allowed_truths(monitor.kind, truth, {one for one in last if last[one] >= at_us - monitor.window_us})
            if flaw is None and not recorded & may:
                text = f"a monitor of `{flat.when.text}` contradicts its condition in this record or an earlier one"
                expected = " or ".join(word for one, word in _WORDS.items() if one & may)
                flaw = Flaw("decision/monitor", text, _WORDS[recorded], expected)
        return flaw


def _allowed_truths(kind: int, now: Truth, recorded: set[Truth]) -> Truth:
    """The possible values of a monitor, by the truth of its condition now and those recorded in its window."""
    match kind:
        case MonitorKind.FOR_LAST:  # the least of these and the unrecorded truths
            return FALSE if FALSE in recorded else FALSE | UNKNOWN if UNKNOWN in recorded else _ALL
        case MonitorKind.WITHIN_LAST:  # the greatest of these and the unrecorded truths
            return TRUE if TRUE in recorded else TRUE | UNKNOWN if UNKNOWN in recorded else _ALL
        case MonitorKind.RISING:
            return FALSE if now == FALSE else FALSE | UNKNOWN if now == UNKNOWN else _ALL
        case _:
            return FALSE if now == TRUE else FALSE | UNKNOWN if now == UNKNOWN else _ALL


#: the names of the fields `DECIDED` of a record
_WHAT = (
    "outcome",
    "reason",
    "deciding step",
    "deciding clause",
    "place of the deciding clause",
    "fallback target",
    "number of the fallback target",
    "end of validity",
)


class DecisionAudit:
    """Derives the decisions of one log again, in their order, in a session with the recorded monitor values."""

    def __init__(self, basis: Basis, session: Session) -> None:
        self._basis = basis
        self._session = session
        self._observed = MonitorHistory(basis.policy)

    def check(self, record: DecisionRecord) -> Flaw | None:
        """Return a flaw if the derived decision differs from the recorded one, else None."""
        decided = self._derived(record)
        if isinstance(decided, Flaw):
            return decided
        for field, what, expected in zip(DECIDED, _WHAT, in_words(decided), strict=True):
            found = getattr(record, field)
            if found != expected:
                text = f"the decision derived from the recorded inputs has another {what}"
                return Flaw(f"decision/{field.replace('_', '-')}", text, str(found), str(expected))
        return self._durable(record)

    def _durable(self, record: DecisionRecord) -> Flaw | None:
        """Return a flaw if the record's durability is not the required one, else None."""
        if record.kind == STEP:
            contract = self._basis.invocations[record.step].invocation.contract
            approved = any(granted for _, _, granted, _, _ in record.context.approvals)
            required = durability_of(contract, Outcome[record.outcome.upper()], confirmed=approved, kind=STEP)
        else:
            required = WRITTEN
        if record.durability == required:
            return None
        text = "the record has not the durability that the contract and the risk require"
        return Flaw("decision/durability", text, _durability_words(record.durability), _durability_words(required))

    def _derived(self, record: DecisionRecord) -> Decided | Flaw:
        state = State(record.state.values, record.state.ages, record.state.monitors)
        now = Now(record.at_us, record.utc_us, record.utc_error_us)
        ref = record.ref
        flaw = self._inputs(record, state, now) or self._turn(record, ref)
        if flaw is not None:
            return flaw
        if record.kind == STEP:
            return self._step(record, state, now)
        binding = _octets(record.binding) or b""  # a malformed binding never matches
        return self._session.decide_link(ref, binding, state, now)

    def _inputs(self, record: DecisionRecord, state: State, now: Now) -> Flaw | None:
        """Return a flaw in the inputs of a decision, or None."""
        policy = self._basis.policy
        slots, monitors = policy.policy.slots, len(policy.monitors)
        if len(state.values) != slots or len(state.ages) != slots:
            return Flaw("decision/inputs", f"the state does not have the {slots} slots of the policy")
        if len(state.monitors) != monitors or not SINGLE.issuperset(state.monitors):
            return Flaw("decision/inputs", f"the state does not have a truth for each of the {monitors} monitors")
        identity, version, context = policy.policy.vehicle.identity, policy.policy.version, record.context
        if context.vehicle != identity:
            return Flaw("decision/vehicle", "the decision is for another vehicle", context.vehicle, identity)
        if context.policy_version != version:
            text = "the decision is under another version of the policy"
            return Flaw("decision/policy-version", text, str(context.policy_version), str(version))
        flaw = self._observed.check(state, now)
        if flaw is None and record.kind != STEP and context.approvals:
            return Flaw("decision/approvals", "the decision on a link of a chain has approvals")
        return flaw

    def _turn(self, record: DecisionRecord, ref: Ref) -> Flaw | None:
        """Return a flaw if the boundary would not have decided on this step or link then, else None."""
        refused = self._session.refusal(ref)
        if refused is Status.UNKNOWN_STEP:
            text = "the bundle has no such step or link"
            return Flaw("decision/unknown-step", text, ref_words(ref))
        if ref.kind == CONTINGENCY_LINK:
            if not record.invocation:
                return None
            return Flaw("decision/invocation", "a decision on the contingency names a step", record.invocation)
        expected = self._basis.invocations[ref.step].invocation.invocation_id.hex()
        if record.invocation != expected:
            return Flaw("decision/invocation", "the id is not that of the step", record.invocation, expected)
        if ref.kind == STEP:
            recorded, consumed = record.context.consumed, self._session.consumed(ref.step)
            if recorded != consumed:
                text = "`consumed` contradicts earlier records"
                return Flaw("decision/consumed", text, str(recorded), str(consumed))
            if self._basis.in_force.recalled:
                return Flaw("decision/recalled", "a step was decided after the mission was recalled")
            if self._basis.in_force.cancelled:
                return Flaw("decision/cancelled", "a step was decided after the mission was cancelled")
        if refused is None:
            return None
        text = "the step was not the current one: the boundary does not decide such a step"
        current = f"{step_words(self._session.current)} or the next"
        return Flaw("decision/not-current", text, step_words(ref.step), current)

    def _step(self, record: DecisionRecord, state: State, now: Now) -> Decided | Flaw:
        recorded = record.context
        approvals = self._basis.in_force.approvals(self._basis.invocations[record.step].invocation, now)
        if recorded.approvals != tuple(astuple(each) for each in approvals):
            text = "the approvals of the decision are not the verified approvals of the log"
            return Flaw("decision/approvals", text, str(recorded.approvals), str(approvals))
        received_us = self._basis.in_force.received_us(record.step)
        if recorded.released_us < received_us:
            text = "a step was released before it was received on board"
            return Flaw("decision/released", text, f"{recorded.released_us} us", f"{received_us} us or later")
        if recorded.released_us > record.at_us:
            text = "a step was decided before its release: the boundary does not decide such a step"
            return Flaw("decision/released", text, f"{recorded.released_us} us", f"{record.at_us} us or before")
        binding = _octets(record.binding)
        if binding is None:
            return Flaw("decision/inputs", "the binding is not hexadecimal", record.binding)
        context = Context(
            binding,
            recorded.vehicle,
            recorded.policy_version,
            recorded.consumed,
            recorded.released_us,
            recorded.phase,
            recorded.remaining_us,
            approvals,
        )
        return self._session.decide_step(record.step, state, context, now)


def _durability_words(durability: int) -> str:
    return WORDS[durability] if 0 <= durability < len(WORDS) else str(durability)


def _octets(text: str) -> bytes | None:
    try:
        data = bytes.fromhex(text)
    except ValueError:
        return None
    return data if data.hex() == text else None
