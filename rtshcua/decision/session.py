"""The rules of one session (design 4.3, 4.4): which step is current, which ids are used, what may be requested again,
what is decided about links, and what is in force. The boundary applies them on board, and the auditor when it
derives a log again.

Signed documents change what is in force; an invalid document changes nothing. Later decisions read the approvals.
A recall or a cancellation ends the mission. A replacement substitutes the steps that were not released. It cannot
reuse the id of an earlier step, and it cannot bring back a refused step: a refusal applies to what it refused, at
any position in any mission.
"""

from typing import Final, NamedTuple

from rtshcua.decision.decide import decide
from rtshcua.decision.evaluate import NO_PHASE
from rtshcua.decision.fallbacks import DEGRADE, choose_fallback, link_admissible
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy, prepare_mission
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.decision import Decision
from rtshcua.model.flat.mission import Invocation, Mission, OnInadmissible
from rtshcua.model.flat.situation import ConfirmAnswer, Context, Now, State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.model.step_number import step_words
from rtshcua.wire import names
from rtshcua.wire.approval import Approvals, open_approval
from rtshcua.wire.bundle import Bundle
from rtshcua.wire.cancellation import open_cancellation
from rtshcua.wire.document import DocumentError, check_key, check_root, kind_of
from rtshcua.wire.permit import LINK_VALID_US
from rtshcua.wire.recall import open_recall
from rtshcua.wire.receipt import ACCEPTED, APPROVAL, CANCELLATION, RECALL, REPLACEMENT, UNKNOWN, Receipt
from rtshcua.wire.replacement import (
    MAX_REPLACEMENTS,
    VerifiedReplacement,
    check_stays,
    fit_replacement,
    open_replacement,
)
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP, Ref
from rtshcua.wire.response import Status
from rtshcua.wire.trust import TrustRoot
from rtshcua.wire.untrusted import Untrusted

#: how many documents may be verified ahead of their acceptance
MOST_AHEAD: Final = 16

_KINDS: Final = {
    names.APPROVAL: APPROVAL, names.RECALL: RECALL, names.REPLACEMENT: REPLACEMENT, names.CANCELLATION: CANCELLATION,
}  # fmt: skip


class _Ahead(NamedTuple):
    """The result of verifying a document ahead: the prepared replacement, or why it is not trusted; the digest of the
    mission that its steps were compared with; the state after its acceptance; and the ids of its new steps.
    """

    found: VerifiedReplacement | Untrusted
    prepared: tuple[PreparedInvocation, ...]
    compared: bytes = b""
    after: Bundle | None = None
    new: frozenset[bytes] = frozenset()


