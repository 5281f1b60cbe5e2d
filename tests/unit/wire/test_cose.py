"""Envelopes: COSE_Sign1 as specified, and malformed ones."""

import cbor2
import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
from hypothesis import given, settings
from hypothesis import strategies as st

from rtshcua.wire import cbor, cose, names
from rtshcua.wire.keys import Duty, SigningKey, WrongDuty
from virtual.rows import rows

KEY = SigningKey.from_seed(bytes(range(32)), duty=Duty.POLICY)
PUBLIC = KEY.verification()
KEYS = {PUBLIC.kid: PUBLIC}
TYPE = names.POLICY.content_type
PAYLOAD = b"not even CBOR: \xff"
ENVELOPE = cose.sign1(PAYLOAD, key=KEY, duty=Duty.POLICY, content_type=TYPE)
L = 2**252 + 27742317777372353535851937790883648493


def opened(envelope, *, keys=KEYS, duty=Duty.POLICY, content_type=TYPE, **more):
    return cose.open1(envelope, keys=keys, duty=duty, content_type=content_type, **more)


def refusal(envelope, **more):
    with pytest.raises(cose.EnvelopeError) as refused:
        opened(envelope, **more)
    return refused.value.slug


def parts():
    claimed = cose.unverified(ENVELOPE)
    return [claimed.protected, {}, claimed.payload, claimed.signature]


def rebuilt(protected=None, unprotected=None, payload=None, signature=None):
    old = parts()
    new = (protected, unprotected, payload, signature)
    return b"\xd2" + cbor.encode([o if n is None else n for o, n in zip(old, new, strict=True)])


def test_signed_envelope_opens():
    assert opened(ENVELOPE) == cose.Opened(PAYLOAD, PUBLIC)
    assert opened(ENVELOPE).key.kid == KEY.kid
    assert cose.sign1(PAYLOAD, key=KEY, duty=Duty.POLICY, content_type=TYPE) == ENVELOPE


def test_another_implementation_reads_it():
    """Decoded by cbor2, and verified by RFC 9052, section 4.4."""
    message = cbor2.loads(ENVELOPE)
    assert message.tag == 18
    protected, unprotected, payload, signature = message.value
    assert cbor2.loads(protected) == {1: -19, 3: "application/vnd.rtshcua.policy+cbor", 4: KEY.kid}
    assert (unprotected, payload) == ({}, PAYLOAD)
    signed = cbor2.dumps(["Signature1", protected, b"rtshcua/duty/policy", payload])
    Ed25519PublicKey.from_public_bytes(KEY.public).verify(signature, signed)


def test_signing_refuses_the_wrong_duty():
    with pytest.raises(WrongDuty):
        cose.sign1(PAYLOAD, key=KEY, duty=Duty.MISSION, content_type=names.MISSION.content_type)


def test_unverified_returns_claims():
    claimed = cose.unverified(ENVELOPE)
    assert (claimed.content_type, claimed.kid, claimed.payload) == (TYPE, KEY.kid, PAYLOAD)


def test_unsuitable_keys_are_refused():
    other = SigningKey.from_seed(bytes(32), duty=Duty.POLICY).verification()
    assert refusal(ENVELOPE, keys={}) == "unknown-key"
    assert refusal(ENVELOPE, keys={other.kid: other}) == "unknown-key"
    assert refusal(ENVELOPE, keys={KEY.kid: other}) == "unknown-key"
    assert refusal(ENVELOPE, duty=Duty.MISSION) == "wrong-duty"
    assert refusal(ENVELOPE, content_type=names.MISSION.content_type) == "wrong-content-type"


def test_wrong_signatures_are_refused():
    signature = parts()[3]
    malleated = signature[:32] + (int.from_bytes(signature[32:], "little") + L).to_bytes(32, "little")
    assert refusal(rebuilt(signature=malleated)) == "bad-signature"
    assert refusal(rebuilt(signature=bytes(64))) == "bad-signature"
    assert refusal(rebuilt(payload=PAYLOAD + b"\0")) == "bad-signature"
    assert refusal(rebuilt(signature=signature[:-1])) == "malformed"


