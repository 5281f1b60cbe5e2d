"""Approvals: a person's signed answer to the `confirm` rules that ask for one, about one step of one mission.

It names the flight by its id, the mission by its digest, and the step by its invocation's id and binding, so it means
nothing for any other. The key must have duty `approval`, and the root must let it speak for the role in person on this
vehicle.
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
    """A verified answer: about which invocation, by which role and person (numbers), `monotonic_us` when it came,
    `expires_us` UTC.
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
    """What a signed approval answers, if it is to be trusted here and now, about a step of the mission in force.

    A refusal may be about a step of any of the flight's `missions`, `replaced` or not: it is of what that asked for, so
    nobody outruns it by replacing. It counts for a step in force that asks for the same.

    Raises `DocumentError`: its own slugs are `wrong-vehicle`, `other-flight`, `other-mission`, `unknown-invocation`,
    `binding-mismatch`, `not-asked`; and `EnvelopeError`, `BundleError` and `ArtefactError`.
    """
    said, opened = open_document(document, names.APPROVAL, ApprovalDocument, Duty.APPROVAL, root, now)
    if said.granted not in (0, 1):
        raise DocumentError("malformed", "it neither grants nor refuses")
    check_vehicle(said.vehicle, vehicle)
    check_person(opened.key, said.role, vehicle, now)
    check_times(said.issued_at_us, said.expires_at_us, now)
    check_flight(said.flight, flight)
    if said.mission != bundle.mission_digest and (said.granted or said.mission not in missions):
        raise DocumentError("other-mission", "it is about a step of another mission than the one in force")
    policy, steps = bundle.policy, bundle.mission.invocations
    meant = steps if said.granted else (*steps, *replaced)
    named = next((each for each in meant if each.invocation_id == said.invocation_id), None)
    # the last one that asks for the same: those before it may be decided
    invocation = named if named in steps else next((each for each in reversed(steps) if _alike(each, named)), None)
    if named is None or invocation is None:
        raise DocumentError("unknown-invocation", "it is about no step of the mission in force")
    if named.binding != said.binding:
        raise DocumentError(
            "binding-mismatch", f"it was made for another {step_words(named.step)} than the one in force"
        )
    role = policy.roles.index(said.role) if said.role in policy.roles else -1
    if role < 0 or not confirms(policy, invocation, role):
        text = f"no `confirm` of the policy asks role `{said.role[:80]}` about {step_words(invocation.step)}"
        raise DocumentError("not-asked", text)
    return Answered(invocation, role, root.person(opened.key), said.granted, now.monotonic_us, said.expires_at_us)


def _alike(a: Invocation, b: Invocation | None) -> bool:
    """Whether two steps ask for the same: the skill with its arguments."""
    return b is not None and (a.skill, a.arguments) == (b.skill, b.arguments)


def confirms(policy: Policy, invocation: Invocation, role: int) -> tuple[int, ...]:
    """The numbers of the `confirm` rules that may ask this role about an invocation, whatever their conditions say."""
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
    """The verified answers of one flight, and what a decision is told of them.

    A grant is for one invocation, by its id, until it expires. A refusal is for good, and for what it refused: the
    skill with its arguments, in whatever step of whatever mission of this flight they stand. What is kept is bounded:
    of each person in each role one grant for each step in force, and one refusal for each step that ever was.
    """

    def __init__(self, policy: Policy) -> None:
        self._policy = policy
        self._answers: dict[_Subject, Answered] = {}

    def add(self, answered: Answered, now: Now) -> None:
        """Take an answer in. Raises `DocumentError`, and changes nothing, for one that is there already
        (`already-answered`), and where as many are kept as fit (`too-many`).
        """
        key = _subject(answered.about, answered)
        held = self._answers.get(key)
        if held is not None and _counts(held, now):
            raise DocumentError("already-answered", f"{step_words(answered.about.step)} has this answer already")
        if held is None and len(self._answers) == MAX_ANSWERS:
            raise DocumentError("too-many", f"one flight accepts at most {MAX_ANSWERS} answers")
        self._answers[key] = answered

    def keep(self, invocations: tuple[Invocation, ...]) -> None:
        """These are the steps now. Grants of others are dropped; refusals stay."""
        if not self._answers:
            return
        ids = {each.invocation_id for each in invocations}
        self._answers = {
            key: answered
            for key, answered in self._answers.items()
            if not answered.granted or answered.about.invocation_id in ids
        }

    def about(self, invocation: Invocation, now: Now) -> tuple[ConfirmAnswer, ...]:
        """What `decide` reads of them: one entry for each answer that counts and each rule that it answers."""
        if not self._answers:
            return ()
        return tuple(
            ConfirmAnswer(rule, answered.role, answered.granted, answered.monotonic_us, answered.person)
            for key, answered in self._answers.items()
            if key == _subject(invocation, answered) and _counts(answered, now)
            for rule in confirms(self._policy, invocation, answered.role)
        )


#: what an answer is about, by which role and person it is, and whether it grants
_Subject = tuple[bytes | tuple[int, tuple[int, ...]], int, int, int]


def _subject(invocation: Invocation, answered: Answered) -> _Subject:
    """A grant is about one invocation, a refusal about what any invocation asks for."""
    about = invocation.invocation_id if answered.granted else (invocation.skill, invocation.arguments)
    return about, answered.role, answered.person, answered.granted


def _counts(answered: Answered, now: Now) -> bool:
    return not answered.granted or now.utc_us + now.utc_error_us < answered.expires_us
