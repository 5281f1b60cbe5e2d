"""The effects of documents within one flight, presented directly: each is accepted, or refused for its reason, and
changes what is in force.
"""

from dataclasses import replace as with_fields
from typing import Any

import pytest
from msgspec.structs import replace

from reference.documents import ASKED, MIN, approval, cancellation, low, recall, replacement, shorter
from reference.flat_case import GOTO, S
from reference.world import APPROVAL_KEY, FLIGHT, MISSION_KEY, ROOT, START, VEHICLE
from rtshcua.decision.session import MOST_AHEAD, InForce
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.situation import Now
from rtshcua.wire import cbor, cose, names
from rtshcua.wire.approval import ApprovalDocument
from rtshcua.wire.binding import bind, binding_of
from rtshcua.wire.document import MAX_DOCUMENT, MAX_WITHOUT_MISSION, DocumentError, sign_document
from rtshcua.wire.keys import Duty
from rtshcua.wire.receipt import Receipt
from rtshcua.wire.replacement import MAX_REPLACEMENTS, ReplacementDocument, sign_replacement
from rtshcua.wire.trust import TrustRoot
from virtual.rows import rows

OF = low()
STEP = OF.bundle.mission.invocations[ASKED]
IN_DOUBT = START.utc_us + START.utc_error_us


def flight(root: TrustRoot = ROOT) -> InForce:
    return InForce(OF.bundle, OF.policy, OF.invocations, root, VEHICLE, FLIGHT, 0)


def entitled(**fields: object) -> TrustRoot:
    """The root, with other rights for the supervisor's key."""
    rest = [key for key in ROOT.keys if key.duty is not Duty.APPROVAL]
    usual: dict[str, Any] = {"roles": ("supervisor",), "sources": ("operator",), "vehicles": (VEHICLE,)}
    return replace(ROOT, keys=(*rest, APPROVAL_KEY.verification(**(usual | fields))))


def take(of: InForce, document: bytes, now: Now = START, decided: int = 0, released: int = 0) -> Receipt:
    return of.take(document, now, decided=decided, released=released)


def later(us: int) -> Now:
    return Now(START.monotonic_us + us, START.utc_us + us, START.utc_error_us)


def as_replacement(mission: Mission, kept: int = 2, supersedes: bytes = OF.bundle.mission_digest) -> Mission:
    """The mission, bound as a replacement."""
    return bind(mission, OF.bundle.policy_digest, after=cbor.encode([FLIGHT, supersedes, kept]))


def forged(mission: Mission, kept: int = 2, supersedes: bytes | None = None, *, bound: bool = True) -> bytes:
    """A correctly signed replacement that an honest compiler would not make."""
    over = OF.bundle.mission_digest if supersedes is None else supersedes
    whole = as_replacement(mission, kept, over) if bound else mission
    return sign_document(names.REPLACEMENT, ReplacementDocument(FLIGHT, over, kept, whole), MISSION_KEY, Duty.MISSION)


def as_content(content_type: str) -> bytes:
    payload = cose.unverified(approval(OF)).payload
    return cose.sign1(payload, key=APPROVAL_KEY, duty=Duty.APPROVAL, content_type=content_type)


#: malformed envelopes
OUTLINES = (
    b"", b"\xd2", b"\xd2\x84", b"\xd2\x84\x00", b"\xd2\x84\x40", b"\xd2\x84\x40\xa1", b"\xd2\x84\x40\xa0",
    b"\xd2\x84\x40\xa0\x40\x40\x00",
)  # fmt: skip


@rows("document", OUTLINES)
def test_bytes_without_the_outline_of_an_envelope_are_malformed(document: bytes) -> None:
    assert take(flight(), document).slug == "malformed"


def test_a_document_that_is_too_large_or_unknown_is_refused() -> None:
    assert take(flight(), bytes(MAX_DOCUMENT + 1)).slug == "too-large"
    assert take(flight(), as_content("application/x")).slug == "unknown-document"
    long = sign_document(
        names.APPROVAL,
        ApprovalDocument(FLIGHT, bytes(32), bytes(16), bytes(32), "v" * MAX_WITHOUT_MISSION, "supervisor", 1, 0, 1),
        APPROVAL_KEY,
        Duty.APPROVAL,
    )
    assert take(flight(), long).slug == "too-large"


def test_documents_are_refused_under_a_possibly_expired_root() -> None:
    of = flight(replace(ROOT, expires_at_us=IN_DOUBT))
    assert {take(of, each).slug for each in (approval(OF), recall(OF), replacement(OF))} == {"root-expired"}