def test_a_key_is_named_by_its_whole_identifier():
    header = {1: -19, 3: TYPE, 4: KEY.kid}
    assert rebuilt(protected=cbor.encode(header)) == ENVELOPE
    assert refusal(rebuilt(protected=cbor.encode(header | {4: KEY.kid[:-1]}))) == "malformed"
    assert refusal(rebuilt(protected=cbor.encode(header | {5: 0}))) == "malformed"


def test_only_canonical_form_is_accepted():
    assert refusal(b"") == "malformed"
    assert refusal(ENVELOPE[1:]) == "malformed"  # COSE allows an untagged message
    assert refusal(b"\xd8\x12" + ENVELOPE[1:]) == "malformed"  # tag 18, not in its shortest form
    assert refusal(b"\xd2" + ENVELOPE) == "malformed"
    assert refusal(ENVELOPE + b"\0") == "malformed"
    assert refusal(b"\xd2\x80") == "malformed"
    assert refusal(b"\xd2\x9f" + ENVELOPE[2:] + b"\xff") == "malformed"
    assert refusal(rebuilt(unprotected={4: KEY.kid})) == "malformed"
    assert refusal(b"\xd2" + cbor.encode([parts()[0], {}, None, parts()[3]])) == "malformed"  # detached payload
    assert refusal(ENVELOPE, limit=len(ENVELOPE) - 2) == "malformed"
    assert opened(ENVELOPE, limit=len(ENVELOPE) - 1).payload == PAYLOAD


@rows(
    "header",
    [
        {},
        {3: TYPE, 4: KEY.kid},
        {1: -19, 4: KEY.kid},
        {1: -19, 3: TYPE},
        {1: -8, 3: TYPE, 4: KEY.kid},
        {1: True, 3: TYPE, 4: KEY.kid},
        {1: -19, 3: 60, 4: KEY.kid},
        {1: -19, 3: TYPE, 4: KEY.kid[1:]},
        {1: -19, 2: [4], 3: TYPE, 4: KEY.kid},
        [],
    ],
    ids=lambda header: str(list(header)),
)
def test_no_other_header_is_taken_even_if_signed(header):
    protected = cbor.encode(header)
    signature = KEY.sign(cbor.encode(["Signature1", protected, Duty.POLICY.label, PAYLOAD]), duty=Duty.POLICY)
    assert refusal(rebuilt(protected=protected, signature=signature)) == "malformed"


def test_too_long_header_is_malformed():
    for size in (cose.MAX_PROTECTED, cose.MAX_PROTECTED + 1):
        header = bytes(size)
        with pytest.raises(cose.EnvelopeError) as refused:
            cose.unverified(b"\xd2" + cbor.encode((header, {}, b"", bytes(64))))
        assert refused.value.slug == "malformed"
        assert ("the limit is 200" in str(refused.value)) == (size > cose.MAX_PROTECTED)


def test_a_header_that_is_not_canonical():
    protected = b"\xa3\x01\x32" + parts()[0][3:] + b"\0"
    assert refusal(rebuilt(protected=protected)) == "malformed"


@settings(max_examples=settings().max_examples * 2)
@given(st.integers(0, len(ENVELOPE) - 1), st.integers(1, 255))
def test_no_byte_can_be_changed(at, difference):
    damaged = ENVELOPE[:at] + bytes([ENVELOPE[at] ^ difference]) + ENVELOPE[at + 1 :]
    assert refusal(damaged) in {"malformed", "wrong-content-type", "unknown-key", "bad-signature"}


@given(st.integers(0, len(ENVELOPE) - 1))
def test_no_byte_can_be_cut(length):
    assert refusal(ENVELOPE[:length]) == "malformed"


@given(st.binary(max_size=120))
def test_arbitrary_bytes_are_malformed(data):
    assert refusal(data) == refusal(b"\xd2" + data) == "malformed"
