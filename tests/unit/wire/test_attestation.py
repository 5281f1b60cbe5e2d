"""Attestation tokens: what they say, and every way not to be one."""

from hashlib import sha256
from typing import Any

import pytest

from rtshcua.wire import attestation, cbor, cose
from rtshcua.wire.attestation import AttestationError, DebugState, open_attestation
from rtshcua.wire.keys import Duty, SigningKey

KEY = SigningKey.from_seed(bytes([7]) * 32, duty=Duty.BOUNDARY)
KEYS = {KEY.kid: KEY.verification(vehicles=("*",))}
UEID = b"\1" + sha256(KEY.public).digest()[:16]
CODE = cbor.encode({1: -16, 2: bytes([1]) * 32})
CLAIMS: dict[int, Any] = {
    10: bytes([2]) * 16, 256: UEID, 263: 1, 265: attestation.PROFILE, 267: 3, 270: attestation.SOFTWARE,
    273: ((60, CODE),), -70001: "process", -70002: bytes([3]) * 32, -70003: 5, -70004: (b"", bytes(8)),
}  # fmt: skip


def token(payload: bytes, content_type: str = attestation.CONTENT_TYPE, aad: bytes = b"") -> bytes:
    """A token as the boundary in C makes it."""
    protected = cbor.encode({1: cose.ED25519, 3: content_type, 4: KEY.kid})
    signature = KEY.sign(cbor.encode(("Signature1", protected, aad, payload)), duty=Duty.BOUNDARY)
    return b"\xd2" + cbor.encode((protected, {}, payload, signature))


def test_token_states_the_home() -> None:
    found = open_attestation(token(cbor.encode(CLAIMS)), KEYS)
    assert (found.flight, found.mode, found.boots, found.debug) == (bytes([2]) * 16, "process", 3, DebugState.DISABLED)
    assert (found.code, found.evidence) == (bytes([1]) * 32, bytes([3]) * 32)
    assert (found.ueid, found.measures, found.log_kid, found.link_name) == (UEID, 5, b"", bytes(8))


@pytest.mark.parametrize(
    ("label", "value"),
    [
        (10, b""), (10, 1), (256, bytes(16)), (263, 2), (265, "another"), (267, -1), (270, "another"), (273, ()),
        (273, ((61, CODE),)), (273, ((60, b"\xff"),)), (273, ((60, cbor.encode({1: -16})),)),
        (273, ((60, cbor.encode({1: -16, 2: b""})),)), (273, ((60, cbor.encode({1: -16, 2: bytes(32), 3: 0})),)),
        (-70001, 1), (-70002, b""), (-70003, -1), (-70004, ()), (-70004, (b"1", b"")), (-70004, (b"", b"1")), (1, 1),
    ],
)  # fmt: skip
def test_claim_that_no_home_makes_is_refused(label: int, value: Any) -> None:
    with pytest.raises(AttestationError) as refused:
        open_attestation(token(cbor.encode(CLAIMS | {label: value})), KEYS)
    assert refused.value.slug == "malformed"


def test_identity_of_another_boundary_is_refused() -> None:
    with pytest.raises(AttestationError) as refused:
        open_attestation(token(cbor.encode(CLAIMS | {256: b"\1" + bytes(16)})), KEYS)
    assert refused.value.slug == "other-boundary"


@pytest.mark.parametrize("missing", CLAIMS)
def test_missing_claim_is_refused(missing: int) -> None:
    with pytest.raises(AttestationError):
        open_attestation(token(cbor.encode({label: each for label, each in CLAIMS.items() if label != missing})), KEYS)


@pytest.mark.parametrize("payload", [b"", b"\xff", b"\x00", cbor.encode(CLAIMS) + b"\0"])
def test_payload_without_claims_is_refused(payload: bytes) -> None:
    with pytest.raises(AttestationError):
        open_attestation(token(payload), KEYS)


def test_token_is_taken_for_nothing_else_that_the_key_signs() -> None:
    payload = cbor.encode(CLAIMS)
    with pytest.raises(cose.EnvelopeError) as refused:
        open_attestation(token(payload, aad=Duty.BOUNDARY.label), KEYS)
    assert refused.value.slug == "bad-signature"
    with pytest.raises(cose.EnvelopeError) as refused:
        cose.open1(token(payload), keys=KEYS, duty=Duty.BOUNDARY, content_type=attestation.CONTENT_TYPE)
    assert refused.value.slug == "bad-signature"
    with pytest.raises(cose.EnvelopeError) as refused:
        open_attestation(token(payload, content_type="application/cwt"), KEYS)
    assert refused.value.slug == "wrong-content-type"
