"""The rules of one session (design 4.4): which step is current, which ids are used up, what may be asked for again, and
what is decided about links. The boundary follows them on board, and the audit when it derives a log again.
"""

from typing import Final

import msgspec

from rtshcua.decision.decide import Decision, decide
from rtshcua.decision.in_force import InForce
from rtshcua.decision.links import DEGRADE, choose_fallback, link_admissible
from rtshcua.decision.prepared import PreparedPolicy
from rtshcua.model.flat.contract import Link
from rtshcua.model.flat.mission import Invocation, OnInadmissible
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.wire.permit import LINK_VALID_US
from rtshcua.wire.receipt import REPLACEMENT, Receipt
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP, Ref
from rtshcua.wire.response import Status

#: the last step of section 4.1 that a request must pass for its id to be used up
_AUTHORITY: Final = 3
_INTEGRITY: Final = 1
_STATE: Final = 6
_PASSED: Final = 8
# an enumeration's attributes are slow to find
_ALLOW, _DENY, _DEFER, _FALLBACK = Outcome.ALLOW, Outcome.DENY, Outcome.DEFER, Outcome.FALLBACK
_ADMITTED, _BINDING_MISMATCH, _STATE_VIOLATED = Reason.ADMITTED, Reason.BINDING_MISMATCH, Reason.STATE_VIOLATED
_UNKNOWN_STEP, _NOT_CURRENT = Status.UNKNOWN_STEP, Status.NOT_CURRENT


class LinkDecision(msgspec.Struct, frozen=True, gc=False):
    """What is decided about a link, field by field as in `Decision`; `link` is the link itself where it may fly."""

    outcome: Outcome
    reason: Reason
    step: int
    link: Link | None
    valid_until_us: int


class Session:
    """Decides on the steps and links of what is in force, in the order in which they are asked for.

    `enforced` false is mode `none`: a step that is denied flies all the same, and so becomes the current one.
    """

    def __init__(self, policy: PreparedPolicy, in_force: InForce, *, enforced: bool) -> None:
        self._policy = policy
        self._in_force = in_force
        self._enforced = enforced
        self._consumed: set[int] = set()
        self._latest = -1  # the last step that was asked for and not denied

    @property
    def current(self) -> int:
        """The step that may be asked for; the one after it may be too, once this one was."""
        return max(self._latest, 0)

    def consumed(self, step: int) -> int:
        """1 if the step's id was used up, as `Context` has it."""
        return int(step in self._consumed)

    def refusal(self, ref: Ref) -> Status | None:
        """Why nothing is decided about a step or a link: there is none, or its turn is not now. None where it may be
        asked for. After a recall it is no step's turn; links may fly as before.
        """
        kind, step, link = ref
        if kind == CONTINGENCY_LINK:
            return None if step == -1 and 0 <= link < len(self._policy.contingency) else _UNKNOWN_STEP
        invocations = self._in_force.invocations
        if not 0 <= step < len(invocations):
            return _UNKNOWN_STEP
        if kind == FALLBACK_LINK:
            if not DEGRADE <= link < len(invocations[step].chain):
                return _UNKNOWN_STEP
            return None if step == self._latest else _NOT_CURRENT
        if kind != STEP or link != -1:
            return _UNKNOWN_STEP
        passed_over = step < self._latest and step not in self._consumed
        return _NOT_CURRENT if self._in_force.recalled or passed_over or step > self._latest + 1 else None

    def decide_step(self, step: int, state: State, context: Context, now: Now) -> Decision:
        """Decide on a step that may be asked for (`refusal`), and remember it."""
        invocation = self._in_force.invocations[step]
        decision = decide(invocation, state, self._policy, context, now)
        if decision.outcome is not _DENY or not self._enforced:
            self._latest = max(self._latest, step)
        if decision.step > _AUTHORITY and not may_ask_again(invocation.invocation, decision.outcome, decision.reason):
            self._consumed.add(step)
        return decision

    def decide_link(self, ref: Ref, binding: bytes, state: State, now: Now) -> LinkDecision:
        """Decide on a link that may be asked for (`refusal`), under the binding presented: its step's, or for the
        contingency the policy's digest. Steps 2 to 5 are skipped, and nothing is remembered.
        """
        kind, step, number = ref
        if kind == CONTINGENCY_LINK:
            bound = self._in_force.bundle.policy_digest
        else:
            invocation = self._in_force.invocations[step]
            bound = invocation.invocation.binding
        if binding != bound:
            return LinkDecision(_DENY, _BINDING_MISMATCH, _INTEGRITY, None, now.monotonic_us)
        if kind == CONTINGENCY_LINK:
            prepared = self._policy.contingency[number]
            link = prepared.link if link_admissible(prepared, state, self._policy, now) else None
        elif number == DEGRADE:
            choice = choose_fallback(invocation, state, self._policy, now)
            link = None if choice is None or choice.index != DEGRADE else choice.link
        else:
            prepared = invocation.chain[number]
            link = prepared.link if link_admissible(prepared, state, self._policy, now, invocation.phase) else None
        if link is None:
            return LinkDecision(_FALLBACK, _STATE_VIOLATED, _STATE, None, now.monotonic_us)
        return LinkDecision(_ALLOW, _ADMITTED, _PASSED, link, now.monotonic_us + LINK_VALID_US)

    def take(self, document: bytes, now: Now, released: int = 0) -> Receipt:
        """Take in a signed document, if it is to be trusted; see `InForce.take`.

        `released` steps were released, as far as the caller knows; more were if they were asked for. The steps that a
        replacement brings were never used.
        """
        decided = self._latest + self.consumed(self._latest)
        receipt = self._in_force.take(document, now, decided=max(decided, 0), released=max(released, self._latest + 1))
        if receipt.kind == REPLACEMENT and receipt.accepted:
            self._consumed = {step for step in self._consumed if step < receipt.step}
        return receipt


def may_ask_again(invocation: Invocation, outcome: Outcome, reason: Reason) -> bool:
    """Whether an answer leaves the id unused: a deferred step is asked for again, and so is one that its mission holds
    for, until its deadline.
    """
    if outcome is _FALLBACK:
        return invocation.on_inadmissible == OnInadmissible.HOLD and reason is not Reason.NO_SLACK
    return outcome is _DEFER
