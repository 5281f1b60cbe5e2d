"""Threat: a replacement brings a refused step back.

The attacker controls the runtime and a mission key, signs arbitrary bytes, withholds documents, and replays what a
person signed before.
"""

from base64 import b64encode

import pytest
from msgspec.structs import replace

from reference.documents import ASKED, approval, asked, hand, low, low_mission, presented, replacement
from reference.forgery import edit, expect, read, signed
from reference.world import (
    FLIGHT,
    LOG_KEY,
    MISSION_KEY,
    POLICY_KEY,
    ROOT,
    ROOT_KEY,
    START,
    VEHICLE,
    Run,
    answer_to,
    renewed,
    request_for,
    try_load,
)
from rtshcua.decision.session import InForce
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.audit.audit import audit
from rtshcua.model.decision import Decision
from rtshcua.model.flat.mission import Mission
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.wire import bundle as bundles
from rtshcua.wire import cbor, names
from rtshcua.wire.binding import bind, binding_of
from rtshcua.wire.document import sign_document
from rtshcua.wire.keys import Duty
from rtshcua.wire.replacement import ReplacementDocument

OF = low()


def with_ids(mission: Mission, ids: dict[int, bytes]) -> Mission:
    """A bound mission, its steps under chosen ids and bound anew."""
    steps = [
        replace(each, invocation_id=ids.get(each.step, each.invocation_id), binding=b"") for each in mission.invocations
    ]
    return replace(mission, invocations=tuple(replace(each, binding=binding_of(mission, each)) for each in steps))


def same_again(of: Loaded, kept: int = ASKED, ids: dict[int, bytes] | None = None) -> bytes:
    """A replacement by the very same mission; its ids are those of `ids`, or as an honest compiler makes them."""
    over = of.bundle.mission_digest
    bound = bind(of.bundle.mission, of.bundle.policy_digest, after=cbor.encode([FLIGHT, over, kept]))
    bound = with_ids(bound, ids) if ids else bound
    return sign_document(names.REPLACEMENT, ReplacementDocument(FLIGHT, over, kept, bound), MISSION_KEY, Duty.MISSION)


def old_ids(of: Loaded) -> dict[int, bytes]:
    return {each.step: each.invocation_id for each in of.bundle.mission.invocations}


def flown_to_the_inspection() -> Loaded:
    of = renewed(OF)
    for step in range(ASKED):
        answer_to(of, request_for(of, step=step))
    return of


def test_a_replayed_grant_does_not_undo_a_refusal() -> None:
    """The attack as it was found: same steps, same ids, and a grant that was signed before the refusal."""
    of = flown_to_the_inspection()
    grant = approval(of)
    assert presented(of, approval(of, granted=0)).accepted
    assert asked(of) == (Outcome.DENY, Reason.APPROVAL_REFUSED)
    assert presented(of, same_again(of, ids=old_ids(of))).slug == "id-mismatch"
    presented(of, same_again(of))
    assert presented(of, grant).slug != "accepted"
    assert asked(of) == (Outcome.DENY, Reason.APPROVAL_REFUSED)


@pytest.mark.parametrize("kept", [0, 1, ASKED])
def test_refusal_follows_a_moved_step(kept: int) -> None:
    of = renewed(OF)
    assert presented(of, approval(of, granted=0)).accepted
    first, second, third, last = of.bundle.mission.invocations
    moved = replace(low_mission(), invocations=(first, second, replace(third, step=2), replace(last, step=3)))
    assert presented(of, replacement(of, kept, moved)).accepted
    for step in range(ASKED):
        answer_to(of, request_for(of, step=step))
    assert presented(of, approval(of)).accepted
    assert asked(of) == (Outcome.DENY, Reason.APPROVAL_REFUSED)


@pytest.mark.parametrize("kept", [0, ASKED, ASKED + 1])
def test_replacement_does_not_evade_refusal(kept: int) -> None:
    """A person approved, then refused. A replacement by the same mission must not restore the approval."""
    of = flown_to_the_inspection() if kept else renewed(OF)
    grant, refusal = approval(of), approval(of, granted=0)
    assert presented(of, grant).accepted
    for _ in range(2):
        assert presented(of, replacement(of, kept, of.bundle.mission)).accepted
    assert presented(of, grant).slug == "other-mission", "no yes is for another mission than the one in force"
    said = presented(of, refusal)
    assert (said.slug, said.step, said.granted) == ("accepted", ASKED, 0)
    assert presented(of, approval(of)).slug in ("accepted", "already-answered")
    for step in range(ASKED if kept == 0 else 0):
        answer_to(of, request_for(of, step=step))
    assert asked(of) == (Outcome.DENY, Reason.APPROVAL_REFUSED)


def test_refusal_of_removed_step_is_reported() -> None:
    of = renewed(OF)
    refusal, other = approval(of, granted=0), approval(of, granted=0, binding=bytes(32))
    assert presented(of, replacement(of)).accepted
    assert presented(of, refusal).slug == "unknown-invocation"
    of = renewed(OF)
    assert presented(of, replacement(of, 0, of.bundle.mission)).accepted
    assert presented(of, other).slug == "binding-mismatch"
    assert presented(of, approval(of, granted=0, mission=bytes(32))).slug == "other-mission"


