"""Threats to replacements: forged, of a released step, under another policy, of an inactive mission, replayed."""

import json
from base64 import b64encode

import pytest
from msgspec.structs import replace

from reference.documents import ASKED, approval, hand, low, presented, replacement, shorter
from reference.flat_case import GOTO, INSPECTION, ISSUED, MISSION, OPERATOR, POLICY, SUPERVISOR, M, S, invocation
from reference.forgery import edit, expect, signed
from reference.world import (
    APPROVAL_KEY,
    FLIGHT,
    LOG_KEY,
    MISSION_KEY,
    POLICY_KEY,
    ROOT,
    ROOT_KEY,
    START,
    Run,
    allowed,
    answer_to,
    assert_audited,
    loaded,
    renewed,
    request_for,
)
from rtshcua.model.decision import Decision
from rtshcua.model.flat.contract import MotionKind, SourceKind
from rtshcua.model.flat.mission import Mission, Plan
from rtshcua.model.flat.situation import Now
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Ending
from rtshcua.wire import cbor, cose, names
from rtshcua.wire.binding import bind, binding_of
from rtshcua.wire.document import DocumentError, sign_document
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.replacement import MAX_REPLACEMENTS, ReplacementDocument, sign_replacement
from rtshcua.wire.response import Status
from virtual.rows import rows

OF = low()
STRANGER = SigningKey.from_seed(bytes([98]) * 32, duty=Duty.MISSION, development=True)


def fresh() -> Loaded:
    return renewed(OF)


def forged(
    of: Loaded, mission: Mission, kept: int = 2, supersedes: bytes | None = None, *, bound: bool = True
) -> bytes:
    """A correctly signed document that an honest compiler would not make."""
    over = of.bundle.mission_digest if supersedes is None else supersedes
    whole = bind(mission, of.bundle.policy_digest, after=cbor.encode([FLIGHT, over, kept])) if bound else mission
    return sign_document(names.REPLACEMENT, ReplacementDocument(FLIGHT, over, kept, whole), MISSION_KEY, Duty.MISSION)


def test_replacement_changes_unreleased_steps() -> None:
    run = Run(fresh()).until_flies("goto")
    assert hand(run, replacement(run.loaded)) == "accepted"
    run.until_over()
    assert run.ending is Ending.COMPLETED
    assert run.flown == ["takeoff", "goto", "return_home"]
    assert_audited(run)


def test_a_mission_may_grow_and_be_replaced_again() -> None:
    run = Run(fresh()).until_flies("takeoff")
    mission = run.loaded.bundle.mission
    first, second, third, last = mission.invocations
    detour = invocation(3, INSPECTION, GOTO, Plan(MotionKind.FLY, (0, 0), 8 * M, 0), 0, 0, 8 * M)
    longer = replace(mission, invocations=(first, second, third, detour, replace(last, step=4)))
    assert hand(run, replacement(run.loaded, 3, longer)) == "accepted"
    shortest = replace(longer, invocations=(first, second, replace(last, step=2)))
    assert hand(run, replacement(run.loaded, 2, shortest)) == "accepted"
    assert hand(run, replacement(run.loaded, 2, longer)) == "accepted"
    assert hand(run, approval(run.loaded, now=run.clock.now())) == "accepted"
    run.until_over()
    assert run.flown == ["takeoff", "goto", "inspect_area", "goto", "return_home"]
    assert run.ending is Ending.COMPLETED
    assert_audited(run)


def test_every_step_may_be_replaced_before_ready() -> None:
    run = Run(fresh(), ready=False)
    mission = MISSION
    assert hand(run, replacement(run.loaded, 0, mission)) == "accepted"
    assert run.loaded.bundle.mission.invocations[1].arguments == mission.invocations[1].arguments


def test_kept_steps_stay_as_first_signed() -> None:
    """The bytes that are in force for a step that stays are the old ones, id and binding included."""
    of = fresh()
    before = of.bundle.mission.invocations
    assert presented(of, replacement(of)).accepted
    assert of.bundle.mission.invocations[:2] == before[:2]
    assert of.bundle.mission.invocations[2].invocation_id not in {each.invocation_id for each in before}
    permit = allowed(of)
    assert permit


def test_flipped_byte_is_refused() -> None:
    of = fresh()
    document = replacement(of)
    for at in range(0, len(document), 7):
        changed = bytearray(document)
        changed[at] ^= 1 << at % 8
        assert not presented(of, bytes(changed)).accepted
    assert of.bundle is OF.bundle


def test_unknown_key_is_refused() -> None:
    assert presented(fresh(), replacement(OF, key=STRANGER)).slug == "unknown-key"


