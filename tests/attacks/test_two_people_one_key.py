"""Threat: one person gives both approvals that two people must give.

The attacker is a person whom the root trusts for one role, or for several, and holds their own keys.
"""

import pytest
from msgspec.structs import replace

from reference.documents import ASKED, approval, asked, low_mission, presented
from reference.flat_case import CONFIRM_RULE, POLICY
from reference.world import APPROVAL_KEY, ROOT, VEHICLE, answer_to, loaded, renewed, request_for
from rtshcua.model.flat.policy import Policy
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.wire.keys import ANY, Duty, SigningKey
from rtshcua.wire.trust import RootError, TrustRoot

SUPERVISOR = POLICY.roles.index("supervisor")
OPERATOR = POLICY.roles.index("operator")


def key(number: int) -> SigningKey:
    return SigningKey.from_seed(bytes([number]) * 32, duty=Duty.APPROVAL, development=True)


ADA, ADA_AGAIN, BOB, ADA_AS_OPERATOR = APPROVAL_KEY, key(31), key(32), key(33)
PEOPLE = {ADA: ("ada", "supervisor"), ADA_AGAIN: ("ada", "supervisor"), BOB: ("bob", "supervisor")}
PEOPLE |= {ADA_AS_OPERATOR: ("ada", "operator")}


def trust() -> TrustRoot:
    rest = tuple(each for each in ROOT.keys if each.duty is not Duty.APPROVAL)
    people = tuple(
        each.verification(roles=(role,), sources=("operator",), vehicles=(VEHICLE,), person=person)
        for each, (person, role) in PEOPLE.items()
    )
    return replace(ROOT, keys=(*rest, *people))


def asking(second: int) -> Policy:
    """The policy whose `confirm` requires a supervisor and another person of a role."""
    rules = list(POLICY.rules)
    rules[CONFIRM_RULE] = replace(rules[CONFIRM_RULE], second=second)
    return replace(POLICY, rules=tuple(rules))


TWO = {role: loaded(asking(role), low_mission()) for role in (SUPERVISOR, OPERATOR)}


def flying(second: int) -> Loaded:
    of = renewed(TWO[second], trust())
    for step in range(ASKED):
        answer_to(of, request_for(of, step=step))
    return of


AWAITED = (Outcome.DEFER, Reason.AWAITING_APPROVAL)
ALLOWED = (Outcome.ALLOW, Reason.ADMITTED)


def test_two_people_of_a_role_are_two_people() -> None:
    of = flying(SUPERVISOR)
    assert presented(of, approval(of, key=ADA)).accepted
    assert asked(of) == AWAITED
    assert presented(of, approval(of, key=ADA_AGAIN)).slug == "already-answered"
    assert asked(of) == AWAITED
    assert presented(of, approval(of, key=BOB)).accepted
    assert asked(of) == ALLOWED


def test_person_with_two_roles_approves_once() -> None:
    of = flying(OPERATOR)
    assert presented(of, approval(of, key=ADA)).accepted
    assert presented(of, approval(of, key=ADA_AS_OPERATOR, role="operator")).accepted
    assert asked(of) == AWAITED
    assert presented(of, approval(of, key=BOB)).accepted
    assert asked(of) == ALLOWED


def test_refusal_by_either_person_denies() -> None:
    of = flying(SUPERVISOR)
    assert presented(of, approval(of, key=ADA)).accepted
    assert presented(of, approval(of, key=BOB, granted=0)).accepted
    assert asked(of) == (Outcome.DENY, Reason.APPROVAL_REFUSED)


def test_person_cannot_answer_for_another_role() -> None:
    of = flying(OPERATOR)
    assert presented(of, approval(of, key=BOB, role="operator")).slug == "wrong-role"


@pytest.mark.parametrize(
    "bound",
    [
        {"person": ""},
        {"person": "Ada"},
        {"person": "ad a"},
        {"person": "аda"},
        {"roles": ()},
        {"roles": (ANY,)},
        {"roles": ("supervisor", "operator")},
        {"sources": ("agent", "operator")},
        {"sources": ("agent",)},
        {"sources": ()},
    ],
)
def test_approval_key_needs_a_person_and_one_role(bound: dict[str, object]) -> None:
    usual = {"roles": ("supervisor",), "sources": ("operator",), "vehicles": (VEHICLE,), "person": "ada"} | bound
    root = replace(ROOT, keys=(ROOT.keys[-1], ADA.verification(**usual)))  # type: ignore[arg-type]
    with pytest.raises(RootError) as refused:
        TrustRoot.decode(root.encode())
    assert refused.value.slug == "whose-approval"


@pytest.mark.parametrize("bound", [{"person": "ada"}, {"policies": ("field",)}])
def test_no_other_key_has_a_person_or_policies(bound: dict[str, object]) -> None:
    log = SigningKey.from_seed(bytes([77]) * 32, duty=Duty.LOG, development=True).verification(**bound)  # type: ignore[arg-type]
    with pytest.raises(RootError) as refused:
        TrustRoot.decode(replace(ROOT, keys=(ROOT.keys[-1], log)).encode())
    assert refused.value.slug == "malformed"
