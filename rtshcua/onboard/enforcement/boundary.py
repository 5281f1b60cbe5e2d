"""The enforcement boundary in this process: `enforce` decides one request and issues the permits that the decision
grants.

It holds everything that the runtime is not trusted with: the verified bundle, the session (`decision.session`),
and the key of the permits. Its interface is bytes in, bytes out, so that an isolated process or a trusted world
can replace it. It chains each answer before it returns it (`wire.boundary_chain`); an answer about a step that
equals the previous one is only counted.
"""

from hashlib import sha256
from typing import Final, NamedTuple

from msgspec.structs import replace

from rtshcua.decision.fallbacks import DEGRADE
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.session import MOST_AHEAD, InForce, Session
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.decision import Decision
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Link
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Airspace, Rule
from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Context, Now
from rtshcua.model.outcome import REASON_NUMBERS, Outcome
from rtshcua.onboard.enforcement.executor import Commands, Made
from rtshcua.wire import boundary_chain, response
from rtshcua.wire.boundary_chain import BoundaryChain, Tag
from rtshcua.wire.clock import bears_out
from rtshcua.wire.permit import AGAIN, LINK_VALID_US, Permit, seal
from rtshcua.wire.receipt import REPLACEMENT, UNKNOWN, Receipt
from rtshcua.wire.receipt import encode as encode_receipt
from rtshcua.wire.request import FALLBACK_LINK, STEP, Ref, Request, decode
from rtshcua.wire.response import NO_CLAUSE, NO_TARGET, Status, encode, encode_refusal
from rtshcua.wire.untrusted import Untrusted

#: the greatest difference by which UTC and monotonic time may diverge in a session, in us: more than the error of a
#: good clock, and less than matters
CLOCKS_PART_US: Final = 3_000_000
_Numbers = dict[Clause | Rule | Airspace, int]


class PermitIssuer:
    """Seals permits under the session key, each with a serial of its own. Only a boundary has an issuer."""

    def __init__(self, key: bytes) -> None:
        self._key = key
        self._serial = 1

    def step(self, step: int, not_after_us: int, fallbacks: int, contingencies: int) -> bytes:
        """A step's permit, which also stands for so many links of its chain and of the contingency."""
        serial = self._serial
        self._serial += 1 + fallbacks + contingencies + AGAIN
        return self._seal(Permit(STEP, step, -1, serial, fallbacks, contingencies, not_after_us))

    def link(self, ref: Ref, not_after_us: int) -> bytes:
        """A permit for a link that was just decided; the `link` of a degrade rule's target is `-1 - rule`."""
        serial = self._serial
        self._serial += 1
        return self._seal(Permit(*ref, serial, 0, 0, not_after_us))

    def _seal(self, permit: Permit) -> bytes:
        return seal(permit, self._key)


class _Ready(NamedTuple):
    """The prepared parts of a new mission: its commands, the numbers of its steps' clauses, and SHA-256 of the
    document that contains it.
    """

    made: Made
    numbers: tuple[_Numbers, ...]
    digest: bytes


