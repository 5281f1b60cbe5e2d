"""Each decision once more: from the inputs that its record holds, by the same function that decided on board."""

from typing import NamedTuple

from rtshcua.decision.case import SINGLE
from rtshcua.decision.decide import decide
from rtshcua.decision.durability import durability_of
from rtshcua.decision.links import DEGRADE, choose_fallback, link_admissible
from rtshcua.decision.prepared import PreparedInvocation
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.records import Decision
from rtshcua.ground.auditor.observed import Observed
from rtshcua.ground.auditor.trust import Basis
from rtshcua.model.durability import WORDS, WRITTEN
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.mission import OnInadmissible
from rtshcua.model.flat.policy import Airspace, Rule
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.wire.permit import LINK_VALID_US
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP

UNENFORCED = "none"

_AUTHORITY = 3  # steps up to this one leave an id unused (design 4.4)
_STATE, _PASSED = 6, 8


class Answer(NamedTuple):
    """What a decision record answers, field by field as it is written there."""

    outcome: str
    reason: str
    rule_step: int
    clause: str | None
    clause_at: tuple[int, int, int] | None
    target: str | None
    target_link: int
    valid_until_us: int


_WHAT = {
    "outcome": "outcome",
    "reason": "reason",
    "rule_step": "deciding step",
    "clause": "deciding clause",
    "clause_at": "place of the deciding clause",
    "target": "fallback target",
    "target_link": "number of the fallback target",
    "valid_until_us": "end of validity",
}


class Deriver:
    """Derives the decisions of one log in their order; remembers which ids were used up, and what `Observed` does."""

    def __init__(self, basis: Basis) -> None:
        self._basis = basis
        self._consumed: set[int] = set()
        self._latest = -1  # the last step that was decided on and not denied
        self._observed = Observed(basis.policy)

    @property
    def decided(self) -> int:
        """How many steps, from the first on, are decided for good."""
        return max(self._latest + int(self._latest in self._consumed), 0)

    @property
    def released(self) -> int:
        """How many steps were released, as far as the decisions tell."""
        return self._latest + 1

    def replaced(self, first: int) -> None:
        """The steps from `first` on are others now."""
        self._consumed = {step for step in self._consumed if step < first}

    def check(self, record: Decision) -> Flaw | None:
        """What is wrong with a decision, or None when it derives again."""
        answer = self._derived(record)
        if isinstance(answer, Flaw):
            return answer
        for field, expected in zip(Answer._fields, answer, strict=True):
            found = getattr(record, field)
            if found != expected:
                text = f"derived again from the inputs that it records, this decision has another {_WHAT[field]}"
                return Flaw(f"decision/{field.replace('_', '-')}", text, str(found), str(expected))
        return self._durable(record)

    def _durable(self, record: Decision) -> Flaw | None:
        """What is wrong with how durable a record that derived again says it was."""
        if record.kind == STEP:
            contract = self._basis.invocations[record.step].invocation.contract
            approved = any(granted for _, _, granted, _ in record.context.approvals)
            asked = durability_of(contract, Outcome[record.outcome.upper()], confirmed=approved, kind=STEP)
        else:
            asked = WRITTEN
        if record.durability == asked:
            return None
        text = "its record was not as durable as the contract and the risk ask, or more"
        return Flaw("decision/durability", text, _class(record.durability), _class(asked))

    def _derived(self, record: Decision) -> Answer | Flaw:
        basis = self._basis
        state = State(record.state.values, record.state.ages, record.state.monitors)
        slots, monitors = basis.policy.policy.slots, len(basis.policy.monitors)
        if len(state.values) != slots or len(state.ages) != slots:
            return Flaw("decision/inputs", f"the state has not the {slots} slots of the policy")
        if len(state.monitors) != monitors or not SINGLE.issuperset(state.monitors):
            return Flaw("decision/inputs", f"the state has not a truth for each of the policy's {monitors} monitors")
        now = Now(record.at_us, record.utc_us, record.utc_error_us)
        flaw = self._observed.check(state, now)
        if flaw is not None:
            return flaw
        if record.kind != STEP and record.context.approvals:
            return Flaw("decision/approvals", "a link of a chain is decided without approvals")
        if record.kind == CONTINGENCY_LINK and record.step == -1:
            return self._contingency(record, state, now)
        if record.kind in (STEP, FALLBACK_LINK) and 0 <= record.step < len(basis.invocations):
            invocation = basis.invocations[record.step]
            expected = invocation.invocation.invocation_id.hex()
            if record.invocation != expected:
                return Flaw("decision/invocation", "the id is not that of its step", record.invocation, expected)
            if record.kind == FALLBACK_LINK:
                return self._fallback(record, invocation, state, now)
            if record.link == -1:
                return self._step(record, invocation, state, now)
        return _no_such(record)

    def _not_current(self, record: Decision) -> Flaw:
        text = "a step is decided whose turn had not come, or was over: the boundary decides no such step"
        return Flaw("decision/not-current", text, f"step {record.step}", f"step {max(self._latest, 0)} or the next")

    def _step(self, record: Decision, invocation: PreparedInvocation, state: State, now: Now) -> Answer | Flaw:
        given = record.context
        consumed = int(record.step in self._consumed)
        if given.consumed != consumed:
            text = "whether the step's id was used before is not what the records before say"
            return Flaw("decision/consumed", text, str(given.consumed), str(consumed))
        if self._basis.in_force.recalled:
            return Flaw("decision/recalled", "a step is decided after the mission was recalled")
        if record.step > self._latest + 1 or (record.step < self._latest and not consumed):
            return self._not_current(record)
        approvals = self._basis.in_force.approvals(invocation.invocation, now)
        if given.approvals != tuple((each.rule, each.role, each.granted, each.monotonic_us) for each in approvals):
            text = "the approvals that it read are not those that the log holds and that are verified"
            return Flaw("decision/approvals", text, str(given.approvals), str(approvals))
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
        decision = decide(invocation, state, self._basis.policy, context, now)
        if decision.outcome is not Outcome.DENY or record.mode == UNENFORCED:
            self._latest = max(self._latest, record.step)
        if decision.step > _AUTHORITY and not _may_ask_again(invocation, decision.outcome, decision.reason):
            self._consumed.add(record.step)
        target, link = decision.target, decision.link
        return Answer(
            decision.outcome.name.lower(),
            decision.reason.value,
            decision.step,
            *_place(decision.clause),
            None if target is None else target.text,
            -1 if link is None or link == DEGRADE else link,
            decision.valid_until_us,
        )

    def _fallback(self, record: Decision, invocation: PreparedInvocation, state: State, now: Now) -> Answer | Flaw:
        basis, chain = self._basis, invocation.chain
        if record.link == DEGRADE:
            choice = choose_fallback(invocation, state, basis.policy, now)
            admissible = choice is not None and choice.index == DEGRADE
        elif 0 <= record.link < len(chain):
            admissible = link_admissible(chain[record.link], state, basis.policy, now, invocation.phase)
        else:
            return _no_such(record)
        if record.step != self._latest:
            return self._not_current(record)
        return _of_link(record, invocation.invocation.binding, now, admissible=admissible)

    def _contingency(self, record: Decision, state: State, now: Now) -> Answer | Flaw:
        basis = self._basis
        chain = basis.policy.contingency
        if not 0 <= record.link < len(chain):
            return _no_such(record)
        if record.invocation:
            return Flaw("decision/invocation", "a link of the contingency belongs to no step", record.invocation)
        admissible = link_admissible(chain[record.link], state, basis.policy, now)
        return _of_link(record, basis.bundle.policy_digest, now, admissible=admissible)


