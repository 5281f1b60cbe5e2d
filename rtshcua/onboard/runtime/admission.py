"""Admission: the current step, the boundary's answers, and the record of each answer before it takes effect."""

from collections import deque
from collections.abc import Iterable
from functools import partial
from hashlib import sha256

from rtshcua.decision.durability import confirmed, durability_of
from rtshcua.model.decision import Decision
from rtshcua.model.durability import WRITTEN
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.situation import ConfirmAnswer, Context, Now, State
from rtshcua.model.outcome import Outcome
from rtshcua.onboard.calls import call
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Action, Announce
from rtshcua.onboard.runtime.dispatcher import RemainingLatency
from rtshcua.onboard.runtime.journal import Journal
from rtshcua.onboard.runtime.view import Decided
from rtshcua.wire.request import CONTINGENCY_LINK, DEGRADE, STEP, Ref, Request, encode
from rtshcua.wire.response import Status, decode

#: the number of decisions in the display
SHOWN = 6
_OUTCOMES = {outcome: outcome.name.lower() for outcome in Outcome}
#: the MAV_SEVERITY with which ground stations are informed of a decision: info, warning, notice, warning
_SEVERITIES = {Outcome.ALLOW: 6, Outcome.DENY: 4, Outcome.DEFER: 5, Outcome.FALLBACK: 4}


class InvocationQueue:
    """`Q_onboard`, paper symbol: the mission's invocations, released one after the other, phase by phase.

    Release (section 4.3): for the first step when the vehicle is ready, for later ones when the predecessor ends.
    Times are monotonic, in us.
    """

    def __init__(self, mission: Mission) -> None:
        self._steps = mission.invocations
        self._index = 0
        self._end = len(self._steps)  # the steps from here on were declined, or do not exist
        self.released_us: int | None = None  # when the current step was released; None before the vehicle was ready
        #: the step that is requested while the current one runs, and when it was released (None: not yet)
        self.ahead: Invocation | None = None
        self.ahead_us: int | None = None

    @property
    def current(self) -> Invocation | None:
        """The step that is to be admitted or is running; None once all are done."""
        return self._steps[self._index] if self._index < self._end else None

    @property
    def at_last(self) -> bool:
        """Whether no step follows the current one."""
        return self._index + 1 >= self._end

    @property
    def released(self) -> int:
        """How many steps were released; these do not change any more."""
        return 0 if self.released_us is None else self._index + (self._index < self._end)

    @property
    def phase(self) -> int:
        """The index of the current mission phase; the last step's once all are done."""
        return self._steps[min(self._index, len(self._steps) - 1)].phase

    def step(self, number: int) -> Invocation:
        """The step of this index."""
        return self._steps[number]

    def release(self, now_us: int) -> None:
        """Release the first step. Later calls have no effect, because a vehicle becomes ready once."""
        if self.released_us is None:
            self.released_us = now_us

    def replace(self, mission: Mission, first: int, now_us: int) -> None:
        """Set the steps, which differ from `first` on. If the current one is among these, it is released now."""
        self._steps, self._end = mission.invocations, len(mission.invocations)
        self.ahead = self.ahead_us = None
        if first <= self._index and self.released_us is not None:
            self.released_us = now_us

    def follows(self, first: int) -> bool:
        """Whether no step that may still be flown lies between the current one, or the one ahead, and `first`."""
        latest = self._index if self.ahead is None else self.ahead.step
        return first <= latest + 1 or self._end <= latest + 1

    def put_ahead(self, step: int) -> None:
        """Request this step while the current one runs."""
        self.ahead, self.ahead_us = self._steps[step], None

    def skip_to(self, step: int, now_us: int) -> None:
        """Make this step the current one; it is released now."""
        self._index, self.released_us = step, now_us

    def release_ahead(self, now_us: int) -> None:
        """Release the step ahead, unless it was before."""
        self.ahead_us = now_us if self.ahead_us is None else self.ahead_us

    def release_of(self, ref: Ref) -> tuple[int, int]:
        """When the subject of a request was released, and its phase. 0: nothing was released yet, and only the
        contingency may fly.
        """
        ahead = self.ahead
        if ref.kind == STEP and ahead is not None and ref.step == ahead.step:
            return self.ahead_us or 0, ahead.phase
        return self.released_us or 0, self.phase

    def decline(self, step: int) -> None:
        """This step, and those after it, are requested no more."""
        self._end = min(self._end, step)
        self.ahead = self.ahead_us = None

    def advance(self, now_us: int) -> None:
        """The current step ended, or is skipped: release the next. One that was ahead keeps its release."""
        if self.ahead is None:
            self._index += 1
            self.released_us = now_us
        else:
            self._index = self.ahead.step
            self.released_us = now_us if self.ahead_us is None else self.ahead_us
            self.ahead = self.ahead_us = None


