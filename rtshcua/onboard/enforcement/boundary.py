"""The enforcement boundary in this process: `enforce` decides one request and mints what the decision grants.

It holds what a runtime must not be trusted with: the verified bundle, which steps were decided, and the key of the
permits. Bytes go in and bytes come out, so that an isolated process or a trusted world can take its place.
"""

from typing import Final

from rtshcua.decision.decide import Decision, decide
from rtshcua.decision.in_force import InForce
from rtshcua.decision.links import DEGRADE, choose_fallback, link_admissible
from rtshcua.decision.prepared import PreparedInvocation, PreparedPolicy
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Link
from rtshcua.model.flat.mission import OnInadmissible
from rtshcua.model.flat.policy import Airspace, Policy, Rule
from rtshcua.model.flat.situation import Context, Now
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.enforcement.commands import Commands
from rtshcua.onboard.enforcement.mint import Mint
from rtshcua.wire.permit import LINK_VALID_US
from rtshcua.wire.receipt import REPLACEMENT, UNKNOWN, Receipt
from rtshcua.wire.receipt import encode as encode_receipt
from rtshcua.wire.request import FALLBACK_LINK, STEP, Request, decode
from rtshcua.wire.response import (
    NO_CLAUSE,
    NO_TARGET,
    Answer,
    Status,
    encode,
    encode_refusal,
    own_clauses,
    shared_clauses,
)

#: the last step of section 4.1 that a request must pass for its id to be used up
_AUTHORITY: Final = 3
_INTEGRITY: Final = 1
_STATE: Final = 6
_PASSED: Final = 8
#: how far UTC and monotonic time may part in a session, in us: more than a good clock is off, and less than matters
CLOCKS_PART_US: Final = 3_000_000