@pytest.mark.parametrize("key", [POLICY_KEY, APPROVAL_KEY, LOG_KEY, ROOT_KEY])
def test_key_of_another_duty_is_refused(key: SigningKey) -> None:
    payload = cose.unverified(replacement(OF)).payload
    document = cose.sign1(payload, key=key, duty=key.duty, content_type=names.REPLACEMENT.content_type)
    assert presented(fresh(), document).slug == "wrong-duty"


@pytest.mark.parametrize("fields", [{"role": SUPERVISOR}, {"source": SourceKind.ONBOARD}, {"role": 99}, {"source": 9}])
def test_replacement_by_unauthorised_key_is_refused(fields: dict[str, int]) -> None:
    first, second, last = shorter(OF).invocations
    mission = replace(shorter(OF), invocations=(first, second, replace(last, **fields)))
    assert presented(fresh(), forged(OF, mission)).slug in ("wrong-role", "wrong-source", "malformed")


@pytest.mark.parametrize("released", [1, 2])
def test_a_step_that_was_decided_is_not_replaced(released: int) -> None:
    of = fresh()
    for step in range(released):
        allowed(of, step=step)
    assert presented(of, replacement(of, kept=released - 1)).slug == "already-released"
    assert presented(of, replacement(of, kept=released)).accepted


def test_waiting_step_counts_as_released() -> None:
    run = Run(fresh()).until(lambda run: (0, ASKED, -1, "defer", "approval/awaited") in run.decisions)
    assert hand(run, replacement(run.loaded, kept=2)) == "already-released"


def test_step_released_by_runtime_is_not_replaced() -> None:
    of = fresh()
    assert presented(of, replacement(of, kept=2), released=3).slug == "already-released"


def test_replacement_under_another_policy_is_refused() -> None:
    laxer = loaded(replace(POLICY, version=8), replace(OF.bundle.mission, policy_version=8))
    document = forged(laxer, shorter(laxer), supersedes=OF.bundle.mission_digest)
    assert presented(fresh(), document).slug == "wrong-policy"
    renamed = replace(shorter(OF), policy="another")
    assert presented(fresh(), forged(OF, renamed)).slug == "wrong-policy"


def test_replacement_for_another_vehicle_is_refused() -> None:
    assert presented(fresh(), forged(OF, replace(shorter(OF), vehicle="quad-08"))).slug == "wrong-vehicle"


def test_replacement_of_inactive_mission_is_refused() -> None:
    of = fresh()
    assert presented(of, forged(of, shorter(of), supersedes=bytes(32))).slug == "superseded"
    again = loaded(mission=replace(OF.bundle.mission, issued_at_us=ISSUED + S))
    assert presented(again, replacement(OF)).slug == "superseded", "that of an earlier flight"


def test_replayed_document_changes_nothing() -> None:
    of = fresh()
    first = replacement(of)
    assert presented(of, first).accepted
    assert presented(of, first).slug == "superseded"
    back = replacement(of, 2, OF.bundle.mission)
    assert presented(of, back).accepted, "the agent may change its mind: a new signature says so"
    assert presented(of, first).slug == "superseded"


def test_bundle_and_replacement_are_not_interchangeable() -> None:
    payload = cose.unverified(replacement(OF)).payload
    as_mission = cose.sign1(payload, key=MISSION_KEY, duty=Duty.MISSION, content_type=names.MISSION.content_type)
    assert presented(fresh(), as_mission).slug == "unknown-document"


def test_replacement_issued_in_future_is_refused() -> None:
    late = START.utc_us + START.utc_error_us
    assert presented(fresh(), forged(OF, replace(shorter(OF), issued_at_us=late + 1))).slug == "issued-in-future"
    assert presented(fresh(), forged(OF, replace(shorter(OF), issued_at_us=late))).accepted


def test_replacement_with_wrong_binding_is_refused() -> None:
    assert presented(fresh(), forged(OF, shorter(OF), bound=False)).slug in ("wrong-policy", "binding-mismatch")
    bound = bind(shorter(OF), OF.bundle.policy_digest)
    first, second, last = bound.invocations
    weaker = replace(bound, invocations=(first, second, replace(last, role=OPERATOR, text="something else")))
    assert presented(fresh(), forged(OF, weaker, bound=False)).slug == "binding-mismatch"


STAYS = shorter(OF).invocations[1]