class SoftwareBoundary:
    """The boundary over a prepared bundle.

    `enforced` is false in mode `none`: it decides and answers as usual, but issues a step's permit whatever the
    decision.
    """

    #: it exists as long as the runtime does
    lost = None

    def __init__(
        self, in_force: InForce, commands: Commands, key: bytes, chain: BoundaryChain, *, enforced: bool
    ) -> None:
        policy = in_force.policy
        self._in_force = in_force
        self._session = Session(in_force, enforced=enforced)
        self._commands = commands
        self._vehicle = in_force.vehicle
        self._contingencies = len(policy.contingency)
        self._version = policy.policy.version  # fixed: a newer policy comes with another bundle, after landing
        self._issuer = PermitIssuer(key)
        self._chain = chain
        self._last: tuple[
            object, ...
        ] = ()  # the last answer about a step, without the fields that do not count in a comparison
        self._enforced = enforced
        self._slots = policy.policy.slots
        self._monitors = len(policy.monitors)
        self._shared: _Numbers = {clause: at for at, clause in enumerate(response.shared_clauses(policy.policy))}
        self._own = self._own_numbers(in_force.bundle.mission.invocations)
        #: the prepared parts of missions that may come into force, by the document that contains them
        self._ready: dict[bytes, _Ready] = {}
        self._now_us = 0  # of the last request, because time must not go back
        self._ahead_us: int | None = None  # UTC minus monotonic time at the first request

    def enforce(self, request: bytes, own: Now | None = None) -> bytes:
        """Decide one request. Malformed bytes are refused without an exception, and only their digest is remembered.
        `own` is the present moment by the boundary's own clock; without one the caller's time counts.
        """
        asked = decode(request, self._slots, self._monitors)
        if isinstance(asked, Refusal):
            return self._refuse(Status.MALFORMED, request)
        now_us = asked.now.monotonic_us
        # a later release would move the deadline
        if not self._now_us <= now_us >= asked.released_us:
            return self._refuse(Status.MALFORMED, request)
        disowned = self._disowned(asked.now, own)
        if disowned is not None:
            return self._refuse(disowned, request)
        self._now_us = now_us
        ref = Ref(asked.kind, asked.step, asked.link)
        refused = self._session.refusal(ref)
        if refused is not None:
            return self._refuse(refused, request)
        # nor could anything be released before it was received
        if asked.kind == STEP and asked.released_us < self._in_force.received_us(asked.step):
            return self._refuse(Status.MALFORMED, request)
        if asked.kind == STEP:
            decision = self._step(asked)
            clause = NO_CLAUSE if decision.clause is None else self._clause(asked.step, decision.clause)
            target = NO_TARGET if decision.link is None else self._target(asked.step, decision.link, decision.target)
        else:
            decision, clause, target = self._link(asked, ref), NO_CLAUSE, NO_TARGET
        return encode(decision, clause, target, self._chained(request, asked, decision, clause, target))

    def _refuse(self, status: Status, request: bytes) -> bytes:
        payload = boundary_chain.undecided(status, sha256(request).digest())
        return encode_refusal(status, self._chain.add(Tag.UNDECIDED, payload))

    def _chained(self, request: bytes, asked: Request, decision: Decision, clause: int, target: int) -> bytes:
        """The digest of the boundary's own evidence including this answer."""
        reason = REASON_NUMBERS[decision.reason]
        payload = boundary_chain.decided(
            request, decision.outcome, reason, decision.step, target, decision.valid_until_us, decision.consumed
        )
        if asked.kind == STEP:
            last, self._last = self._last, (asked.step, decision.outcome, reason, clause, target)
            if last == self._last and not decision.permit:
                return self._chain.repeat(payload)
        return self._chain.add(Tag.DECIDED, payload)

    def give_back(self, step: int) -> bool:
        """Called by the executor, which knows that nothing of a step was sent: see `Session.give_back`."""
        return self._session.give_back(step)

    def consider(self, document: bytes, now: Now) -> Untrusted | None:
        """Verify a document ahead, in any thread, so that `present` is fast. It has no other effect.

        Returns why it is not trusted.
        """
        refused = self._in_force.consider(document, now)
        after = self._in_force.considered(document)
        if after is not None:
            numbers = self._own_numbers(after.mission.invocations)
            made = self._commands.made(after.mission)
            self._ready[document] = _Ready(made, numbers, sha256(document).digest())
            for old in list(self._ready)[:-MOST_AHEAD]:
                self._ready.pop(old, None)
        return refused

    def present(self, document: bytes, now: Now, released: int, own: Now | None = None) -> bytes:
        """Accept a signed document if it is trusted. Raises nothing, and changes nothing else.

        `own` is as for `enforce`. `released` is the runtime's count of released steps; more were if they were
        requested here. An answer about a step whose id is used comes too late.
        """
        ready = self._ready.pop(document, None)
        receipt = self._taken(document, now, released, own, ready)
        if receipt.accepted:
            digest = sha256(document).digest() if ready is None else ready.digest
            payload = boundary_chain.document(receipt.kind, receipt.step, now, digest)
            evidence = self._chain.add(Tag.DOCUMENT, payload)
        else:
            evidence = self._chain.decline(document)
        return encode_receipt(replace(receipt, evidence=evidence))

    def _taken(self, document: bytes, now: Now, released: int, own: Now | None, ready: _Ready | None) -> Receipt:
        if now.monotonic_us < self._now_us:
            return Receipt(UNKNOWN, "time-went-back", "the document was presented before the time of the last request")
        disowned = self._disowned(now, own)
        if disowned is Status.MALFORMED:
            return Receipt(UNKNOWN, "time-of-day-set", "the time of day differs from that of earlier requests")
        if disowned is not None:
            slug = disowned.name.lower().replace("_", "-")
            return Receipt(UNKNOWN, slug, "the time of day disagrees with the boundary's own clock")
        self._now_us = now.monotonic_us
        receipt = self._session.take(document, now, released)
        self._commands.called_off = self._in_force.called_off
        if receipt.kind == REPLACEMENT and receipt.accepted:
            mission = self._in_force.bundle.mission
            self._commands.replace(mission, None if ready is None else ready.made)
            self._own = self._own_numbers(mission.invocations) if ready is None else ready.numbers
        return receipt

    def _disowned(self, named: Now, own: Now | None) -> Status | None:
        """Why a claimed time of day is not used for a decision; None if it is."""
        if own is None:
            return None if self._keeps_time(named) else Status.MALFORMED
        if bears_out(own, named):
            return None
        return Status.CLOCK_UNKNOWN if own.utc_error_us >= UTC_UNKNOWN_US else Status.CLOCK_APART

    def _keeps_time(self, now: Now) -> bool:
        """Whether UTC advanced like monotonic time. Setting it back would make expired documents valid again, and
        setting it ahead would reach other permitted hours. Nothing is granted by a clock that does not know the
        time.
        """
        if now.utc_error_us > CLOCKS_PART_US:
            return True
        ahead_us = now.utc_us - now.monotonic_us
        if self._ahead_us is None:
            self._ahead_us = ahead_us
        return abs(ahead_us - self._ahead_us) <= CLOCKS_PART_US

    def _step(self, asked: Request) -> Decision:
        step, now = asked.step, asked.now
        prepared = self._in_force.invocations[step]
        context = Context(
            asked.binding,
            self._vehicle,
            self._version,
            self._session.consumed(step),
            asked.released_us,
            asked.phase,
            asked.remaining_us,
            self._in_force.approvals(prepared.invocation, now),
        )
        decision = self._session.decide_step(step, asked.state, context, now)
        permit = self._permit(prepared, decision, now.monotonic_us)
        return replace(decision, permit=permit) if permit else decision

    def _permit(self, prepared: PreparedInvocation, decision: Decision, now_us: int) -> bytes:
        not_after_us = decision.valid_until_us
        if decision.outcome is not Outcome.ALLOW:
            if self._enforced:
                return b""
            not_after_us = now_us + LINK_VALID_US
        invocation = prepared.invocation
        fallbacks = len(invocation.contract.fallback)
        return self._issuer.step(invocation.step, not_after_us, fallbacks, self._contingencies)

    def _link(self, asked: Request, ref: Ref) -> Decision:
        decision = self._session.decide_link(ref, asked.binding, asked.state, asked.now)
        if decision.target is None:
            return decision
        if ref.kind == FALLBACK_LINK:
            ref = Ref(ref.kind, ref.step, self._target(ref.step, ref.link, decision.target))
        return replace(decision, permit=self._issuer.link(ref, decision.valid_until_us))

    def _clause(self, step: int, clause: Clause | Rule | Airspace) -> int:
        """The number of the deciding clause in a response; a rule has its index in the policy."""
        number = self._own[step].get(clause)
        return self._shared[clause] if number is None else number

    def _target(self, step: int, link: int, target: Link | None) -> int:
        """The number of a link of a step, in a response; `-1 - rule` for the target of a degrade rule."""
        if link != DEGRADE:
            return link
        for degrade in self._in_force.invocations[step].candidates.degrades:
            if degrade.rule.target == target:
                return -1 - self._shared[degrade.rule]
        raise LookupError("no degrade rule has this target")

    def _own_numbers(self, steps: tuple[Invocation, ...]) -> tuple[_Numbers, ...]:
        """For each step, the numbers of its contract's clauses, which follow those shared by all steps."""
        return tuple(
            {clause: at for at, clause in enumerate(response.own_clauses(each.contract), len(self._shared))}
            for each in steps
        )
