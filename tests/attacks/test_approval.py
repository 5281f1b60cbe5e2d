"""Threats to approvals: forged, for another step, role, key, vehicle or flight, replayed, expired, or invented."""

import json
from base64 import b64encode

import pytest
from msgspec.structs import replace

from reference.documents import ASKED, MIN, approval, hand, low, low_mission, presented
from reference.flat_case import ISSUED, S
from reference.forgery import edit, expect, signed
from reference.world import (
    APPROVAL_KEY,
    LOG_KEY,
    MISSION_KEY,
    POLICY_KEY,
    ROOT,
    ROOT_KEY,
    START,
    VEHICLE,
    Run,
    answer_to,
    assert_audited,
    loaded,
    renewed,
    request_for,
)
from rtshcua.model.decision import Decision
from rtshcua.model.flat.situation import Now
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Ending
from rtshcua.wire import cose, names
from rtshcua.wire.keys import ANY, Duty, SigningKey
from virtual.rows import rows

OF = low()


def fresh() -> Loaded:
    return renewed(OF)


def asked(of: Loaded, **changed: object) -> Decision:
    """The decision about the step that needs an approval, at its turn."""
    for step in (0, 1):
        answer_to(of, request_for(of, step=step))
    answer = answer_to(of, request_for(of, step=ASKED, **changed))
    assert isinstance(answer, Decision)
    return answer


def later(us: int) -> Now:
    return Now(START.monotonic_us + us, START.utc_us + us, START.utc_error_us)


def test_step_without_approval_waits_then_is_denied() -> None:
    run = Run(fresh()).until_over()
    assert (0, ASKED, -1, "defer", "approval/awaited") in run.decisions
    assert (0, ASKED, -1, "deny", "approval/timed-out") in run.decisions
    assert "inspect_area" not in run.flown
    assert run.ending is Ending.ABORTED
    assert_audited(run)


def test_approved_step_flies_and_log_proves_it() -> None:
    run = Run(fresh()).until(lambda run: (0, ASKED, -1, "defer", "approval/awaited") in run.decisions)
    assert hand(run, approval(run.loaded, now=run.clock.now())) == "accepted"
    run.until_over()
    assert run.ending is Ending.COMPLETED
    assert "inspect_area" in run.flown
    assert_audited(run)
    (record,) = [each for each in run.records if each["type"] == "decision" and each["context"]["approvals"]]
    assert record["outcome"] == "allow"


def test_approval_before_release_counts() -> None:
    run = Run(fresh())
    assert hand(run, approval(run.loaded)) == "accepted"
    run.until_over()
    assert run.ending is Ending.COMPLETED
    assert (0, ASKED, -1, "defer", "approval/awaited") not in run.decisions
    assert_audited(run)


def test_later_approval_does_not_undo_refusal() -> None:
    of = fresh()
    assert presented(of, approval(of, granted=0)).accepted
    assert presented(of, approval(of)).accepted, "it is taken in, and changes nothing"
    answer = asked(of)
    assert (answer.outcome, answer.reason) == (Outcome.DENY, Reason.APPROVAL_REFUSED)


def test_a_refusal_does_not_expire() -> None:
    of = fresh()
    assert presented(of, approval(of, granted=0, expires_at_us=START.utc_us + S)).accepted
    assert presented(of, approval(of)).accepted
    now = later(2 * S)
    assert asked(of, now=now, released_us=now.monotonic_us).reason is Reason.APPROVAL_REFUSED


def test_flipped_bit_is_refused() -> None:
    of = fresh()
    document = approval(of)
    for at in range(len(document)):
        changed = bytearray(document)
        changed[at] ^= 1 << at % 8
        assert not presented(of, bytes(changed)).accepted
    assert asked(of).reason is Reason.AWAITING_APPROVAL


STRANGER = SigningKey.from_seed(bytes([99]) * 32, duty=Duty.APPROVAL, development=True)


def test_unknown_key_is_refused() -> None:
    assert presented(fresh(), approval(OF, key=STRANGER)).slug == "unknown-key"


@pytest.mark.parametrize("key", [ROOT_KEY, POLICY_KEY, MISSION_KEY, LOG_KEY])
def test_key_of_another_duty_is_refused(key: SigningKey) -> None:
    payload = cose.unverified(approval(OF)).payload
    document = cose.sign1(payload, key=key, duty=key.duty, content_type=names.APPROVAL.content_type)
    assert presented(fresh(), document).slug == "wrong-duty"