@rows(
    "changed",
    [
        replace(STAYS, arguments=(0, 0, 8 * M), plan=replace(STAYS.plan, path=(0, 0))),
        replace(STAYS, plan=replace(STAYS.plan, altitude=9 * M)),
        replace(STAYS, contract=replace(STAYS.contract, require=())),
        replace(STAYS, contract=replace(STAYS.contract, fallback=STAYS.contract.fallback[1:])),
        replace(STAYS, contract=replace(STAYS.contract, deadline_us=1)),
        replace(STAYS, on_inadmissible=2),
        replace(STAYS, phases=0b011),
        replace(STAYS, source=SourceKind.OPERATOR),
        replace(STAYS, text="what a person reads of it"),
    ],
)
def test_kept_steps_cannot_be_changed(changed: object) -> None:
    first, _, last = shorter(OF).invocations
    mission = replace(shorter(OF), invocations=(first, changed, last))
    of = fresh()
    assert presented(of, forged(of, mission)).slug == "other-steps"
    with pytest.raises(DocumentError, match="should be kept but differs"):
        sign_replacement(mission, over=of.bundle, flight=FLIGHT, kept=2, key=MISSION_KEY)


def test_kept_steps_may_have_other_source_positions() -> None:
    first, second, last = shorter(OF).invocations
    clauses = tuple(replace(each, source=3, start=7, end=9) for each in second.contract.require)
    moved = replace(second, file=5, start=100, end=200, contract=replace(second.contract, require=clauses))
    assert presented(fresh(), forged(OF, replace(shorter(OF), invocations=(first, moved, last)))).accepted


@rows(
    ("mission", "kept", "slug"),
    [
        (shorter(OF), -1, "already-released"),
        (shorter(OF), 4, "other-steps"),
        (shorter(OF), 5, "other-steps"),
        (replace(shorter(OF), invocations=()), 0, "no-step"),
        (replace(shorter(OF), phases=("departure", "party", "recovery")), 2, "other-steps"),
        (replace(shorter(OF), invocations=shorter(OF).invocations[:2] * 2), 2, "malformed"),
    ],
)
def test_replacement_with_wrong_numbers_or_names_is_refused(mission: Mission, kept: int, slug: str) -> None:
    of = fresh()
    assert presented(of, forged(of, mission, kept)).slug == slug
    allowed(of)


def test_new_step_with_id_of_kept_step_is_refused() -> None:
    of = fresh()
    bound = bind(shorter(of), of.bundle.policy_digest, after=b"")
    first, second, last = bound.invocations
    twin = replace(last, invocation_id=of.bundle.mission.invocations[0].invocation_id)
    twin = replace(twin, binding=binding_of(bound, twin))
    assert (
        presented(of, forged(of, replace(bound, invocations=(first, second, twin)), bound=False)).slug == "id-mismatch"
    )


def test_approval_does_not_apply_to_replaced_step() -> None:
    of = fresh()
    assert presented(of, approval(of)).accepted
    mission = of.bundle.mission
    first, second, third, last = mission.invocations
    slower = replace(third, arguments=(*third.arguments[:3], 2 * M), plan=replace(third.plan, speed=2 * M))
    old = approval(of)
    assert presented(of, replacement(of, 2, replace(mission, invocations=(first, second, slower, last)))).accepted
    assert presented(of, old).slug == "other-mission"
    for step in (0, 1):
        allowed(of, step=step)
    answer = answer_to(of, request_for(of, step=ASKED))
    assert isinstance(answer, Decision)
    assert (answer.outcome, answer.reason) == (Outcome.DEFER, Reason.AWAITING_APPROVAL)
    assert presented(of, approval(of)).accepted


def test_kept_step_stays_approved() -> None:
    of = fresh()
    assert presented(of, approval(of)).accepted
    mission = of.bundle.mission
    assert presented(of, replacement(of, 3, replace(mission, issued_at_us=ISSUED + 1))).accepted
    for step in (0, 1, ASKED):
        allowed(of, step=step)


def test_binding_of_replaced_step_is_refused() -> None:
    of = fresh()
    old = request_for(of, step=2)
    assert presented(of, replacement(of)).accepted
    for step in (0, 1):
        allowed(of, step=step)
    answer = answer_to(of, old)
    assert isinstance(answer, Decision)
    assert (answer.outcome, answer.reason) == (Outcome.DENY, Reason.BINDING_MISMATCH)
    assert answer_to(of, request_for(of, step=3)) is Status.UNKNOWN_STEP


def test_denied_step_with_used_id_may_be_replaced() -> None:
    of = fresh()
    allowed(of)
    late = request_for(of, step=1, phase=2)
    denied = answer_to(of, late)
    assert isinstance(denied, Decision)
    assert (denied.outcome, denied.reason) == (Outcome.DENY, Reason.PHASE_PASSED)
    mission = of.bundle.mission
    assert presented(of, replacement(of, 1, replace(mission, issued_at_us=ISSUED + 1))).accepted
    allowed(of, step=1)