def test_approvals_expire_and_refusals_do_not() -> None:
    of = flight()
    assert of.approvals(STEP, START) == ()
    receipt = take(of, approval(OF))
    assert (receipt.accepted, receipt.text) == (True, f"step {ASKED + 1} is granted by `supervisor`")
    assert take(of, approval(OF)).slug == "already-answered"
    assert take(of, approval(OF, granted=0)).text == f"step {ASKED + 1} is refused by `supervisor`"
    assert {each.granted for each in of.approvals(STEP, START)} == {0, 1}
    assert {each.granted for each in of.approvals(STEP, later(10 * MIN))} == {0}
    assert of.approvals(OF.bundle.mission.invocations[0], START) == ()


def test_an_approval_that_expired_may_be_given_again() -> None:
    of = flight()
    assert take(of, approval(OF)).accepted
    assert take(of, approval(OF, now=later(10 * MIN)), later(10 * MIN)).accepted


@rows(
    ("changed", "slug"),
    [
        ({"granted": 2}, "malformed"),
        ({"vehicle": "quad-08"}, "wrong-vehicle"),
        ({"role": "operator"}, "wrong-role"),
        ({"flight": b""}, "other-flight"),
        ({"flight": bytes([7]) * 16}, "other-flight"),
        ({"mission": b""}, "other-mission"),
        ({"mission": bytes(32)}, "other-mission"),
        ({"invocation_id": bytes(16)}, "unknown-invocation"),
        ({"binding": bytes(32)}, "binding-mismatch"),
        ({"issued_at_us": IN_DOUBT + 1}, "issued-in-future"),
        ({"expires_at_us": IN_DOUBT}, "expired"),
        ({"expires_at_us": START.utc_us + 60 * MIN + 1}, "too-long-lived"),
    ],
)
def test_an_approval_that_does_not_fit_is_refused(changed: dict[str, object], slug: str) -> None:
    of = flight()
    assert take(of, approval(OF, **changed)).slug == slug
    assert of.approvals(STEP, START) == ()


def test_unrequested_approval_is_refused() -> None:
    of = flight(entitled(roles=("*",)))
    assert take(of, approval(OF, step=0)).slug == "not-asked"
    assert take(of, approval(OF, role="harbour master")).slug == "not-asked"


def test_an_approval_of_a_step_that_was_decided_is_refused() -> None:
    assert take(flight(), approval(OF), decided=ASKED + 1).slug == "already-decided"


def test_refusal_applies_to_equal_replacement_step() -> None:
    again = sign_replacement(OF.bundle.mission, over=OF.bundle, flight=FLIGHT, kept=ASKED, key=MISSION_KEY)
    of = flight()
    assert take(of, again).accepted
    assert take(of, approval(OF)).slug == "other-mission"
    receipt = take(of, approval(OF, granted=0), decided=ASKED)
    assert (receipt.accepted, receipt.step, receipt.granted) == (True, ASKED, 0)
    assert {each.granted for each in of.approvals(of.bundle.mission.invocations[ASKED], START)} == {0}
    of = flight()
    assert take(of, replacement(OF)).accepted
    assert take(of, approval(OF, granted=0)).slug == "unknown-invocation"
    assert take(of, approval(OF, granted=0, mission=bytes(32))).slug == "other-mission"


def test_documents_after_a_recall_are_refused() -> None:
    of = flight()
    assert take(of, recall(OF)).accepted
    assert of.recalled
    assert {take(of, each).slug for each in (approval(OF), recall(OF), replacement(OF))} == {"recalled"}


def test_only_recall_is_accepted_after_cancellation() -> None:
    of = flight()
    assert take(of, cancellation(OF)).accepted
    assert (of.cancelled, of.recalled, of.called_off) == (True, False, True)
    papers = (approval(OF), cancellation(OF), replacement(OF))
    assert {take(of, each).slug for each in papers} == {"cancelled"}
    assert take(of, recall(OF)).accepted
    assert take(of, cancellation(OF)).slug == "recalled"


@rows(
    ("changed", "slug"),
    [
        ({"flight": bytes([7]) * 16}, "other-flight"),
        ({"mission": bytes(32)}, "other-mission"),
        ({"issued_at_us": IN_DOUBT + 1}, "issued-in-future"),
        ({"expires_at_us": IN_DOUBT}, "expired"),
        ({"expires_at_us": START.utc_us + 60 * MIN + 1}, "too-long-lived"),
    ],
)
def test_a_cancellation_that_does_not_fit_is_refused(changed: dict[str, object], slug: str) -> None:
    of = flight()
    assert take(of, cancellation(OF, **changed)).slug == slug
    assert not of.called_off


