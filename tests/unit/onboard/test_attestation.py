"""The boundary's statements of its own evidence; all of its parts keep one chain."""

from hashlib import sha256

import pytest
from pymavlink.dialects.v20 import ardupilotmega as m

from reference.documents import approval, low, presented
from reference.world import SESSION_KEY, START, allowed, loaded, read_answer, request_for, sealed, try_load
from rtshcua.codec.frames import Codec
from rtshcua.model.decision import Decision
from rtshcua.onboard.enforcement.executor import SESSION_OVER
from rtshcua.onboard.enforcement.frames import NOT_COVERED, FrameSession
from rtshcua.onboard.enforcement.frames import SESSION_OVER as GATE_OVER
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import BoundaryKey, Command
from rtshcua.wire import boundary_chain, preparation, response
from rtshcua.wire.boundary_chain import Tag, following
from rtshcua.wire.clock import ClockSource
from rtshcua.wire.preparation import Preparation
from rtshcua.wire.receipt import decode
from rtshcua.wire.statement import Statement, open_statement
from virtual import case

HEARTBEAT = m.MAVLink_heartbeat_message(2, 12, 81, 0, 4, 3)
KEY = BoundaryKey(case.BOUNDARY_KEY, 7, b"k" * 32)
KEYS = {case.BOUNDARY_KEY.kid: case.BOUNDARY_KEY.verification()}
NOW_US = START.monotonic_us


def said(of: Loaded, *, final: bool = False) -> Statement:
    signed = of.attestation.statement(START, final=final)
    assert signed is not None
    return open_statement(signed, KEYS)


def test_entries_without_a_key_are_chained_but_unsigned() -> None:
    of = loaded()
    of.attestation.begin(None)
    assert of.attestation.statement(START) is None
    before = of.attestation.digest
    allowed(of)
    assert of.attestation.digest != before


def test_a_session_has_one_beginning_and_one_end() -> None:
    of = try_load(sealed())
    assert isinstance(of, Loaded)
    assert of.attestation.statement(START) is None
    before = of.attestation.digest
    of.attestation.begin(KEY)
    with pytest.raises(RuntimeError, match="begun already"):
        of.attestation.begin(KEY)
    bundle, flight = sha256(sealed()).digest(), of.in_force.flight
    payload = boundary_chain.begin(7, b"k" * 32, flight, bundle, enforced=True)
    first = said(of)
    assert (first.session, first.before, first.digest) == (7, b"k" * 32, following(before, Tag.BEGIN, payload))
    assert not first.final
    assert (first.source, first.now) == (ClockSource.SHARED, START)
    assert said(of, final=True).final
    assert of.attestation.statement(START) is None


def test_an_answer_carries_the_digest_with_itself_in_it() -> None:
    of = loaded()
    before, asked = of.attestation.digest, request_for(of)
    octets = of.boundary.enforce(asked)
    answer = read_answer(of, asked, octets)
    assert isinstance(answer, Decision)
    payload = boundary_chain.decided(asked, answer.outcome, 0, answer.step, -1, answer.valid_until_us, 0)
    assert octets[-32:] == of.attestation.digest == following(before, Tag.DECIDED, payload)


def test_a_request_that_is_refused_is_chained_by_its_digest() -> None:
    of = loaded()
    before = of.attestation.digest
    octets = of.boundary.enforce(b"hostile")
    payload = boundary_chain.undecided(response.Status.MALFORMED, sha256(b"hostile").digest())
    assert octets[-32:] == of.attestation.digest == following(before, Tag.UNDECIDED, payload)


def test_an_answer_that_repeats_the_one_before_is_counted() -> None:
    of = low()
    of.attestation.begin(KEY)
    allowed(of)
    allowed(of, 0, 1)
    asked = request_for(of, 0, 2)
    digests = {octets[-32:] for octets in (of.boundary.enforce(asked) for _ in range(3))}
    assert (len(digests), said(of).repeated) == (1, 2)


def test_documents_are_chained_or_counted() -> None:
    of = low()
    of.attestation.begin(KEY)
    before, document = of.attestation.digest, approval(of)
    forged = document[:-1] + bytes([document[-1] ^ 1])
    assert presented(of, forged).evidence == before
    receipt = presented(of, document)
    payload = boundary_chain.document(receipt.kind, receipt.step, START, sha256(document).digest())
    assert receipt.evidence == of.attestation.digest == following(before, Tag.DOCUMENT, payload)
    assert said(of).declined == 1
    assert decode(of.boundary.present(b"x", START, 0)) != receipt


def test_permits_are_chained_as_they_are_used() -> None:
    of = loaded()
    permit, before = allowed(of), of.attestation.digest
    sent = of.executor.dispatch(permit, NOW_US)
    assert isinstance(sent, Command)
    digest = following(before, Tag.SENT, boundary_chain.sent(0, 0, -1, sent.token, NOW_US))
    assert of.attestation.digest == digest
    of.executor.dispatch(permit, NOW_US)
    digest = following(digest, Tag.REFUSED, boundary_chain.refused("permit/used", NOW_US))
    assert of.attestation.digest == digest
    link = of.executor.stand_in(permit, 1, 0, NOW_US)
    assert isinstance(link, Command)
    digest = following(digest, Tag.SENT, boundary_chain.sent(1, 0, 0, link.token, NOW_US))
    assert of.attestation.digest == digest
    of.executor.stand_in(b"", 1, 0, NOW_US)
    assert of.attestation.digest == following(digest, Tag.REFUSED, boundary_chain.refused("permit/forged", NOW_US))


def test_a_preparation_that_is_refused_is_chained() -> None:
    of = loaded()
    before = of.attestation.digest
    sealed_ = preparation.seal(Preparation(1, False, NOW_US, ()), SESSION_KEY)
    for permit, slug in ((b"", "permit/forged"), (sealed_, "permit/not-down")):
        of.executor.prepare(permit, NOW_US)
        before = following(before, Tag.UNPREPARED, boundary_chain.unprepared(slug))
        assert of.attestation.digest == before


def test_another_gate_counts_in_the_same_chain() -> None:
    of = loaded()
    of.attestation.begin(KEY)
    of.executor.frames.seal(b"no frame", NOW_US)
    of.executor.frames = FrameSession()
    of.executor.frames.seal(b"no frame", NOW_US)
    assert (said(of).stopped, said(of).frames) == (2, 0)


def test_boundary_refuses_commands_after_the_signed_end() -> None:
    """A compromised runtime has the end signed early, to fly on without a record."""
    of = loaded()
    of.attestation.begin(KEY)
    first, sealed_ = allowed(of), preparation.seal(Preparation(1, False, NOW_US, ()), SESSION_KEY)
    assert isinstance(of.executor.dispatch(first, NOW_US), Command)
    vehicle = Codec(1, 1)
    of.executor.frames.observe(vehicle.pack(HEARTBEAT), NOW_US)
    ours = Codec(1, 191)
    land = ours.pack(m.MAVLink_command_long_message(1, 1, 21, 0, 0, 0, 0, 0, 0, 0, 0))
    assert of.executor.frames.seal(land, NOW_US) == NOT_COVERED
    assert said(of, final=True).final
    for refused in (
        of.executor.dispatch(first, NOW_US), of.executor.stand_in(first, 2, 2, NOW_US),
        of.executor.prepare(sealed_, NOW_US),
    ):  # fmt: skip
        assert refused == SESSION_OVER
    assert of.executor.frames.seal(land, NOW_US) == GATE_OVER
    assert isinstance(of.executor.frames.seal(ours.pack(m.MAVLink_timesync_message(0, 0)), NOW_US), bytes)