class InForce:
    """The verified bundle and its invocations; after a replacement, those of the new mission.

    `flight` is the id of this flight. Documents name it, so that none is valid for another flight of the same
    mission. `received_us` is when the bundle was received on board, monotonic. `recalled` and `cancelled` say that
    no further step may begin, by order of a person or of the proposer.
    """

    def __init__(
        self,
        bundle: Bundle,
        policy: PreparedPolicy,
        invocations: tuple[PreparedInvocation, ...],
        root: TrustRoot,
        vehicle: str,
        flight: bytes,
        received_us: int,
    ) -> None:
        self.bundle = bundle
        self.invocations = invocations
        self.recalled = False
        self.cancelled = False
        self.policy = policy
        self.vehicle = vehicle
        self._root = root
        self.flight = flight
        self._approvals = Approvals(policy.policy)
        #: by step
        self._received_us: tuple[int, ...] = (received_us,) * len(invocations)
        #: the last replacements that were verified ahead, by their bytes
        self._ahead: dict[bytes, _Ahead] = {}
        #: issue time of the first mission: a proposer who post-dates a later mission must not escape a recall of
        #: the policy
        self._issued_at_us = min(
            [bundle.mission.issued_at_us, *(each.issued_at_us for each in bundle.mission.invocations)]
        )
        #: the first mission and all its replacements
        self._digests: tuple[bytes, ...] = (bundle.mission_digest,)
        #: the steps that were in force and no longer are
        self._replaced: tuple[Invocation, ...] = ()
        #: the ids of all steps that were ever in force
        self._seen = frozenset(each.invocation_id for each in bundle.mission.invocations)

    @property
    def called_off(self) -> bool:
        """Whether no further step may begin."""
        return self.recalled or self.cancelled

    def approvals(self, invocation: Invocation, now: Now) -> tuple[ConfirmAnswer, ...]:
        """The verified approvals that a decision on an invocation reads."""
        return self._approvals.about(invocation, now)

    def received_us(self, step: int) -> int:
        """When a step was received on board, monotonic (paper symbol `t_r`): nothing is released before that."""
        return self._received_us[step]

    def consider(self, document: bytes, now: Now) -> Untrusted | None:
        """Verify and prepare a replacement ahead, in any thread, so that `take` need not spend the time.

        Returns why it is not trusted. This has no effect but speed. The result depends on the document, the policy
        and the root, which do not change, and on the mission that it supersedes, if that is in force; `take`
        checks expiry again.
        """
        try:
            if kind_of(document) is not names.REPLACEMENT:
                return None
            bundle, found = self.bundle, self._opened(document, now)
            compared, after = b"", None
            if found.supersedes == bundle.mission_digest:
                check_stays(found, bundle)
                compared, after = bundle.mission_digest, found.over(bundle)
            ahead = _Ahead(found, self._prepared(found.mission), compared, after, found.new)
        except Untrusted as error:
            ahead = _Ahead(error, ())
        self._ahead[document] = ahead
        for old in list(self._ahead)[:-MOST_AHEAD]:
            self._ahead.pop(old, None)
        return ahead.found if isinstance(ahead.found, Untrusted) else None

    def considered(self, document: bytes) -> Bundle | None:
        """The state after the acceptance of a replacement that was verified ahead; None where it cannot be accepted,
        or not yet.
        """
        ahead = self._ahead.get(document)
        return None if ahead is None else ahead.after

    def misfit(self, document: bytes, released: int) -> Untrusted | None:
        """Why a replacement that was verified ahead does not apply to the mission in force, of which `released` steps
        were released; None where it applies or is unknown, or where no document has an effect any more.
        """
        ahead = self._ahead.get(document)
        if ahead is None or isinstance(ahead.found, Untrusted) or self.called_off:
            return None
        try:
            fit_replacement(ahead.found, self.bundle, released, compared=self.bundle.mission_digest)
        except Untrusted as error:
            return error
        return None

    def take(self, document: bytes, now: Now, *, decided: int, released: int, current: int = 0) -> Receipt:
        """Accept a document. The first `decided` steps have a final decision, the first `released` were released, and
        those from `current` on are not over.
        """
        kind = UNKNOWN
        try:
            ahead = self._ahead.get(document)
            trusted = ahead is not None and isinstance(ahead.found, VerifiedReplacement)
            kind = REPLACEMENT if trusted else _KINDS[kind_of(document)]
            if self.recalled:
                raise DocumentError("recalled", "the mission was recalled")
            if self.cancelled and kind != RECALL:
                raise DocumentError("cancelled", "the mission was cancelled")
            if kind == APPROVAL:
                return self._approval(document, now, decided)
            if kind == RECALL:
                return self._recall(document, now)
            if kind == CANCELLATION:
                return self._cancellation(document, now, current)
            return self._replacement(document, now, released)
        except Untrusted as error:
            return Receipt(kind, error.slug, str(error))

    def _approval(self, document: bytes, now: Now, decided: int) -> Receipt:
        policy = self.bundle.policy
        answered = open_approval(
            document, root=self._root, vehicle=self.vehicle, flight=self.flight, bundle=self.bundle, now=now,
            missions=self._digests, replaced=self._replaced,
        )  # fmt: skip
        step = answered.about.step
        if step < decided:
            raise DocumentError("already-decided", f"{step_words(step)} was already decided")
        self._approvals.add(answered, now)
        what = "granted" if answered.granted else "refused"
        text = f"{step_words(step)} is {what} by `{policy.roles[answered.role]}`"
        return Receipt(APPROVAL, ACCEPTED, text, step, answered.role, answered.granted, answered.expires_us)

    def _recall(self, document: bytes, now: Now) -> Receipt:
        open_recall(
            document,
            root=self._root,
            vehicle=self.vehicle,
            flight=self.flight,
            missions=self._digests,
            policy=self.bundle.policy_digest,
            issued_at_us=self._issued_at_us,
            now=now,
        )
        self.recalled = True
        return Receipt(RECALL, ACCEPTED, "the mission is recalled")

    def _cancellation(self, document: bytes, now: Now, current: int) -> Receipt:
        open_cancellation(
            document,
            root=self._root,
            vehicle=self.vehicle,
            flight=self.flight,
            missions=self._digests,
            bundle=self.bundle,
            current=current,
            now=now,
        )
        self.cancelled = True
        return Receipt(CANCELLATION, ACCEPTED, "the mission is cancelled: the policy's contingency flies")

    def _replacement(self, document: bytes, now: Now, released: int) -> Receipt:
        if len(self._digests) > MAX_REPLACEMENTS:
            raise DocumentError("too-many", f"one flight accepts at most {MAX_REPLACEMENTS} replacements")
        ahead = self._ahead.pop(document, None)
        if ahead is None:
            found = self._opened(document, now)
        elif isinstance(ahead.found, Untrusted):
            raise ahead.found
        else:
            check_root(self._root, now)
            for key in (self.bundle.policy_key, ahead.found.key):
                check_key(key, self.vehicle, now)
            found = ahead.found
        after = fit_replacement(found, self.bundle, released, compared=b"" if ahead is None else ahead.compared)
        new = found.new if ahead is None else ahead.new
        if not new.isdisjoint(self._seen):
            raise DocumentError("id-seen", "a new step has an id that this flight used before")
        prepared = self._prepared(found.mission) if ahead is None else ahead.prepared
        self._seen |= new
        self._replaced = (*self._replaced, *self.bundle.mission.invocations[found.kept :])
        self.bundle = after
        self.invocations = (*self.invocations[: found.kept], *prepared[found.kept :])
        self._received_us = (*self._received_us[: found.kept], *[now.monotonic_us] * (len(prepared) - found.kept))
        self._digests = (*self._digests, found.digest)
        self._approvals.keep(after.mission.invocations)
        steps = len(prepared)
        return Receipt(
            REPLACEMENT, ACCEPTED, f"the mission has {steps} steps now, new from {step_words(found.kept)}", found.kept
        )

    def _opened(self, document: bytes, now: Now) -> VerifiedReplacement:
        return open_replacement(
            document, root=self._root, vehicle=self.vehicle, flight=self.flight, bundle=self.bundle, now=now
        )

    def _prepared(self, mission: Mission) -> tuple[PreparedInvocation, ...]:
        prepared = prepare_mission(mission, self.policy)
        if isinstance(prepared, Refusal):
            raise DocumentError("malformed", f"the new mission is malformed: {prepared.text}")
        return prepared