def test_a_recall_of_all_under_the_policy_is_accepted() -> None:
    assert take(flight(), recall(OF, flight=b"", mission=b"", policy=OF.bundle.policy_digest)).accepted


@rows(
    ("changed", "slug"),
    [
        ({"mission": b""}, "malformed"),
        ({"policy": OF.bundle.policy_digest}, "malformed"),
        ({"vehicle": "quad-08"}, "wrong-vehicle"),
        ({"flight": bytes([7]) * 16}, "other-flight"),
        ({"mission": bytes(32)}, "other-mission"),
        ({"flight": b"", "mission": b"", "policy": bytes(32)}, "other-policy"),
        (
            {
                "flight": b"",
                "mission": b"",
                "policy": OF.bundle.policy_digest,
                "issued_at_us": OF.bundle.mission.issued_at_us - 1,
            },
            "before-mission",
        ),
    ],
)
def test_a_recall_that_does_not_fit_is_refused(changed: dict[str, object], slug: str) -> None:
    of = flight()
    assert take(of, recall(OF, **changed)).slug == slug
    assert not of.recalled


@pytest.mark.parametrize(
    ("fields", "slug"), [({"sources": ("agent",)}, "wrong-source"), ({"vehicles": ("quad-08",)}, "wrong-vehicle")]
)
def test_a_recall_by_a_key_that_may_not_speak_in_person_is_refused(fields: dict[str, object], slug: str) -> None:
    assert take(flight(entitled(**fields)), recall(OF)).slug == slug


def test_replacement_steps_are_in_force_without_old_answers() -> None:
    of = flight()
    assert take(of, approval(OF)).accepted
    receipt = take(of, replacement(OF))
    assert (receipt.accepted, receipt.text) == (True, "the mission has 3 steps now, new from step 3")
    assert len(of.invocations) == 3
    assert of.bundle.mission.invocations[:2] == OF.bundle.mission.invocations[:2]
    assert of.approvals(STEP, START) == ()
    assert take(of, recall(OF)).accepted, "by the mission that was opened"


def test_replacement_steps_are_received_with_document() -> None:
    of = InForce(OF.bundle, OF.policy, OF.invocations, ROOT, VEHICLE, FLIGHT, 7)
    assert [of.received_us(step) for step in range(len(of.invocations))] == [7] * len(of.invocations)
    kept = take(of, replacement(OF), later(5)).step
    received = [of.received_us(step) for step in range(len(of.invocations))]
    assert received == [7] * kept + [START.monotonic_us + 5] * (len(of.invocations) - kept)
    assert len(received) > kept > 0


def test_replacement_verified_ahead_is_accepted_as_any_other() -> None:
    of, plain = flight(), flight()
    of.consider(approval(OF), START)
    of.consider(replacement(OF), START)
    assert take(of, replacement(OF)) == take(plain, replacement(OF))
    assert of.bundle == plain.bundle
    of.consider(b"junk", START)
    assert take(of, b"junk").slug == "malformed"


def test_refusal_found_ahead_is_reported_at_presentation() -> None:
    of = flight()
    document = forged(replace(shorter(OF), vehicle="quad-08"))
    of.consider(document, START)
    assert take(of, document).slug == "wrong-vehicle"


def test_replacement_verified_ahead_is_refused_after_expiry() -> None:
    now = later(S)
    of = flight(replace(ROOT, expires_at_us=now.utc_us))
    of.consider(replacement(OF), START)
    assert take(of, replacement(OF), now).slug == "root-expired"
    keys = tuple(replace(key, expires_us=now.utc_us) if key.duty is Duty.MISSION else key for key in ROOT.keys)
    of = flight(replace(ROOT, keys=keys))
    of.consider(replacement(OF), START)
    assert take(of, replacement(OF), now).slug == "key-expired"


def test_replacement_of_inactive_mission_is_not_compared_ahead() -> None:
    of = flight()
    document = replacement(OF)
    take(of, document)
    assert of.consider(document, START) is None
    assert take(of, document).slug == "superseded"


def test_only_last_replacements_verified_ahead_are_kept() -> None:
    of = flight()
    documents = [replacement(OF, mission=replace(shorter(OF), issued_at_us=n)) for n in range(MOST_AHEAD + 1)]
    for document in documents:
        of.consider(document, START)
    assert list(of._ahead) == documents[1:]