def entitled(**fields: object) -> Loaded:
    """The mission in a world where the supervisor's key has another authorisation."""
    rest = [key for key in ROOT.keys if key.duty is not Duty.APPROVAL]
    usual: dict[str, object] = {"roles": ("supervisor",), "sources": ("operator",), "vehicles": (VEHICLE,)}
    root = replace(ROOT, keys=(*rest, APPROVAL_KEY.verification(**(usual | fields))))  # type: ignore[arg-type]
    return renewed(OF, root)


@rows(
    ("fields", "slug"),
    [
        ({"roles": ("operator",)}, "wrong-role"),
        ({"roles": ()}, "wrong-role"),
        ({"sources": ("agent",)}, "wrong-source"),
        ({"sources": ()}, "wrong-source"),
        ({"vehicles": ("quad-08",)}, "wrong-vehicle"),
        ({"vehicles": ()}, "wrong-vehicle"),
        ({"expires_us": START.utc_us}, "key-expired"),
        ({"expires_us": START.utc_us + START.utc_error_us}, "key-expired"),
        ({"expires_us": START.utc_us + START.utc_error_us + 1}, "accepted"),
        ({"roles": (ANY,), "vehicles": (ANY,)}, "accepted"),
    ],
)
def test_unauthorised_key_is_refused(fields: dict[str, object], slug: str) -> None:
    """Most importantly, a key on an agent's host cannot answer in a person's place."""
    of = entitled(**fields)
    assert presented(of, approval(of)).slug == slug


def test_expired_root_is_refused() -> None:
    root = replace(ROOT, expires_at_us=START.utc_us + START.utc_error_us)
    of = renewed(OF, root)
    assert presented(of, approval(of)).slug == "root-expired"


@rows(
    ("changed", "slug"),
    [
        ({"role": "operator"}, "wrong-role"),
        ({"role": "nobody"}, "wrong-role"),
        ({"vehicle": "quad-08"}, "wrong-vehicle"),
        ({"invocation_id": bytes(16)}, "unknown-invocation"),
        ({"binding": bytes(32)}, "binding-mismatch"),
        ({"granted": 2}, "malformed"),
        ({"granted": -1}, "malformed"),
        ({"issued_at_us": START.utc_us + START.utc_error_us + 1}, "issued-in-future"),
        ({"issued_at_us": START.utc_us + START.utc_error_us}, "accepted"),
        ({"expires_at_us": START.utc_us + START.utc_error_us}, "expired"),
        ({"expires_at_us": START.utc_us + START.utc_error_us + 1}, "accepted"),
        ({"expires_at_us": START.utc_us + 60 * MIN + 1}, "too-long-lived"),
        ({"issued_at_us": START.utc_us + 5, "expires_at_us": START.utc_us + 5}, "expired"),
    ],
)
def test_inconsistent_content_is_refused(changed: dict[str, object], slug: str) -> None:
    of = fresh()
    assert presented(of, approval(of, **changed)).slug == slug
    assert (asked(of).outcome is Outcome.ALLOW) == (slug == "accepted")


@pytest.mark.parametrize("step", [0, 1, 3])
def test_approval_of_unconfirmed_step_is_refused(step: int) -> None:
    of = fresh()
    assert presented(of, approval(of, step)).slug == "not-asked"


def test_approval_by_other_role_is_refused() -> None:
    of = entitled(roles=(ANY,))
    for role in ("operator", "harbour master"):
        assert presented(of, approval(of, role=role)).slug == "not-asked"


def test_approval_of_another_step_is_refused() -> None:
    """The id of one step and the binding of another approve neither."""
    of = fresh()
    other = of.bundle.mission.invocations[1]
    assert presented(of, approval(of, binding=other.binding)).slug == "binding-mismatch"
    assert presented(of, approval(of, invocation_id=other.invocation_id)).slug == "binding-mismatch"
    assert asked(of).reason is Reason.AWAITING_APPROVAL


def test_approval_of_earlier_flight_is_refused() -> None:
    """The same mission compiled again has other ids."""
    earlier = approval(OF)
    again = loaded(mission=replace(low_mission(), issued_at_us=ISSUED + S))
    assert presented(again, earlier).slug == "other-mission"


