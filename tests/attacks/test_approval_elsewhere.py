"""Threat: a document that was signed for one flight is used in another flight with an identical step.

The attacker keeps every document that was ever signed, holds a mission key, and begins the next flight.
"""

from collections.abc import Callable
from dataclasses import replace as with_fields

import pytest
from msgspec.structs import replace

from reference.documents import ASKED, approval, hand, low, low_mission, presented, recall, replacement
from reference.forgery import edit
from reference.world import (
    FLIGHT,
    ROOT,
    ROOT_KEY,
    SESSION_KEY,
    START,
    VEHICLE,
    Run,
    answer_to,
    assert_audited,
    renewed,
    request_for,
    sealed,
)
from rtshcua.decision.session import InForce
from rtshcua.ground.audit.audit import audit
from rtshcua.model.decision import Decision
from rtshcua.model.outcome import Outcome
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load, session

OF = low()
OTHER = bytes([7]) * 16


def in_another_flight(of: Loaded = OF) -> Loaded:
    """The same bundle on a vehicle that lost its state of the first flight."""
    in_force = InForce(of.bundle, of.policy, of.invocations, ROOT, VEHICLE, OTHER, 0)
    return session(in_force, of.mode, bytes(32))


def another_mission() -> Loaded:
    """A mission with a step of the approved id and binding, but with another end."""
    bundle = with_fields(OF.bundle, mission_digest=bytes(32))
    in_force = InForce(bundle, OF.policy, OF.invocations, ROOT, VEHICLE, FLIGHT, 0)
    return session(in_force, OF.mode, bytes(32))


@pytest.mark.parametrize("document", [approval, recall, replacement])
def test_document_is_valid_for_one_flight(document: Callable[[Loaded], bytes]) -> None:
    signed = document(renewed(OF))
    assert presented(in_another_flight(), signed).slug == "other-flight"
    assert presented(renewed(OF), signed).accepted


@pytest.mark.parametrize(
    ("document", "slug"), [(approval, "other-mission"), (recall, "other-mission"), (replacement, "superseded")]
)
def test_document_is_valid_for_one_mission(document: Callable[[Loaded], bytes], slug: str) -> None:
    assert presented(another_mission(), document(renewed(OF))).slug == slug


def test_an_approval_names_the_mission_that_is_in_force() -> None:
    """An approval of a kept step that was signed before the replacement must be repeated; one that was accepted stays
    valid.
    """
    of = renewed(OF)
    before = approval(of)
    first, second, third, last = of.bundle.mission.invocations
    longer = replace(low_mission(), invocations=(first, second, third, replace(second, step=3), replace(last, step=4)))
    assert presented(of, replacement(of, 3, longer)).accepted
    assert presented(of, before).slug == "other-mission"
    taken = renewed(OF)
    assert presented(taken, before).accepted
    assert presented(taken, replacement(taken, 3, longer)).accepted
    for step in range(ASKED):
        answer_to(taken, request_for(taken, step=step))
    answer = answer_to(taken, request_for(taken, step=ASKED))
    assert isinstance(answer, Decision)
    assert answer.outcome is Outcome.ALLOW


@pytest.mark.parametrize("changed", [{"flight": OTHER}, {"flight": b""}, {"mission": bytes(32)}, {"mission": b""}])
def test_approval_without_subject_is_refused(changed: dict[str, bytes]) -> None:
    of = renewed(OF)
    assert presented(of, approval(of, **changed)).slug in ("other-flight", "other-mission")


@pytest.mark.parametrize("changed", [{"flight": b""}, {"policy": bytes(32)}, {"mission": b""}])
def test_recall_of_mission_requires_flight(changed: dict[str, bytes]) -> None:
    of = renewed(OF)
    assert presented(of, recall(of, **changed)).slug == "malformed"


def test_a_recall_for_a_policy_is_for_all_its_flights() -> None:
    of = in_another_flight()
    assert presented(of, recall(renewed(OF), flight=b"", mission=b"", policy=OF.bundle.policy_digest)).accepted


def test_a_flight_is_named_by_16_octets() -> None:
    with pytest.raises(ValueError, match="16 bytes"):
        load(
            sealed(), root=ROOT, vehicle=VEHICLE, now=START, mode=EnforcementMode.SOFTWARE, session_key=SESSION_KEY,
            flight=b"short", peer_is_own_simulator=False,
        )  # fmt: skip


def test_the_audit_knows_the_flight_by_its_genesis() -> None:
    run = Run(renewed(OF)).until_flies("goto")
    assert hand(run, approval(run.loaded, now=run.clock.now())) == "accepted"
    run.until_over()
    assert_audited(run)
    first, *rest = run.lines
    moved = [edit(first, boot=OTHER.hex()), *rest]
    assert audit(moved, ROOT_KEY.public).report.failure is not None
