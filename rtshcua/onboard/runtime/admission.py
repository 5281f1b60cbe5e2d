"""Admission: asks the boundary, and records each answer before anyone acts on it."""

from collections import deque
from collections.abc import Iterable
from functools import partial

from rtshcua.decision.durability import confirmed, durability_of
from rtshcua.evidence.answer import RecordedAnswer
from rtshcua.model.durability import WRITTEN
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Link
from rtshcua.model.flat.policy import Airspace, Rule
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.model.outcome import Outcome
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Action, Announce, Show
from rtshcua.onboard.runtime.journal import Journal
from rtshcua.onboard.runtime.queue import InvocationQueue
from rtshcua.onboard.runtime.remaining import RemainingLatency
from rtshcua.onboard.runtime.view import Decided
from rtshcua.wire.approval import Answered, Approvals
from rtshcua.wire.receipt import Receipt
from rtshcua.wire.request import CONTINGENCY_LINK, DEGRADE, FALLBACK_LINK, STEP, Ref, Request, encode
from rtshcua.wire.response import NO_CLAUSE, NO_TARGET, Answer, Status, decode, own_clauses, shared_clauses

#: how many decisions a display is shown
SHOWN = 6
_OUTCOMES = {outcome: outcome.name.lower() for outcome in Outcome}
#: MAV_SEVERITY of what ground stations are told of a decision: info, warning, notice, warning
_SEVERITIES = {Outcome.ALLOW: 6, Outcome.DENY: 4, Outcome.DEFER: 5, Outcome.FALLBACK: 4}


class Admission:
    """Builds requests, reads answers, records them.

    An answer about a step that equals the one before is counted and not recorded again, so that a deferral does not
    flood the log; `flush` records the count.
    """

    def __init__(self, loaded: Loaded, journal: Journal, queue: InvocationQueue, remaining: RemainingLatency) -> None:
        self._loaded = loaded
        self._in_force = loaded.in_force
        self._journal = journal
        self._queue = queue
        self._remaining = remaining
        self.recent: deque[Decided] = deque(maxlen=SHOWN)
        self._policy = loaded.bundle.policy
        self._shared = shared_clauses(self._policy)
        self._approvals = Approvals(self._policy)
        self._last: tuple[int, tuple[object, ...]] | None = None
        self._repeated = 0

    def answered(self, receipt: Receipt, now: Now) -> None:
        """The boundary accepted an approval: it tells later decisions of it, and so do their records."""
        self._approvals.add(
            Answered(receipt.step, receipt.role, receipt.granted, now.monotonic_us, receipt.expires_us), now
        )

    def replaced(self, first: int) -> None:
        """The steps from `first` on are others now."""
        self._approvals.forget(first)

    def ask(self, now: Now, state: State, ref: Ref) -> Answer | None:
        """The boundary's answer about a step or link; None when it did not decide."""
        kind, step, link = ref
        released_us = self._queue.released_us or 0  # 0: nothing was released yet, and only the contingency may fly
        phase, remaining_us = self._queue.phase, self._remaining.us
        binding, identity = self._bound(kind, step)
        data = self._loaded.boundary.enforce(
            encode(Request(kind, step, link, binding, now, state, released_us, phase, remaining_us))
        )
        answer = decode(data)
        if not isinstance(answer, Answer):
            text = answer.name.lower() if isinstance(answer, Status) else answer.text
            self._journal.effect(now, "undecided", ref, detail=text)
            return None
        if kind == STEP:
            last = (step, (answer.outcome, answer.reason, answer.clause, answer.target))
            if last == self._last and not answer.permit:
                self._repeated += 1
                return answer
            self.flush(now)
            self._last = last
        approvals = self._approvals.about(self._in_force.invocations[step].invocation, now) if kind == STEP else ()
        vehicle, version = self._loaded.vehicle, self._policy.version
        context = Context(binding, vehicle, version, answer.consumed, released_us, phase, remaining_us, approvals)
        durability = WRITTEN
        if kind == STEP:
            contract = self._in_force.invocations[step].invocation.contract
            durability = durability_of(contract, answer.outcome, confirmed=confirmed(context), kind=kind)
        self._journal.tell(partial(self._told, now, ref, identity, state, context, answer, durability))
        return answer

    def flush(self, now: Now) -> None:
        """Record how often the last answer was given again."""
        if self._last is not None and self._repeated:
            self._journal.effect(now, "repeated", Ref(STEP, self._last[0], -1), detail=str(self._repeated))
        self._last = None
        self._repeated = 0

    def _clause(self, step: int, answer: Answer) -> Clause | Rule | Airspace | None:
        """The clause that decided, found by its number."""
        if answer.clause == NO_CLAUSE:
            return None
        if answer.clause < len(self._shared):
            return self._shared[answer.clause]
        own = own_clauses(self._in_force.invocations[step].invocation.contract)
        return own[answer.clause - len(self._shared)]

    def _told(
        self, now: Now, ref: Ref, identity: bytes, state: State, context: Context, answer: Answer, durability: int
    ) -> Iterable[Action]:
        """An answer as it is shown, announced and recorded."""
        clause, target = self._clause(ref.step, answer), self._target(ref.step, answer)
        yield from self._shown(now, ref, answer, "" if clause is None else clause.text)
        recorded = RecordedAnswer.of(
            answer.outcome,
            answer.reason,
            answer.rule_step,
            answer.valid_until_us,
            clause=clause,
            target=target,
            target_link=max(answer.target, -1),
        )
        line = partial(self._journal.recorder.decision, now, ref, identity, state, context, recorded, durability)
        yield from self._journal.record(line, now, durability, awaited=True)

    def _shown(self, now: Now, ref: Ref, answer: Answer, clause: str) -> Iterable[Action]:
        subject = self._subject(ref)
        outcome, reason = _OUTCOMES[answer.outcome], answer.reason._value_  # `value` is a property in Python, and slow
        self.recent.append(Decided(now.monotonic_us, subject, outcome, reason, clause))
        text = f"{outcome} {subject}: {reason}" + (f" (`{clause}`)" if clause else "")
        yield Show("decision", text, ref.step)
        why = "" if answer.outcome is Outcome.ALLOW else f"{reason}: "  # first, for what is long is cut
        yield Announce(_SEVERITIES[answer.outcome], f"{outcome} {why}{subject}")

    def _subject(self, ref: Ref) -> str:
        kind, step, link = ref
        if kind == STEP:
            return self._in_force.invocations[step].invocation.text
        if link == DEGRADE:
            return "the target of a degrade rule"
        chain = self._policy.contingency
        if kind == FALLBACK_LINK:
            chain = self._in_force.invocations[step].invocation.contract.fallback
        return chain[link].text

    def _bound(self, kind: int, step: int) -> tuple[bytes, bytes]:
        if kind == CONTINGENCY_LINK:
            return self._loaded.bundle.policy_digest, b""
        invocation = self._in_force.invocations[step].invocation
        return invocation.binding, invocation.invocation_id

    def _target(self, step: int, answer: Answer) -> Link | None:
        if answer.target == NO_TARGET:
            return None
        if answer.target >= 0:
            return self._in_force.invocations[step].invocation.contract.fallback[answer.target]
        return self._policy.rules[-1 - answer.target].target