class SoftwareBoundary:
    """`ports.Boundary` over a prepared bundle.

    `enforced` false is mode `none`: it decides and answers as ever, and mints a step's permit whatever the decision.
    """

    def __init__(
        self,
        policy: PreparedPolicy,
        in_force: InForce,
        commands: Commands,
        vehicle: str,
        mint: Mint,
        *,
        enforced: bool,
    ) -> None:
        self._policy = policy
        self._in_force = in_force
        self._commands = commands
        self._policy_digest = in_force.bundle.policy_digest
        self._vehicle = vehicle
        self._version = policy.policy.version  # latched: a newer policy comes with another bundle, after landing
        self._mint = mint
        self._enforced = enforced
        self._slots = policy.policy.slots
        self._monitors = len(policy.monitors)
        self._clauses = _ClauseNumbers(policy.policy, in_force.invocations)
        self._consumed: set[int] = set()
        self._now_us = 0  # of the last request: time does not go back
        self._latest = -1  # the last step that was asked for and not denied
        self._ahead_us: int | None = None  # UTC less monotonic time, as it was first told

    def enforce(self, request: bytes) -> bytes:
        """Decide one request. Hostile bytes get a refusal; nothing is raised and nothing is remembered of them."""
        asked = decode(request, self._slots, self._monitors)
        if isinstance(asked, Refusal):
            return encode_refusal(Status.MALFORMED)
        now_us = asked.now.monotonic_us
        if not max(self._now_us, asked.released_us) <= now_us:  # a release to come would move the deadline
            return encode_refusal(Status.MALFORMED)
        if not self._keeps_time(asked.now):
            return encode_refusal(Status.MALFORMED)
        self._now_us = now_us
        answer = self._step(asked) if asked.kind == STEP else self._link(asked)
        return encode_refusal(answer) if isinstance(answer, Status) else encode(answer)

    def consider(self, document: bytes, now: Now) -> None:
        """Look at a document ahead, in whatever thread; nothing comes of it but that `present` is quick."""
        self._in_force.consider(document, now)

    def present(self, document: bytes, now: Now, released: int) -> bytes:
        """Take in a signed document, if it is to be trusted. Nothing is raised, and nothing else is changed.

        `released` steps were released, as far as the runtime knows; more were if they were asked for here. An answer
        about a step whose id is used up comes too late.
        """
        if now.monotonic_us < self._now_us:
            return encode_receipt(Receipt(UNKNOWN, "time-went-back", "it came before the last request"))
        if not self._keeps_time(now):
            return encode_receipt(Receipt(UNKNOWN, "time-of-day-set", "its time of day is not that of requests before"))
        self._now_us = now.monotonic_us
        decided = self._latest + int(self._latest in self._consumed)
        receipt = self._in_force.take(document, now, decided=max(decided, 0), released=max(released, self._latest + 1))
        self._commands.recalled = self._in_force.recalled
        if receipt.kind == REPLACEMENT and receipt.accepted:
            self._commands.replace(self._in_force.bundle.mission)
            self._consumed = {step for step in self._consumed if step < receipt.step}
            self._clauses = _ClauseNumbers(self._policy.policy, self._in_force.invocations)
        return encode_receipt(receipt)

    def _keeps_time(self, now: Now) -> bool:
        """Whether UTC went on as monotonic time did. What has expired would be good again for whoever sets it back, and
        what is permitted at other hours, now. By a clock that does not know the time, nothing is granted anyway.
        """
        if now.utc_error_us > CLOCKS_PART_US:
            return True
        ahead_us = now.utc_us - now.monotonic_us
        if self._ahead_us is None:
            self._ahead_us = ahead_us
        return abs(ahead_us - self._ahead_us) <= CLOCKS_PART_US

    def _step(self, asked: Request) -> Answer | Status:
        step, invocations = asked.step, self._in_force.invocations
        if not 0 <= step < len(invocations) or asked.link != -1:
            return Status.UNKNOWN_STEP
        consumed = int(step in self._consumed)
        if self._in_force.recalled or step > self._latest + 1 or (step < self._latest and not consumed):
            return Status.NOT_CURRENT
        prepared = invocations[step]
        context = Context(
            asked.binding,
            self._vehicle,
            self._version,
            consumed,
            asked.released_us,
            asked.phase,
            asked.remaining_us,
            self._in_force.approvals(prepared.invocation, asked.now),
        )
        decision = decide(prepared, asked.state, self._policy, context, asked.now)
        if decision.outcome is not Outcome.DENY or not self._enforced:
            self._latest = max(self._latest, step)
        if decision.step > _AUTHORITY and not self._may_ask_again(prepared, decision):
            self._consumed.add(step)
        return Answer(
            decision.outcome,
            decision.reason,
            decision.step,
            NO_CLAUSE if decision.clause is None else self._clauses.number(step, decision.clause),
            NO_TARGET if decision.link is None else self._target(prepared, decision.link, decision.target),
            decision.valid_until_us,
            consumed,
            self._permit(prepared, decision, asked.now.monotonic_us),
        )

    def _may_ask_again(self, prepared: PreparedInvocation, decision: Decision) -> bool:
        """A deferred step is asked for again, and so is one that its mission holds for."""
        if decision.outcome is Outcome.FALLBACK:
            holds = prepared.invocation.on_inadmissible == OnInadmissible.HOLD
            return holds and decision.reason is not Reason.NO_SLACK
        return decision.outcome is Outcome.DEFER

    def _permit(self, prepared: PreparedInvocation, decision: Decision, now_us: int) -> bytes:
        not_after_us = decision.valid_until_us
        if decision.outcome is not Outcome.ALLOW:
            if self._enforced:
                return b""
            not_after_us = now_us + LINK_VALID_US
        invocation = prepared.invocation
        contingency = self._policy.policy.contingency
        return self._mint.step(invocation.step, not_after_us, len(invocation.contract.fallback), len(contingency))

    def _link(self, asked: Request) -> Answer | Status:
        now_us = asked.now.monotonic_us
        if asked.kind == FALLBACK_LINK:
            if not 0 <= asked.step < len(self._in_force.invocations):
                return Status.UNKNOWN_STEP
            if asked.step != self._latest:
                return Status.NOT_CURRENT
            prepared = self._in_force.invocations[asked.step]
            binding = prepared.invocation.binding
            number = self._fallback(asked, prepared)
        else:
            if asked.step != -1:
                return Status.UNKNOWN_STEP
            binding = self._policy_digest
            number = self._contingency(asked)
        if isinstance(number, Status):
            return number
        if asked.binding != binding:
            reason = Reason.BINDING_MISMATCH
            return Answer(Outcome.DENY, reason, _INTEGRITY, NO_CLAUSE, NO_TARGET, now_us, 0)
        if number is None:
            return Answer(Outcome.FALLBACK, Reason.STATE_VIOLATED, _STATE, NO_CLAUSE, NO_TARGET, now_us, 0)
        until_us = now_us + LINK_VALID_US
        permit = self._mint.link(asked.kind, asked.step, number, until_us)
        return Answer(Outcome.ALLOW, Reason.ADMITTED, _PASSED, NO_CLAUSE, NO_TARGET, until_us, 0, permit)

    def _fallback(self, asked: Request, prepared: PreparedInvocation) -> int | Status | None:
        """The link's number in a permit if it may be flown now, None if not."""
        if asked.link >= len(prepared.chain):
            return Status.UNKNOWN_STEP
        if asked.link != DEGRADE:
            link = prepared.chain[asked.link]
            may = link_admissible(link, asked.state, self._policy, asked.now, prepared.phase)
            return asked.link if may else None
        choice = choose_fallback(prepared, asked.state, self._policy, asked.now)
        if choice is None or choice.index != DEGRADE:
            return None
        return self._target(prepared, choice.index, choice.link)

    def _target(self, prepared: PreparedInvocation, index: int, link: Link | None) -> int:
        """A link's number outside of `decide`: the one in its chain, or `-1 - rule` for a degrade rule's target."""
        if index != DEGRADE:
            return index
        for degrade in prepared.candidates.degrades:
            if degrade.rule.target == link:
                return -1 - self._clauses.shared[degrade.rule]
        raise LookupError("no degrade rule has this target")

    def _contingency(self, asked: Request) -> int | Status | None:
        chain = self._policy.contingency
        if not 0 <= asked.link < len(chain):
            return Status.UNKNOWN_STEP
        return asked.link if link_admissible(chain[asked.link], asked.state, self._policy, asked.now) else None


class _ClauseNumbers:
    """The numbers of clauses in a response. The shared ones are kept once; a rule has its index in the policy."""

    def __init__(self, policy: Policy, invocations: tuple[PreparedInvocation, ...]) -> None:
        shared = shared_clauses(policy)
        self.shared: dict[Clause | Rule | Airspace, int] = {clause: number for number, clause in enumerate(shared)}
        self._own: tuple[dict[Clause | Rule | Airspace, int], ...] = tuple(
            {clause: len(shared) + number for number, clause in enumerate(own_clauses(prepared.invocation.contract))}
            for prepared in invocations
        )

    def number(self, step: int, clause: Clause | Rule | Airspace) -> int:
        number = self._own[step].get(clause)
        return self.shared[clause] if number is None else number
