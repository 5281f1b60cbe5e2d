"""Both boundaries with full tables: they answer the same, and refuse what no longer fits."""

import ctypes

import pytest
from msgspec.structs import replace

from boundary.both_boundaries import Shadow
from reference import flat_case as flat
from reference.documents import approval, presented
from reference.world import (
    FLIGHT,
    ROOT,
    ROOT_KEY,
    SESSION_KEY,
    START,
    VEHICLE,
    allowed,
    answer_to,
    request_for,
    sealed,
)
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.decision import Decision
from rtshcua.model.flat.limits import MAX_ANSWERS, MAX_DISPATCHED
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy, RuleKind
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.enforcement.executor import NOT_COVERED
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded
from rtshcua.onboard.ports import Command
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.permit import LINK_VALID_US, Permit, seal
from rtshcua.wire.request import CONTINGENCY_LINK

CROWD_SIZE, STEPS = 64, 33  # who answer twice about each step, which exceeds the limit
PEOPLE = [
    SigningKey.from_seed(number.to_bytes(32, "big"), duty=Duty.APPROVAL, development=True)
    for number in range(1_000, 1_000 + CROWD_SIZE)
]
NAMED = [
    key.verification(roles=("supervisor",), sources=("operator",), vehicles=(VEHICLE,), person=f"person-{number}")
    for number, key in enumerate(PEOPLE)
]
CROWD = replace(ROOT, keys=(*ROOT.keys, *NAMED))
ASKS = flat.rule(RuleKind.CONFIRM, flat.TAKEOFF, approver=flat.SUPERVISOR, within_us=30 * flat.S)


@pytest.fixture
def shadow(boundary: ctypes.CDLL) -> Shadow:
    made = Shadow(boundary)
    made.know(CROWD, CROWD.sign(ROOT_KEY), ROOT_KEY.verification().public)
    return made


def both(shadow: Shadow, policy: Policy = flat.POLICY, mission: Mission = flat.MISSION) -> Loaded:
    loaded = shadow.load(
        sealed(policy, mission), root=CROWD, vehicle=VEHICLE, now=START, mode=EnforcementMode.SOFTWARE,
        session_key=SESSION_KEY,
        flight=FLIGHT, peer_is_own_simulator=True,
    )  # fmt: skip
    assert isinstance(loaded, Loaded), loaded
    return loaded


@pytest.mark.soak
def test_greatest_number_of_answers(shadow: Shadow) -> None:
    """People may answer more than the limit: stored answers stay, and the next one is refused."""
    first, *_, last = flat.MISSION.invocations
    steps = [
        replace(first, step=number, invocation_id=bytes([number]) * 16, arguments=(first.arguments[0] + number,))
        for number in range(STEPS)
    ]
    steps = [replace(each, plan=replace(each.plan, altitude=each.arguments[0])) for each in steps]
    mission = replace(flat.MISSION, invocations=(*steps, replace(last, step=len(steps))))
    of = both(shadow, replace(flat.POLICY, rules=(*flat.POLICY.rules, ASKS)), mission)
    answers = ((step, key, granted) for granted in (1, 0) for step in range(STEPS) for key in PEOPLE)
    slugs = []
    for step, key, granted in answers:
        slugs.append(presented(of, approval(of, step, key, granted=granted)).slug)
        if len(slugs) > MAX_ANSWERS:
            break
    assert slugs == ["accepted"] * (len(slugs) - 1) + ["too-many"]
    assert len(slugs) == MAX_ANSWERS + 1
    assert presented(of, approval(of, 1, PEOPLE[0])).slug == "already-answered"


@pytest.mark.slow
@pytest.mark.parametrize("granted", [1, 0])
def test_more_confirm_rules_than_kept_answers(granted: int, shadow: Shadow) -> None:
    """One answer applies to each of the rules, and the second person's as the first one's."""
    asks = tuple(replace(ASKS, text=f"asks {number}") for number in range(MAX_ANSWERS + 1))
    of = both(shadow, replace(flat.POLICY, rules=(*flat.POLICY.rules, *asks)))
    for key, answer in ((PEOPLE[0], 1), (PEOPLE[1], granted)):
        assert presented(of, approval(of, 0, key, granted=answer)).slug == "accepted"
    answer_ = answer_to(of, request_for(of))
    assert isinstance(answer_, Decision)
    expected = (Outcome.ALLOW, Reason.ADMITTED) if granted else (Outcome.DENY, Reason.APPROVAL_REFUSED)
    assert (answer_.outcome, answer_.reason) == expected


@pytest.mark.soak
def test_greatest_number_of_dispatched_permits(shadow: Shadow) -> None:
    of = both(shadow)
    at_us = START.monotonic_us
    used = allowed(of, CONTINGENCY_LINK, -1, 0)
    assert isinstance(of.executor.dispatch(used, at_us), Command)
    for serial in range(2, MAX_DISPATCHED + 1):
        permit = seal(Permit(CONTINGENCY_LINK, -1, 0, serial, 0, 0, at_us + LINK_VALID_US), SESSION_KEY)
        assert isinstance(of.executor.dispatch(permit, at_us), Command)
    permit = seal(Permit(CONTINGENCY_LINK, -1, 0, MAX_DISPATCHED + 1, 0, 0, at_us + LINK_VALID_US), SESSION_KEY)
    assert of.executor.dispatch(permit, at_us) is NOT_COVERED
    again = of.executor.dispatch(used, at_us)
    assert isinstance(again, Refusal)
    assert again.slug == "permit/used"