def _class(durability: int) -> str:
    return WORDS[durability] if 0 <= durability < len(WORDS) else str(durability)


def _octets(text: str) -> bytes | None:
    try:
        data = bytes.fromhex(text)
    except ValueError:
        return None
    return data if data.hex() == text else None


def _may_ask_again(invocation: PreparedInvocation, outcome: Outcome, reason: Reason) -> bool:
    """A deferred step is asked for again, and so is one that its mission holds for, until its deadline."""
    if outcome is Outcome.FALLBACK:
        return invocation.invocation.on_inadmissible == OnInadmissible.HOLD and reason is not Reason.NO_SLACK
    return outcome is Outcome.DEFER


def _of_link(record: Decision, binding: bytes, now: Now, *, admissible: bool) -> Answer:
    """The answer about a link: links skip steps 2 to 5 (design 4.4)."""
    at_us = now.monotonic_us
    if record.binding != binding.hex():
        return Answer("deny", Reason.BINDING_MISMATCH.value, 1, None, None, None, -1, at_us)
    if not admissible:
        return Answer("fallback", Reason.STATE_VIOLATED.value, _STATE, None, None, None, -1, at_us)
    return Answer("allow", Reason.ADMITTED.value, _PASSED, None, None, None, -1, at_us + LINK_VALID_US)


def _place(clause: Clause | Rule | Airspace | None) -> tuple[str | None, tuple[int, int, int] | None]:
    return (None, None) if clause is None else (clause.text, (clause.source, clause.start, clause.end))


def _no_such(record: Decision) -> Flaw:
    text = "the bundle has no such step or link"
    return Flaw("decision/unknown-step", text, f"kind {record.kind}, step {record.step}, link {record.link}")