class Admission:
    """Builds requests, decodes answers, records them.

    An answer about a step that equals the previous one is counted and not recorded again, so that a deferral does
    not flood the log; `flush` records the count. A step that replaced another one is a different step.
    """

    def __init__(self, loaded: Loaded, journal: Journal, queue: InvocationQueue, remaining: RemainingLatency) -> None:
        self._loaded = loaded
        self._in_force = loaded.in_force
        self._policy = loaded.bundle.policy
        self._journal = journal
        self._queue = queue
        self._remaining = remaining
        self.recent: deque[Decided] = deque(maxlen=SHOWN)
        self._last: tuple[int, tuple[object, ...]] | None = None
        self._repeated = 0

    def ask(self, now: Now, state: State, ref: Ref) -> Decision | None:
        """The boundary's answer about a step or link; None if it did not decide."""
        kind, step, link = ref
        remaining_us, (released_us, phase) = self._remaining.us, self._queue.release_of(ref)
        invocation = None if kind == CONTINGENCY_LINK else self._in_force.invocations[step].invocation
        binding = self._in_force.bundle.policy_digest if invocation is None else invocation.binding
        request = Request(kind, step, link, binding, now, state, released_us, phase, remaining_us)
        asked_for = encode(request)
        contract = None if invocation is None else invocation.contract
        answer = decode(self._loaded.boundary.enforce(asked_for), self._policy, contract)
        if self._journal.look_at_boundary(now):
            return None
        if not isinstance(answer, Decision):
            digest = sha256(asked_for).hexdigest()
            text = f"{answer.name.lower()} {digest}" if isinstance(answer, Status) else answer.text
            self._journal.effect(now, "undecided", ref, detail=text)
            return None
        asked = invocation if kind == STEP else None
        if asked is not None:
            last = (step, (binding, answer.outcome, answer.reason, answer.clause, answer.link, answer.target))
            if last == self._last and not answer.permit:
                self._repeated += 1
                return answer
            self.flush(now)
            self._last = last
        approvals = () if asked is None else self._in_force.approvals(asked, now)
        self._journal.tell(partial(self._told, request, ref, invocation, answer, approvals))
        return answer

    def flush(self, now: Now) -> None:
        """Record how often the last answer was repeated."""
        if self._last is not None and self._repeated:
            self._journal.effect(now, "repeated", Ref(STEP, self._last[0], -1), detail=str(self._repeated))
        self._last = None
        self._repeated = 0

    def _told(
        self, asked: Request, ref: Ref, of: Invocation | None, answer: Decision, approvals: tuple[ConfirmAnswer, ...]
    ) -> Iterable[Action]:
        """An answer for display, announcement and record; `of` is the step of the request, or of the requested link."""
        now, clause, subject = asked.now, answer.clause, self._subject(ref, of)
        outcome, reason = _OUTCOMES[answer.outcome], answer.reason.value
        self.recent.append(Decided(now.monotonic_us, subject, outcome, reason, "" if clause is None else clause.text))
        why = "" if answer.outcome is Outcome.ALLOW else f"{reason}: "  # first, because long texts are cut
        yield Announce(_SEVERITIES[answer.outcome], f"{outcome} {why}{subject}")
        identity = b"" if of is None else of.invocation_id
        context = Context(
            asked.binding, self._loaded.vehicle, self._policy.version, answer.consumed, asked.released_us, asked.phase,
            asked.remaining_us, approvals,
        )  # fmt: skip
        durability = WRITTEN
        if of is not None and ref.kind == STEP:
            durability = durability_of(of.contract, answer.outcome, confirmed=confirmed(context), kind=STEP)
        line = partial(self._journal.recorder.decision, now, ref, identity, asked.state, context, answer, durability)
        yield from self._journal.record(line, now, durability, awaited=True)

    def _subject(self, ref: Ref, of: Invocation | None) -> str:
        if of is None:
            return self._policy.contingency[ref.link].text
        if ref.kind == STEP:
            return call(self._policy, of)
        return "the target of a degrade rule" if ref.link == DEGRADE else of.contract.fallback[ref.link].text
