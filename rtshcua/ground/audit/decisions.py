"""Each decision once more: from the inputs that its record holds, by the same rules that decided on board; and what the
temporal monitors said, against what the log knows of their past.

Each decision record holds the state of one observation, and what the monitors said there. The observations in between
are not recorded, so nobody can work out again what a monitor said; but each record tells the truth of its condition at
that moment, and a monitor must not say what these truths rule out: not TRUE `for the last 3 s` with a FALSE in them.
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
    """Follows the decisions of one log; what it keeps is bounded by the policy: when each truth was last recorded."""

    def __init__(self, policy: PreparedPolicy) -> None:
        self._policy = policy
        self._last = [{TRUE: _NEVER, FALSE: _NEVER, UNKNOWN: _NEVER} for _ in policy.monitors]

    def check(self, state: State, now: Now) -> Flaw | None:
        """What is wrong with what the monitors said at a recorded moment, given those before, or None."""
        at_us = now.monotonic_us
        at = environment(situation(state, self._policy, now), self._policy, (), NO_PHASE)
        flaw: Flaw | None = None
        for monitor, last, said, flat in zip(
            self._policy.monitors, self._last, state.monitors, self._policy.policy.monitors, strict=True
        ):
            found = monitor.condition(at)
            truth = found if found in SINGLE else UNKNOWN  # as `decision.temporal` has it
            last[truth] = at_us
            may = _allowed_truths(monitor.kind, truth, {one for one in last if last[one] >= at_us - monitor.window_us})
            if flaw is None and not said & may:
                text = (
                    f"a monitor of `{flat.when.text}` said what its condition rules out, in this record or one before"
                )
                expected = " or ".join(word for one, word in _WORDS.items() if one & may)
                flaw = Flaw("decision/monitor", text, _WORDS[said], expected)
        return flaw


def _allowed_truths(kind: int, now: Truth, recorded: set[Truth]) -> Truth:
    """What a monitor may say, by the truth of its condition now, and those that were recorded in its window."""
    match kind:
        case MonitorKind.FOR_LAST:  # the least of more truths than these
            return FALSE if FALSE in recorded else FALSE | UNKNOWN if UNKNOWN in recorded else _ALL
        case MonitorKind.WITHIN_LAST:  # the greatest of more truths than these
            return TRUE if TRUE in recorded else TRUE | UNKNOWN if UNKNOWN in recorded else _ALL
        case MonitorKind.RISING:
            return FALSE if now == FALSE else FALSE | UNKNOWN if now == UNKNOWN else _ALL
        case _:
            return FALSE if now == TRUE else FALSE | UNKNOWN if now == UNKNOWN else _ALL


#: what the fields `DECIDED` of a record are called
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
    """Derives the decisions of one log in their order, in the session that it was, with what the monitors said."""

    def __init__(self, basis: Basis, session: Session) -> None:
        self._basis = basis
        self._session = session
        self._observed = MonitorHistory(basis.policy)

    def check(self, record: DecisionRecord) -> Flaw | None:
        """What is wrong with a decision, or None when it derives again."""
        decided = self._derived(record)
        if isinstance(decided, Flaw):
            return decided
        for field, what, expected in zip(DECIDED, _WHAT, in_words(decided), strict=True):
            found = getattr(record, field)
            if found != expected:
                text = f"derived again from the inputs that it records, this decision has another {what}"
                return Flaw(f"decision/{field.replace('_', '-')}", text, str(found), str(expected))
        return self._durable(record)

    def _durable(self, record: DecisionRecord) -> Flaw | None:
        """What is wrong with how durable a record that derived again says it was."""
        if record.kind == STEP:
            contract = self._basis.invocations[record.step].invocation.contract
            approved = any(granted for _, _, granted, _, _ in record.context.approvals)
            asked = durability_of(contract, Outcome[record.outcome.upper()], confirmed=approved, kind=STEP)
        else:
            asked = WRITTEN
        if record.durability == asked:
            return None
        text = "its record was not as durable as the contract and the risk ask, or more"
        return Flaw("decision/durability", text, _durability_words(record.durability), _durability_words(asked))

    def _derived(self, record: DecisionRecord) -> Decided | Flaw:
        state = State(record.state.values, record.state.ages, record.state.monitors)
        now = Now(record.at_us, record.utc_us, record.utc_error_us)
        ref = record.ref
        flaw = self._inputs(record, state, now) or self._turn(record, ref)
        if flaw is not None:
            return flaw
        if record.kind == STEP:
            return self._step(record, state, now)
        binding = _octets(record.binding) or b""  # what is no binding at all is not the right one
        return self._session.decide_link(ref, binding, state, now)

    def _inputs(self, record: DecisionRecord, state: State, now: Now) -> Flaw | None:
        """What is wrong with the situation that a decision was made in."""
        policy = self._basis.policy
        slots, monitors = policy.policy.slots, len(policy.monitors)
        if len(state.values) != slots or len(state.ages) != slots:
            return Flaw("decision/inputs", f"the state has not the {slots} slots of the policy")
        if len(state.monitors) != monitors or not SINGLE.issuperset(state.monitors):
            return Flaw("decision/inputs", f"the state has not a truth for each of the policy's {monitors} monitors")
        identity, version, given = policy.policy.vehicle.identity, policy.policy.version, record.context
        if given.vehicle != identity:
            return Flaw("decision/vehicle", "it was made for another vehicle than the log's", given.vehicle, identity)
        if given.policy_version != version:
            text = "it was made under another version of the policy than the log's"
            return Flaw("decision/policy-version", text, str(given.policy_version), str(version))
        flaw = self._observed.check(state, now)
        if flaw is None and record.kind != STEP and record.context.approvals:
            return Flaw("decision/approvals", "a link of a chain is decided without approvals")
        return flaw

    def _turn(self, record: DecisionRecord, ref: Ref) -> Flaw | None:
        """Why the boundary would not have decided on this then."""
        refused = self._session.refusal(ref)
        if refused is Status.UNKNOWN_STEP:
            text = "the bundle has no such step or link"
            return Flaw("decision/unknown-step", text, ref_words(ref))
        if ref.kind == CONTINGENCY_LINK:
            if not record.invocation:
                return None
            return Flaw("decision/invocation", "a link of the contingency belongs to no step", record.invocation)
        expected = self._basis.invocations[ref.step].invocation.invocation_id.hex()
        if record.invocation != expected:
            return Flaw("decision/invocation", "the id is not that of its step", record.invocation, expected)
        if ref.kind == STEP:
            given, consumed = record.context.consumed, self._session.consumed(ref.step)
            if given != consumed:
                text = "whether the step's id was used before is not what the records before say"
                return Flaw("decision/consumed", text, str(given), str(consumed))
            if self._basis.in_force.recalled:
                return Flaw("decision/recalled", "a step is decided after the mission was recalled")
            if self._basis.in_force.cancelled:
                return Flaw("decision/cancelled", "a step is decided after the mission was cancelled")
        if refused is None:
            return None
        text = "a step is decided whose turn had not come, or was over: the boundary decides no such step"
        current = f"{step_words(self._session.current)} or the next"
        return Flaw("decision/not-current", text, step_words(ref.step), current)

    def _step(self, record: DecisionRecord, state: State, now: Now) -> Decided | Flaw:
        given = record.context
        approvals = self._basis.in_force.approvals(self._basis.invocations[record.step].invocation, now)
        if given.approvals != tuple(astuple(each) for each in approvals):
            text = "the approvals that it read are not those that the log holds and that are verified"
            return Flaw("decision/approvals", text, str(given.approvals), str(approvals))
        received_us = self._basis.in_force.received_us(record.step)
        if given.released_us < received_us:
            text = "a step was released before it was received on board"
            return Flaw("decision/released", text, f"{given.released_us} us", f"{received_us} us or later")
        if given.released_us > record.at_us:
            text = "a step is decided before it is released: the boundary decides no such step"
            return Flaw("decision/released", text, f"{given.released_us} us", f"{record.at_us} us or before")
        binding = _octets(record.binding)
        if binding is None:
            return Flaw("decision/inputs", "the binding is not written in hexadecimal", record.binding)
        context = Context(
            binding,
            given.vehicle,
            given.policy_version,
            given.consumed,
            given.released_us,
            given.phase,
            given.remaining_us,
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
