"""What is in force in one flight, and what signed documents change of it (design 4.3, 4.4): on board, and in an audit.

Whatever is wrong with a document, it changes nothing. An approval is what later decisions are told of; a recall ends
the mission; a replacement puts its steps in the place of those that were not released.
"""

from typing import Final, NamedTuple

from rtshcua.decision.prepare import prepare_mission
from rtshcua.decision.prepared import PreparedInvocation, PreparedPolicy
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.situation import Approval, Now
from rtshcua.wire import names
from rtshcua.wire.approval import Approvals, open_approval
from rtshcua.wire.bundle import Bundle
from rtshcua.wire.document import DocumentError, check_key, check_root, kind_of
from rtshcua.wire.recall import open_recall
from rtshcua.wire.receipt import ACCEPTED, APPROVAL, RECALL, REPLACEMENT, UNKNOWN, Receipt
from rtshcua.wire.replacement import MAX_REPLACEMENTS, Replacement, fit_replacement, open_replacement
from rtshcua.wire.trust import TrustRoot
from rtshcua.wire.untrusted import Untrusted

#: how many documents may be considered ahead of being taken
MOST_AHEAD: Final = 8

_KINDS: Final = {names.APPROVAL: APPROVAL, names.RECALL: RECALL, names.REPLACEMENT: REPLACEMENT}


class _Ahead(NamedTuple):
    """What was found ahead of a document: the replacement in it, prepared, or why it is not to be trusted."""

    found: Replacement | Untrusted
    prepared: tuple[PreparedInvocation, ...]


class InForce:
    """The verified bundle and its invocations; after a replacement, with those of the mission that flies now.

    `recalled` says that no step may begin any more.
    """

    def __init__(
        self,
        bundle: Bundle,
        policy: PreparedPolicy,
        invocations: tuple[PreparedInvocation, ...],
        root: TrustRoot,
        vehicle: str,
    ) -> None:
        self.bundle = bundle
        self.invocations = invocations
        self.recalled = False
        self._policy = policy
        self._root = root
        self._vehicle = vehicle
        self._approvals = Approvals(policy.policy)
        #: the last replacements that were considered, by their bytes
        self._ahead: dict[bytes, _Ahead] = {}
        self._issued_at_us = bundle.mission.issued_at_us
        #: of the mission that was opened, and of all that replaced it since
        self._digests: tuple[bytes, ...] = (bundle.mission_digest,)

    def approvals(self, invocation: Invocation, now: Now) -> tuple[Approval, ...]:
        """The verified answers that a decision on an invocation is told of."""
        return self._approvals.about(invocation, now)

    def consider(self, document: bytes, now: Now) -> None:
        """Verify and prepare a replacement ahead, in whatever thread, so that `take` need not: that takes a while.

        Nothing comes of it but time: it rests on the document, the policy and the root, which stay as they are, and
        `take` asks again whether these have expired.
        """
        try:
            if kind_of(document) is not names.REPLACEMENT:
                return
            found = self._opened(document, now)
            ahead = _Ahead(found, self._prepared(found.mission))
        except Untrusted as error:
            ahead = _Ahead(error, ())
        self._ahead[document] = ahead
        for old in list(self._ahead)[:-MOST_AHEAD]:
            self._ahead.pop(old, None)

    def take(self, document: bytes, now: Now, *, decided: int, released: int) -> Receipt:
        """Take a document in. The first `decided` steps are decided for good, the first `released` were released."""
        kind = UNKNOWN
        try:
            kind = _KINDS[kind_of(document)]
            if self.recalled:
                raise DocumentError("recalled", "the mission was recalled")
            if kind == APPROVAL:
                return self._approval(document, now, decided)
            if kind == RECALL:
                return self._recall(document, now)
            return self._replacement(document, now, released)
        except Untrusted as error:
            return Receipt(kind, error.slug, str(error))

    def _approval(self, document: bytes, now: Now, decided: int) -> Receipt:
        policy, mission = self.bundle.policy, self.bundle.mission
        answered = open_approval(
            document, root=self._root, vehicle=self._vehicle, policy=policy, mission=mission, now=now
        )
        step = answered.step
        if step < decided:
            raise DocumentError("already-decided", f"step {step} was decided before")
        if not self._approvals.add(answered, now):
            raise DocumentError("already-answered", f"step {step} has this answer already")
        what = "granted" if answered.granted else "refused"
        text = f"step {step} is {what} by `{policy.roles[answered.role]}`"
        return Receipt(APPROVAL, ACCEPTED, text, step, answered.role, answered.granted, answered.expires_us)

    def _recall(self, document: bytes, now: Now) -> Receipt:
        open_recall(
            document,
            root=self._root,
            vehicle=self._vehicle,
            missions=self._digests,
            policy=self.bundle.policy_digest,
            issued_at_us=self._issued_at_us,
            now=now,
        )
        self.recalled = True
        return Receipt(RECALL, ACCEPTED, "the mission is recalled")

    def _replacement(self, document: bytes, now: Now, released: int) -> Receipt:
        if len(self._digests) > MAX_REPLACEMENTS:
            raise DocumentError("too-many", f"one flight takes at most {MAX_REPLACEMENTS} replacements")
        ahead = self._ahead.pop(document, None)
        if ahead is None:
            found = self._opened(document, now)
        elif isinstance(ahead.found, Untrusted):
            raise ahead.found
        else:
            check_root(self._root, now)
            for key in (self.bundle.policy_key, ahead.found.key):
                check_key(key, self._vehicle, now)
            found = ahead.found
        after = fit_replacement(found, self.bundle, released)
        prepared = self._prepared(found.mission) if ahead is None else ahead.prepared
        self.bundle = after
        self.invocations = (*self.invocations[: found.kept], *prepared[found.kept :])
        self._digests = (*self._digests, found.digest)
        self._approvals.forget(found.kept)
        steps = len(prepared)
        return Receipt(REPLACEMENT, ACCEPTED, f"the mission has {steps} steps now, new from {found.kept}", found.kept)

    def _opened(self, document: bytes, now: Now) -> Replacement:
        return open_replacement(document, root=self._root, vehicle=self._vehicle, bundle=self.bundle, now=now)

    def _prepared(self, mission: Mission) -> tuple[PreparedInvocation, ...]:
        prepared = prepare_mission(mission, self._policy)
        if isinstance(prepared, Refusal):
            raise DocumentError("malformed", f"the mission does not make sense: {prepared.text}")
        return prepared
