"""Threats to cancellations: an agent's cancellation of its own mission must lead to the policy's contingency only,
must not end a mission of a person, and must not apply to another flight.
"""

import json

import pytest
from msgspec.structs import replace

from reference.documents import MIN, approval, cancellation, hand, low, low_mission, presented, recall, replacement
from reference.flat_case import MISSION, POLICY
from reference.forgery import edit, expect, signed
from reference.world import (
    APPROVAL_KEY,
    FLIGHT,
    LOG_KEY,
    MISSION_KEY,
    POLICY_KEY,
    ROOT,
    ROOT_KEY,
    SESSION_KEY,
    START,
    VEHICLE,
    Run,
    allowed,
    answer_to,
    assert_audited,
    loaded,
    renewed,
    request_for,
)
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.mission import Mission
from rtshcua.onboard.enforcement.executor import MISSION_OVER
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.onboard.ports import Command, Ending, LinkBack, LinkLost
from rtshcua.wire import binding, bundle, cose, names
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.response import Status

OF = low()
SEED = b"\xa9" * 32
AGENT = SigningKey.from_seed(SEED, duty=Duty.MISSION, development=True)
#: the same secret for another duty
AS_APPROVER = SigningKey.from_seed(SEED, duty=Duty.APPROVAL, development=True)
STRANGER = SigningKey.from_seed(bytes([99]) * 32, duty=Duty.MISSION, development=True)


def fresh() -> Loaded:
    return renewed(OF)


def with_agent(mission: Mission, **rights: object) -> Loaded:
    """A mission signed by the key of both sources, in a world that knows the agent's key too."""
    usual: dict[str, object] = {
        "roles": ("operator",), "sources": ("agent",), "vehicles": (VEHICLE,), "policies": (POLICY.name,),
    }  # fmt: skip
    root = replace(ROOT, keys=(*ROOT.keys, AGENT.verification(**(usual | rights))))  # type: ignore[arg-type]
    payload = bundle.policy_payload(POLICY)
    bound = binding.bind(mission, bundle.policy_digest(payload))
    data = bundle.seal(payload, bundle.mission_payload(bound), policy_key=POLICY_KEY, mission_key=MISSION_KEY)
    found = load(
        data, root=root, vehicle=VEHICLE, now=START, mode=EnforcementMode.SOFTWARE, session_key=SESSION_KEY,
        flight=FLIGHT,
        peer_is_own_simulator=True,
    )  # fmt: skip
    assert isinstance(found, Loaded), found
    return found


def ordered(first: int) -> Mission:
    """The mission, whose steps from `first` on are a person's."""
    steps = (replace(each, source=SourceKind.OPERATOR) for each in MISSION.invocations[first:])
    return replace(MISSION, invocations=(*MISSION.invocations[:first], *steps))


@pytest.mark.parametrize("skill", ["takeoff", "goto"])
def test_contingency_flies_after_cancellation_in_the_air(skill: str) -> None:
    run = Run(fresh()).until_flies(skill)
    run.tick()
    if skill == "takeoff":
        run.until_flies("goto")
    assert hand(run, cancellation(run.loaded, now=run.clock.now())) == "accepted"
    run.until_over()
    assert run.ending is Ending.CANCELLED
    kinds = [record["kind"] for record in run.records if record.get("event") == "dispatched"]
    assert kinds == [0, 0, 2, 2], run.flown
    assert_audited(run)


def test_cancellation_on_ground_uses_up_bundle() -> None:
    run = Run(fresh(), ready=False)
    assert hand(run, cancellation(run.loaded)) == "accepted"
    assert run.ending is Ending.CANCELLED
    assert run.flown == []
    assert run.runtime.used_up


def test_return_under_way_continues() -> None:
    run = Run(loaded()).until_flies("return_home")
    assert hand(run, cancellation(run.loaded, now=run.clock.now())) == "accepted"
    run.until_over()
    assert run.flown.count("return_home") == 1
    assert run.ending is Ending.CANCELLED


def test_flying_chain_continues_after_cancellation() -> None:
    run = Run(fresh()).until_flies("goto")
    run.vehicle.fails.add("goto")
    run.until_flies("hover")
    assert hand(run, cancellation(run.loaded, now=run.clock.now())) == "falling-back"
    run.until_over()
    assert run.ending is Ending.ABORTED


def test_document_waits_while_link_is_lost() -> None:
    run = Run(fresh()).until_flies("goto")
    run.tick(LinkLost(0))
    assert hand(run, cancellation(run.loaded, now=run.clock.now())) == "accepted"
    run.tick(LinkBack(0))
    run.until_over()
    assert run.ending is Ending.CANCELLED


def test_recall_after_cancellation_is_accepted() -> None:
    run = Run(fresh()).until_flies("goto")
    assert hand(run, cancellation(run.loaded, now=run.clock.now())) == "accepted"
    assert hand(run, recall(run.loaded, now=run.clock.now())) == "accepted"
    run.until_over()
    assert run.ending is Ending.RECALLED
    assert_audited(run)