def test_later_step_stays_refused() -> None:
    """It has another index now."""
    of = flown_to_the_inspection()
    assert presented(of, approval(of, granted=0)).accepted
    first, second, third, last = of.bundle.mission.invocations
    hop = replace(second, step=2)
    later = replace(low_mission(), invocations=(first, second, hop, replace(third, step=3), replace(last, step=4)))
    assert presented(of, replacement(of, ASKED, later)).accepted
    answer_to(of, request_for(of, step=2))
    assert presented(of, approval(of, step=3)).accepted
    answer = answer_to(of, request_for(of, step=3))
    assert isinstance(answer, Decision)
    assert (answer.outcome, answer.reason) == (Outcome.DENY, Reason.APPROVAL_REFUSED)


def test_refusal_does_not_apply_to_different_step() -> None:
    """A refusal applies to a skill with its arguments: at another height a new approval is requested."""
    of = flown_to_the_inspection()
    assert presented(of, approval(of, granted=0)).accepted
    first, second, third, last = of.bundle.mission.invocations
    area, height, *rest = third.arguments
    other = replace(third, arguments=(area, height - 1_000, *rest), plan=replace(third.plan, altitude=height - 1_000))
    assert presented(
        of, replacement(of, ASKED, replace(low_mission(), invocations=(first, second, other, last)))
    ).accepted
    assert asked(of) == (Outcome.DEFER, Reason.AWAITING_APPROVAL)
    assert presented(of, approval(of)).accepted
    assert asked(of)[0] is Outcome.ALLOW


def test_bundle_with_chosen_ids_is_refused() -> None:
    policy = OF.bundle.policy
    payload = bundles.policy_payload(policy)
    bound = bind(low_mission(), bundles.policy_digest(payload))
    chosen = with_ids(bound, {ASKED: bytes(16)})
    data = bundles.seal(payload, bundles.mission_payload(chosen), policy_key=POLICY_KEY, mission_key=MISSION_KEY)
    found = try_load(data)
    assert isinstance(found, Refusal)
    assert found.slug == "id-mismatch"


def test_an_id_that_was_seen_before_is_refused() -> None:
    """A flight whose bundle had, against all odds, the id that a replacement's step will have."""
    bound = bind(low_mission(), OF.bundle.policy_digest, after=cbor.encode([FLIGHT, OF.bundle.mission_digest, ASKED]))
    taken = with_ids(OF.bundle.mission, {3: bound.invocations[ASKED].invocation_id})
    bundle = bundles.Bundle(
        OF.bundle.policy, taken, OF.bundle.policy_digest, OF.bundle.mission_digest, OF.bundle.digest,
        OF.bundle.policy_key, OF.bundle.mission_key,
    )  # fmt: skip
    of = InForce(bundle, OF.policy, OF.invocations, ROOT, VEHICLE, FLIGHT, 0)
    document = sign_document(
        names.REPLACEMENT,
        ReplacementDocument(FLIGHT, OF.bundle.mission_digest, ASKED, bound),
        MISSION_KEY,
        Duty.MISSION,
    )
    assert of.take(document, START, decided=0, released=0).slug == "id-seen"


def test_the_audit_finds_a_refusal_undone(monkeypatch: pytest.MonkeyPatch) -> None:
    """A faulty boundary decided and recorded the step without the refusal."""
    run = Run(renewed(OF)).until_flies("goto")
    assert hand(run, approval(run.loaded, granted=0, now=run.clock.now())) == "accepted"
    assert hand(run, same_again(run.loaded)) == "accepted"
    assert hand(run, approval(run.loaded, now=run.clock.now())) == "accepted"
    told = run.loaded.in_force.approvals
    monkeypatch.setattr(
        run.loaded.in_force, "approvals", lambda of, now: tuple(each for each in told(of, now) if each.granted)
    )
    run.until(lambda run: "inspect_area" in run.flown or run.ending is not None)
    assert run.flown[-1] == "inspect_area"
    run.until_over()
    close = run.recorder.close(run.clock.now(), ending=str(run.ending), tlog=None)
    failure = audit([*run.lines, close], ROOT_KEY.public).report.failure
    assert failure is not None
    assert failure.slug == "decision/approvals"


def test_the_audit_computes_ids_again() -> None:
    """Faulty boundaries accepted a bundle and a replacement with chosen ids."""
    run = Run(renewed(OF)).until_flies("goto")
    assert hand(run, same_again(run.loaded)) == "accepted"
    run.until_over()
    lines = [*run.lines, run.recorder.close(run.clock.now(), ending=str(run.ending), tlog=None)]
    payload = bundles.policy_payload(OF.bundle.policy)
    chosen = bundles.mission_payload(with_ids(OF.bundle.mission, {ASKED: bytes(16)}))
    data = bundles.seal(payload, chosen, policy_key=POLICY_KEY, mission_key=MISSION_KEY)
    begun = edit(lines[0], bundle=b64encode(data).decode())
    assert expect(signed([begun, *lines[1:]], LOG_KEY), ROOT_KEY.public) == ("trust/bundle-id-mismatch", 0)
    at = next(number for number, line in enumerate(lines) if read(line).get("event") == "replacement")
    forged = edit(lines[at], detail=b64encode(same_again(OF, ids=old_ids(OF))).decode())
    again = signed([*lines[:at], forged, *lines[at + 1 :]], LOG_KEY)
    assert expect(again, ROOT_KEY.public) == ("document/id-mismatch", at)