STAYS, LAST = shorter(OF).invocations[1:]


@rows(
    ("document", "slug"),
    [
        (forged(shorter(OF), supersedes=bytes(32)), "superseded"),
        (forged(shorter(OF), kept=-1), "already-released"),
        (forged(shorter(OF), kept=4), "other-steps"),
        (forged(replace(shorter(OF), phases=("departure", "party", "recovery"))), "other-steps"),
        (
            forged(
                replace(shorter(OF), invocations=(shorter(OF).invocations[0], replace(STAYS, on_inadmissible=2), LAST))
            ),
            "other-steps",
        ),
        (forged(replace(shorter(OF), issued_at_us=IN_DOUBT + 1)), "issued-in-future"),
        (forged(replace(shorter(OF), invocations=()), kept=0), "no-step"),
        (forged(replace(shorter(OF), invocations=shorter(OF).invocations[:2] * 2)), "malformed"),
    ],
)
def test_a_replacement_that_does_not_fit_is_refused(document: bytes, slug: str) -> None:
    of = flight()
    assert take(of, document).slug == slug
    assert of.bundle is OF.bundle


def test_a_replacement_of_a_released_step_is_refused() -> None:
    assert take(flight(), replacement(OF), released=3).slug == "already-released"


def test_new_step_with_a_kept_id_is_refused() -> None:
    bound = bind(shorter(OF), OF.bundle.policy_digest, after=b"")
    first, second, last = bound.invocations
    twin = replace(last, invocation_id=OF.bundle.mission.invocations[0].invocation_id)
    twin = replace(twin, binding=binding_of(bound, twin))
    document = forged(replace(bound, invocations=(first, second, twin)), bound=False)
    assert take(flight(), document).slug == "id-mismatch"


def test_a_replacement_that_brings_back_an_id_seen_before_is_refused() -> None:
    """Ids cannot be chosen; here the last step of this flight has the id that a new step will have."""
    first, second = shorter(OF), replace(shorter(OF), issued_at_us=shorter(OF).issued_at_us + 1)
    plain = flight()
    assert take(plain, forged(first)).accepted
    replaced = plain.bundle.mission_digest
    *steps, last = OF.bundle.mission.invocations

    def with_last(id_: bytes) -> InForce:
        mission = replace(OF.bundle.mission, invocations=(*steps, replace(last, invocation_id=id_)))
        return InForce(with_fields(OF.bundle, mission=mission), OF.policy, OF.invocations, ROOT, VEHICLE, FLIGHT, 0)

    of = with_last(as_replacement(first).invocations[2].invocation_id)
    before = of.bundle
    assert take(of, forged(first)).slug == "id-seen", "while that step is in force"
    assert of.bundle is before
    of = with_last(as_replacement(second, supersedes=replaced).invocations[2].invocation_id)
    assert take(of, forged(first)).accepted
    assert take(of, forged(second, supersedes=replaced)).slug == "id-seen", "after that step was replaced"
    assert take(plain, forged(second, supersedes=replaced)).accepted, "where no step had it"


def test_a_replacement_whose_kept_steps_differ_is_not_signed() -> None:
    first, second, last = shorter(OF).invocations
    mission = replace(shorter(OF), invocations=(first, replace(second, skill=GOTO + 1), last))
    with pytest.raises(DocumentError, match="should be kept but differs"):
        sign_replacement(mission, over=OF.bundle, flight=FLIGHT, kept=2, key=MISSION_KEY)


@pytest.mark.unmeasured
def test_replacement_limit_of_a_flight() -> None:
    of = flight()
    for number in range(MAX_REPLACEMENTS):
        mission = replace(shorter(OF), issued_at_us=OF.bundle.mission.issued_at_us + number)
        assert take(of, sign_replacement(mission, over=of.bundle, flight=FLIGHT, kept=2, key=MISSION_KEY)).accepted
    last = sign_replacement(shorter(OF), over=of.bundle, flight=FLIGHT, kept=2, key=MISSION_KEY)
    assert take(of, last).slug == "too-many"


def test_replacement_limit_can_be_small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rtshcua.decision.session.MAX_REPLACEMENTS", 0)
    receipt = take(flight(), sign_replacement(shorter(OF), over=OF.bundle, flight=FLIGHT, kept=2, key=MISSION_KEY))
    assert (receipt.slug, receipt.text) == ("too-many", "one flight accepts at most 0 replacements")