#: the last step of section 4.1 that a request must pass for its id to be used
_AUTHORITY: Final = 3
#: a step that is not admitted may be requested again until its deadline
_WAITS: Final = (OnInadmissible.HOLD, OnInadmissible.REPLAN)
_INTEGRITY: Final = 1
_STATE: Final = 6
_PASSED: Final = 8


class Session:
    """Decides on the steps and links in force, in the order of the requests.

    `enforced` is false in mode `none`: a step that is denied flies nevertheless, and so becomes the current one.
    """

    def __init__(self, in_force: InForce, *, enforced: bool) -> None:
        self._policy = in_force.policy
        self._in_force = in_force
        self._enforced = enforced
        self._consumed: set[int] = set()
        self._latest = -1  # the last step that was requested and not denied,
        self._allowed = -1  # and the last that may have been sent

    @property
    def current(self) -> int:
        """The step that may be requested; after it was, the next one may be requested too."""
        return max(self._latest, 0)

    @property
    def _replaceable(self) -> bool:
        """Whether the last requested step may still be replaced: no frame of it was sent, and its id is not used."""
        invocations, latest = self._in_force.invocations, self._latest
        if not self._allowed < latest < len(invocations) or latest in self._consumed:
            return False
        return invocations[latest].invocation.on_inadmissible == OnInadmissible.REPLAN

    def consumed(self, step: int) -> int:
        """1 if the step's id was used, as in `Context`."""
        return int(step in self._consumed)

    def refusal(self, ref: Ref) -> Status | None:
        """Why no decision is made about a step or a link: it does not exist, or it is not its turn. None where it may
        be requested. After a recall or a cancellation no step has a turn; links may fly as before.
        """
        kind, step, link = ref
        if kind == CONTINGENCY_LINK:
            return None if step == -1 and 0 <= link < len(self._policy.contingency) else Status.UNKNOWN_STEP
        invocations = self._in_force.invocations
        if not 0 <= step < len(invocations):
            return Status.UNKNOWN_STEP
        if kind == FALLBACK_LINK:
            if not DEGRADE <= link < len(invocations[step].chain):
                return Status.UNKNOWN_STEP
            # the step that may fly keeps its chain while a later one is requested and not admitted
            return None if step in (self._latest, self._allowed) else Status.NOT_CURRENT
        if kind != STEP or link != -1:
            return Status.UNKNOWN_STEP
        passed_over = step < self._latest and step not in self._consumed
        return Status.NOT_CURRENT if self._in_force.called_off or passed_over or step > self._latest + 1 else None

    def decide_step(self, step: int, state: State, context: Context, now: Now) -> Decision:
        """Decide on a step that may be requested (see `refusal`), and remember the decision."""
        invocation = self._in_force.invocations[step]
        decision = decide(invocation, state, self._policy, context, now)
        if decision.outcome is not Outcome.DENY or not self._enforced:
            self._latest = max(self._latest, step)
        if decision.outcome is Outcome.ALLOW or not self._enforced:
            self._allowed = max(self._allowed, step)
        if decision.step > _AUTHORITY and not may_ask_again(invocation.invocation, decision.outcome, decision.reason):
            self._consumed.add(step)
        return decision

    def give_back(self, step: int) -> bool:
        """Release the id of an admitted step of which nothing was sent and nothing will be, so that the step may be
        requested once more before its deadline. False unless it is the last requested step and its id is used.
        """
        if step != self._latest or step not in self._consumed:
            return False
        self._consumed.discard(step)
        self._allowed = min(self._allowed, step - 1)
        return True

    def decide_link(self, ref: Ref, binding: bytes, state: State, now: Now) -> Decision:
        """Decide on a link that may be requested (see `refusal`), under the given binding: its step's, or for the
        contingency the policy's digest. Steps 2 to 5 are skipped, and nothing is remembered.
        """
        kind, step, number = ref
        if kind == CONTINGENCY_LINK:
            bound, chain, phase = self._in_force.bundle.policy_digest, self._policy.contingency, NO_PHASE
        else:
            invocation = self._in_force.invocations[step]
            bound, chain, phase = invocation.invocation.binding, invocation.chain, invocation.phase
        if binding != bound:
            return Decision(Outcome.DENY, Reason.BINDING_MISMATCH, _INTEGRITY, None, None, None, now.monotonic_us)
        if number == DEGRADE:
            choice = choose_fallback(invocation, state, self._policy, now)
            link = None if choice is None or choice.index != DEGRADE else choice.link
        else:
            link = chain[number].link if link_admissible(chain[number], state, self._policy, now, phase) else None
        if link is None:
            return Decision(Outcome.FALLBACK, Reason.STATE_VIOLATED, _STATE, None, None, None, now.monotonic_us)
        return Decision(Outcome.ALLOW, Reason.ADMITTED, _PASSED, None, None, link, now.monotonic_us + LINK_VALID_US)

    def take(self, document: bytes, now: Now, released: int = 0) -> Receipt:
        """Accept a signed document if it is trusted; see `InForce.take`.

        `released` is the caller's count of released steps. Requested steps were released too, except one that
        waits for a replacement (`on inadmissible replan`). The new steps of a replacement are unused.
        """
        decided = self._latest + self.consumed(self._latest)
        released = max(released, self._latest + (not self._replaceable))
        receipt = self._in_force.take(document, now, decided=max(decided, 0), released=released, current=self.current)
        if receipt.kind == REPLACEMENT and receipt.accepted:
            self._consumed = {step for step in self._consumed if step < receipt.step}
        return receipt


def may_ask_again(invocation: Invocation, outcome: Outcome, reason: Reason) -> bool:
    """Whether an answer leaves the id unused. A deferred step may be requested again until its deadline, and so may a
    step whose mission says to hold.
    """
    if outcome is Outcome.FALLBACK:
        return invocation.on_inadmissible in _WAITS and reason is not Reason.NO_SLACK
    return outcome is Outcome.DEFER