def test_replayed_document_changes_nothing() -> None:
    of = fresh()
    document = approval(of)
    assert presented(of, document).accepted
    assert presented(of, document, later(S)).slug == "already-answered"
    assert presented(of, approval(of, now=later(S)), later(S)).slug == "already-answered"
    assert presented(of, document, later(6 * MIN)).slug == "expired"


def test_new_approval_may_follow_expired_one() -> None:
    of = fresh()
    assert presented(of, approval(of, expires_at_us=START.utc_us + S)).accepted
    now = later(2 * S)
    assert asked(of, now=now, released_us=now.monotonic_us).reason is Reason.AWAITING_APPROVAL, "it has expired"
    assert presented(of, approval(of, now=now), now).accepted
    answer = answer_to(of, request_for(of, step=ASKED, now=now, released_us=now.monotonic_us))
    assert isinstance(answer, Decision)
    assert answer.outcome is Outcome.ALLOW


def test_approval_of_decided_step_is_too_late() -> None:
    of = fresh()
    assert presented(of, approval(of)).accepted
    assert asked(of).outcome is Outcome.ALLOW
    assert presented(of, approval(of, granted=0)).slug == "already-decided"


def test_late_approval_does_not_count() -> None:
    of = fresh()
    released_us = START.monotonic_us
    now = later(31 * S)
    for step in (0, 1):
        answer_to(of, request_for(of, step=step))
    assert presented(of, approval(of, now=now), now).accepted
    answer = answer_to(of, request_for(of, step=ASKED, now=now, released_us=released_us))
    assert isinstance(answer, Decision)
    assert answer.reason is Reason.APPROVAL_TIMED_OUT


def test_time_that_goes_back_is_refused() -> None:
    of = fresh()
    asked(of)
    assert presented(of, approval(of), replace(START, monotonic_us=START.monotonic_us - 1)).slug == "time-went-back"


def awaited() -> Run:
    """A closed run whose approval was recorded and used."""
    run = Run(fresh())
    hand(run, approval(run.loaded, now=run.clock.now()))
    return run.until_over()


def test_log_with_invented_document_fails() -> None:
    """A holder of the log's key invents an approval in the inputs of a decision, or in an effect."""
    run = awaited()
    lines = [*run.lines, run.recorder.close(run.clock.now(), ending=str(run.ending), tlog=None)]
    assert run.events.count("approval") == 1
    at = next(n for n, line in enumerate(lines) if json.loads(line).get("event") == "approval")
    decided = next(
        n for n, line in enumerate(lines)
        if json.loads(line)["type"] == "decision" and json.loads(line)["context"]["approvals"]
    )  # fmt: skip

    def forged(number: int, **fields: object) -> tuple[str, int]:
        changed = [*lines[:number], edit(lines[number], **fields), *lines[number + 1 :]]
        return expect(signed(changed, LOG_KEY), ROOT_KEY.public)

    other = b64encode(approval(run.loaded, key=STRANGER)).decode()
    assert forged(at, event="noticed") == ("decision/approvals", decided), "taken out"
    assert forged(at, detail=other) == ("document/unknown-key", at)
    assert forged(at, detail="approved, honestly") == ("document/base64", at)
    assert forged(at, event="recall") == ("document/other", at)
    assert forged(at, step=1) == ("document/other", at)
    context = json.loads(lines[decided])["context"]
    assert forged(decided, context=context | {"approvals": []}) == ("decision/approvals", decided)
    rule, role, granted, moment, person = context["approvals"][0]
    moved = context | {"approvals": [[rule, role, granted, moment - 1, person]]}
    assert forged(decided, context=moved) == ("decision/approvals", decided)
    first = next(n for n, line in enumerate(lines) if json.loads(line)["type"] == "decision")
    elsewhere = json.loads(lines[first])["context"] | {"approvals": context["approvals"]}
    assert forged(first, context=elsewhere) == ("decision/approvals", first)


def test_flood_of_forged_approvals_is_bounded() -> None:
    run = Run(fresh())
    forged = approval(run.loaded, key=STRANGER)
    for _ in range(40):
        assert hand(run, forged) == "unknown-key"
    assert run.events.count("document-refused") == 2, "40 in 2 s"
    run.until_over()
    assert run.flown[:2] == ["takeoff", "goto"]
    assert_audited(run)
