"""Approvals: a person's signed answer, for one step of one mission, to the `confirm` rules that require an approval.

An approval names the flight by its id, the mission by its digest, and the step by its invocation's id and binding,
so it is valid for no other. The key must have duty `approval`, and the root must allow it to act in person for the
role on this vehicle.
"""

from collections.abc import Collection, Sequence
from typing import NamedTuple

from rtshcua.model.flat.limits import MAX_ANSWERS
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy, Rule, RuleKind
from rtshcua.model.flat.situation import ConfirmAnswer, Now
from rtshcua.model.flat.struct import Flat
from rtshcua.model.step_number import step_words
from rtshcua.wire import names
from rtshcua.wire.bundle import Bundle
from rtshcua.wire.document import (
    DocumentError,
    check_flight,
    check_person,
    check_times,
    check_vehicle,
    open_document,
    sign_document,
)
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.trust import TrustRoot


class ApprovalDocument(Flat, frozen=True):
    """What a person signs: `granted` 1 or 0 for `role`, from `issued_at_us` until `expires_at_us` (UTC)."""

    flight: bytes
    mission: bytes
    invocation_id: bytes
    binding: bytes
    vehicle: str
    role: str
    granted: int
    issued_at_us: int
    expires_at_us: int


class Answered(NamedTuple):
    """A verified answer: its invocation, its role and person (numbers), the moment of receipt `monotonic_us`, and
    `expires_us` in UTC.
    """

    about: Invocation
    role: int
    person: int
    granted: int
    monotonic_us: int
    expires_us: int


def sign_approval(approval: ApprovalDocument, key: SigningKey) -> bytes:
    """The signed document. Raises `WrongDuty` for a key of another duty."""
    return sign_document(names.APPROVAL, approval, key, Duty.APPROVAL)


def open_approval(
    document: bytes,
    *,
    root: TrustRoot,
    vehicle: str,
    flight: bytes,
    bundle: Bundle,
    now: Now,
    missions: Collection[bytes] = (),
    replaced: Sequence[Invocation] = (),
) -> Answered:
    """The verified answer to a step of the mission in force, if the approval is trusted now.

    A refusal may name a step of any of the flight's `missions`, replaced or not. It applies to every step in force
    that requests the same, so that a replacement cannot evade it.

    Raises `DocumentError`: its own slugs are `wrong-vehicle`, `other-flight`, `other-mission`,
    `unknown-invocation`, `binding-mismatch`, `not-asked`; and `EnvelopeError`, `BundleError` and `ArtefactError`.
    """
    said, opened = open_document(document, names.APPROVAL, ApprovalDocument, Duty.APPROVAL, root, now)
    if said.granted not in (0, 1):
        raise DocumentError("malformed", "`granted` must be 0 or 1")
    check_vehicle(said.vehicle, vehicle)
    check_person(opened.key, said.role, vehicle, now)
    check_times(said.issued_at_us, said.expires_at_us, now)
    check_flight(said.flight, flight)
    if said.mission != bundle.mission_digest and (said.granted or said.mission not in missions):
        raise DocumentError("other-mission", "the approval is for a step of a mission that is not in force")
    policy, steps = bundle.policy, bundle.mission.invocations
    meant = steps if said.granted else (*steps, *replaced)
    named = next((each for each in meant if each.invocation_id == said.invocation_id), None)
    # the last step that requests the same, because earlier ones may be decided already
    invocation = named if named in steps else next((each for each in reversed(steps) if _alike(each, named)), None)
    if named is None or invocation is None:
        raise DocumentError("unknown-invocation", "the approval is for a step that is not in the mission in force")
    if named.binding != said.binding:
        raise DocumentError(
            "binding-mismatch", f"the approval is for a different {step_words(named.step)} than the one in force"
        )
    role = policy.roles.index(said.role) if said.role in policy.roles else -1
    if role < 0 or not confirms(policy, invocation, role):
        text = (
            f"no `confirm` rule of the policy requires an approval by role `{said.role[:80]}` for "
            f"{step_words(invocation.step)}"
        )
        raise DocumentError("not-asked", text)
    return Answered(invocation, role, root.person(opened.key), said.granted, now.monotonic_us, said.expires_at_us)


def _alike(a: Invocation, b: Invocation | None) -> bool:
    """Whether two steps request the same: the same skill with the same arguments."""
    return b is not None and (a.skill, a.arguments) == (b.skill, b.arguments)


def confirms(policy: Policy, invocation: Invocation, role: int) -> tuple[int, ...]:
    """The numbers of the `confirm` rules that may require this role's approval of an invocation, ignoring their
    conditions.
    """
    return tuple(
        number
        for number, rule in enumerate(policy.rules)
        if role in (rule.approver, rule.second) and _concerns(rule, invocation)
    )


def _concerns(rule: Rule, invocation: Invocation) -> bool:
    return (
        rule.kind == RuleKind.CONFIRM
        and invocation.skill in (rule.skills or (invocation.skill,))
        and invocation.role in (rule.roles or (invocation.role,))
        and invocation.source in (rule.sources or (invocation.source,))
    )


class Approvals:
    """The verified answers of one flight, for use in decisions.

    A grant is for one invocation, by its id, until it expires. A refusal is permanent and applies to the skill
    with its arguments, in any step of any mission of this flight. The size is bounded: for each person and role
    one grant for each step in force, and one refusal for each step that ever was.
    """

    def __init__(self, policy: Policy) -> None:
        self._policy = policy
        self._answers: dict[_Subject, Answered] = {}

    def add(self, answered: Answered, now: Now) -> None:
        """Add an answer. Raises `DocumentError`, without a change, if it is present already (`already-answered`) or
        the limit is reached (`too-many`).
        """
        key = _subject(answered.about, answered)
        held = self._answers.get(key)
        if held is not None and _counts(held, now):
            raise DocumentError("already-answered", f"{step_words(answered.about.step)} already has this answer")
        if held is None and len(self._answers) == MAX_ANSWERS:
            raise DocumentError("too-many", f"one flight accepts at most {MAX_ANSWERS} answers")
        self._answers[key] = answered

    def keep(self, invocations: tuple[Invocation, ...]) -> None:
        """Set the steps in force. Grants for other steps are dropped; refusals stay."""
        if not self._answers:
            return
        ids = {each.invocation_id for each in invocations}
        self._answers = {
            key: answered
            for key, answered in self._answers.items()
            if not answered.granted or answered.about.invocation_id in ids
        }

    def about(self, invocation: Invocation, now: Now) -> tuple[ConfirmAnswer, ...]:
        """The approvals that `decide` reads: one entry for each valid answer and each rule that it answers."""
        if not self._answers:
            return ()
        return tuple(
            ConfirmAnswer(rule, answered.role, answered.granted, answered.monotonic_us, answered.person)
            for key, answered in self._answers.items()
            if key == _subject(invocation, answered) and _counts(answered, now)
            for rule in confirms(self._policy, invocation, answered.role)
        )


#: the subject of an answer, its role and person, and whether it grants
_Subject = tuple[bytes | tuple[int, tuple[int, ...]], int, int, int]


def _subject(invocation: Invocation, answered: Answered) -> _Subject:
    """The subject of an answer: of a grant one invocation, of a refusal what any invocation requests."""
    about = invocation.invocation_id if answered.granted else (invocation.skill, invocation.arguments)
    return about, answered.role, answered.person, answered.granted


def _counts(answered: Answered, now: Now) -> bool:
    return not answered.granted or now.utc_us + now.utc_error_us < answered.expires_us