def test_no_step_is_decided_or_sent_afterwards() -> None:
    """This includes a compromised runtime that ignores the document."""
    of = fresh()
    permit = allowed(of)
    assert presented(of, cancellation(of)).accepted
    assert of.executor.dispatch(permit, START.monotonic_us) is MISSION_OVER
    assert answer_to(of, request_for(of, step=1)) is Status.NOT_CURRENT
    home = allowed(of, 2, -1, 1)
    assert isinstance(of.executor.dispatch(home, START.monotonic_us), Command)
    assert [presented(of, each).slug for each in (approval(of), replacement(of))] == ["cancelled"] * 2


def test_flipped_bit_is_refused() -> None:
    of = fresh()
    document = cancellation(of)
    for at in range(len(document)):
        changed = bytearray(document)
        changed[at] ^= 1 << at % 8
        assert not presented(of, bytes(changed)).accepted
    allowed(of)


def test_keys_of_other_duties_are_refused() -> None:
    payload = cose.unverified(cancellation(OF)).payload
    kind = names.CANCELLATION.content_type
    for key, slug in ((APPROVAL_KEY, "wrong-duty"), (LOG_KEY, "wrong-duty"), (AS_APPROVER, "unknown-key")):
        document = cose.sign1(payload, key=key, duty=key.duty, content_type=kind)
        assert presented(fresh(), document).slug == slug
    assert presented(fresh(), cancellation(OF, STRANGER)).slug == "unknown-key"


@pytest.mark.parametrize("kind", [names.RECALL, names.REPLACEMENT])
def test_document_is_refused_as_another_kind(kind: names.Artefact) -> None:
    payload = cose.unverified(cancellation(OF)).payload
    disguised = cose.sign1(payload, key=MISSION_KEY, duty=Duty.MISSION, content_type=kind.content_type)
    assert presented(fresh(), disguised).slug in ("unknown-format", "wrong-duty")


def test_agent_can_only_cancel_missions_of_agents() -> None:
    for mission, slug in ((MISSION, "accepted"), (ordered(0), "wrong-source"), (ordered(3), "wrong-source")):
        of = with_agent(mission)
        assert presented(of, cancellation(of, AGENT)).slug == slug
        assert of.in_force.called_off is (slug == "accepted")
        of = with_agent(mission)
        assert presented(of, cancellation(of, MISSION_KEY)).accepted, "who may speak in person sets any step aside"


@pytest.mark.parametrize(
    ("rights", "slug"),
    [
        ({"roles": ("supervisor",)}, "wrong-role"),
        ({"policies": ("another",)}, "key-other-policy"),
        ({"vehicles": ("quad-08",)}, "wrong-vehicle"),
        ({"expires_us": START.utc_us}, "key-expired"),
    ],
)
def test_key_that_may_not_propose_cannot_cancel(rights: dict[str, object], slug: str) -> None:
    of = with_agent(MISSION, **rights)
    assert presented(of, cancellation(of, AGENT)).slug == slug
    assert not of.in_force.called_off


def test_cancellation_of_other_flight_or_mission_is_refused() -> None:
    of = fresh()
    assert presented(of, cancellation(OF, flight=bytes([7]) * 16)).slug == "other-flight"
    assert presented(of, cancellation(OF, mission=bytes(32))).slug == "other-mission"
    late = replace(START, utc_us=START.utc_us + MIN, monotonic_us=START.monotonic_us + MIN)
    assert presented(of, cancellation(OF), late).slug == "expired"
    assert not of.in_force.called_off


def test_cancellation_reaches_replacement_with_authorised_key() -> None:
    """Canceller and replacer need not agree on the order."""
    of = with_agent(low_mission())
    first = cancellation(of, AGENT)
    assert presented(of, replacement(of)).accepted
    assert presented(of, first).accepted


def cancelled() -> list[bytes]:
    run = Run(fresh()).until_flies("goto")
    hand(run, cancellation(run.loaded, now=run.clock.now()))
    run.until_over()
    return [*run.lines, run.recorder.close(run.clock.now(), ending=str(run.ending), tlog=None)]


def test_log_with_step_sent_afterwards_fails() -> None:
    lines = cancelled()
    records = [json.loads(line) for line in lines]
    begun = next(n for n, each in enumerate(records) if each.get("event") == "dispatched" and each["kind"] == 2)
    forged = [*lines[:begun], edit(lines[begun], kind=0, step=1, link=-1), *lines[begun + 1 :]]
    assert expect(signed(forged, LOG_KEY), ROOT_KEY.public) == ("dispatch/cancelled", begun)


def test_log_with_step_decided_afterwards_fails() -> None:
    run = Run(fresh()).until_flies("goto")
    lines = [*run.lines]
    early = Run(renewed(OF), ready=False)
    hand(early, cancellation(OF))
    paper = next(line for line in early.lines if json.loads(line).get("event") == "cancellation")
    first = next(n for n, line in enumerate(lines) if json.loads(line)["type"] == "decision")
    record = json.loads(lines[first])
    slipped = edit(paper, at_us=record["at_us"], utc_us=record["utc_us"])
    close = run.recorder.close(run.clock.now(), ending="completed", tlog=None)
    forged = signed([*lines[:first], slipped, *lines[first:], close], LOG_KEY)
    assert expect(forged, ROOT_KEY.public) == ("decision/cancelled", first + 1)