def test_replacements_of_one_flight_are_limited() -> None:
    of = fresh()
    for number in range(MAX_REPLACEMENTS):
        assert presented(of, replacement(of, 2, replace(shorter(OF), issued_at_us=ISSUED + number))).accepted
    assert presented(of, replacement(of, 2, shorter(OF))).slug == "too-many"


def test_replacement_verified_ahead_is_accepted_alike() -> None:
    """Early verification only changes the time needed."""
    of = fresh()
    document, other = replacement(of), replacement(of, 1)
    of.boundary.consider(document, START)
    of.boundary.consider(b"\xd2nonsense", START)
    of.boundary.consider(approval(of), START)
    allowed(of)
    allowed(of, step=1)
    assert of.bundle is OF.bundle
    assert presented(of, other).slug == "already-released"
    assert presented(of, document[:-1] + bytes([document[-1] ^ 1])).slug == "bad-signature"
    assert presented(of, document).accepted
    assert presented(of, document).slug == "superseded"
    senseless = replace(shorter(OF), invocations=shorter(OF).invocations[:2] * 2)
    for document, slug in (
        (forged(OF, senseless), "malformed"),
        (replacement(OF, key=STRANGER), "unknown-key"),
        (approval(OF), "accepted"),
        (b"garbage", "malformed"),
    ):
        of = fresh()
        of.boundary.consider(document, START)
        assert presented(of, document).slug == slug


def test_few_are_kept_ahead() -> None:
    of = fresh()
    papers = [replacement(of, 2, replace(shorter(of), issued_at_us=ISSUED + number)) for number in range(20)]
    for paper in papers:
        of.boundary.consider(paper, START)
    assert presented(of, papers[0]).accepted, "looked at again"


@pytest.mark.parametrize(
    ("keys", "root", "slug"), [(START.utc_us + S, 0, "key-expired"), (None, START.utc_us + S, "root-expired")]
)
def test_replacement_verified_ahead_can_expire(keys: int | None, root: int, slug: str) -> None:
    keyring = tuple(replace(key, expires_us=keys) if key.duty is Duty.MISSION else key for key in ROOT.keys)
    trusted = replace(ROOT, keys=keyring, expires_at_us=root or ROOT.expires_at_us)
    of = renewed(OF, trusted)
    document = replacement(of)
    of.boundary.consider(document, START)
    later = Now(START.monotonic_us + 2 * S, START.utc_us + 2 * S, START.utc_error_us)
    assert presented(of, document, later).slug == slug
    assert presented(of, document).slug == "time-went-back"


@rows(
    "document",
    [
        b"",
        b"\xd2",
        b"\xd2\x84",
        b"\xd2\x84" + bytes(1000),
        b"\xd2\x84\x40\xa0",
        b"\xd2\x84\x40\xa1\x40\x40",
        b"\xd2\x84\x40\xa0\x40\x5f",
        b"\xd2\x84\x40\xa0\x40\x60",
        b"\xd2\x84\x40\xa0\x5a\x7f\xff\xff\xff\x40",
        b"\xd2\x84\x40\xa0\x40\x40\x00",
        b"\xd2\x84\x40\xa0\x40\x40",
    ],
)
def test_garbage_is_refused_without_decoding(document: bytes) -> None:
    assert presented(fresh(), document).slug == "malformed"


def test_a_document_that_is_too_large_is_not_read() -> None:
    assert presented(fresh(), b"\xd2" + bytes(1 << 20)).slug == "too-large"
    small = {"duty": Duty.APPROVAL, "content_type": names.APPROVAL.content_type}
    large = cose.sign1(bytes(1 << 12), key=APPROVAL_KEY, **small)
    assert presented(fresh(), large).slug == "too-large", "only a mission has a reason to be"


def test_log_with_invented_document_fails() -> None:
    run = Run(fresh()).until_flies("goto")
    hand(run, replacement(run.loaded))
    run.until_over()
    lines = [*run.lines, run.recorder.close(run.clock.now(), ending=str(run.ending), tlog=None)]
    at = next(n for n, line in enumerate(lines) if json.loads(line).get("event") == "replacement")

    def changed(**fields: object) -> tuple[str, int]:
        return expect(signed([*lines[:at], edit(lines[at], **fields), *lines[at + 1 :]], LOG_KEY), ROOT_KEY.public)

    assert changed(event="nothing")[0] == "decision/invocation"
    assert changed(detail=b64encode(replacement(OF, key=STRANGER)).decode()) == ("document/unknown-key", at)
    assert changed(detail=b64encode(replacement(OF, kept=1)).decode()) == ("document/already-released", at)
    assert changed(step=1) == ("document/other", at)
