"""Signed envelopes: COSE_Sign1 (RFC 9052, sections 4.2 and 4.4) with Ed25519, without optional features.

The algorithm is Ed25519 (-19, RFC 9864) and not EdDSA (-8), which that RFC deprecates because it does not name the
curve. The external data of the signature is the duty's label, so that a signature for one duty never verifies for
another. Signed bytes stay opaque: they are verified before they are parsed, and never encoded again.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from rtshcua.wire import cbor
from rtshcua.wire.cbor import CborError
from rtshcua.wire.keys import KID_BYTES, Duty, SigningKey, VerificationKey
from rtshcua.wire.untrusted import Untrusted

#: COSE algorithm Ed25519 (RFC 9864, section 2.2)
ED25519: Final = -19

_TAG_18: Final = b"\xd2"  # COSE_Sign1
_ALGORITHM, _CONTENT_TYPE, _KID = 1, 3, 4  # header labels (RFC 9052, section 3.1)
_SIGNATURE_BYTES: Final = 64
#: the longest protected header, in bytes: ours have less than 80, and a limit prevents needless work
MAX_PROTECTED: Final = 200
#: an envelope is an array, two strings, an empty map and a signature; a header has three pairs
_ENVELOPE_ITEMS: Final = 5
_HEADER_ITEMS: Final = 7


class EnvelopeError(Untrusted):
    """An envelope that is refused: `malformed`, `wrong-content-type`, `unknown-key`, `wrong-duty`, `bad-signature`;
    and `revoked-key`, where a trust root says so.
    """


@dataclass(frozen=True, slots=True)
class Opened:
    """A verified payload, exactly as it was signed, and the key that signed it."""

    payload: bytes
    key: VerificationKey


@dataclass(frozen=True, slots=True)
class Unverified:
    """The unverified claims of an envelope, for display and to find the key. Do not trust them."""

    protected: bytes
    content_type: str
    kid: bytes
    payload: bytes
    signature: bytes


def sign1(payload: bytes, *, key: SigningKey, duty: Duty, content_type: str) -> bytes:
    """An envelope around `payload`. Raises `WrongDuty` unless `duty` is the key's."""
    protected = cbor.encode({_ALGORITHM: ED25519, _CONTENT_TYPE: content_type, _KID: key.kid})
    signature = key.sign(_signed(protected, duty.label, payload), duty=duty)
    return _TAG_18 + cbor.encode((protected, {}, payload, signature))


def open1(
    envelope: bytes, *, keys: Mapping[bytes, VerificationKey], duty: Duty, content_type: str, limit: int = cbor.LIMIT,
    labelled: bool = True,
) -> Opened:  # fmt: skip
    """The payload, if a key among `keys` (by `kid`) with this duty signed it. Raises `EnvelopeError`.

    Expiry and authorisation of the key are not checked: see `trust.key_refusal` and `trust.speaker_refusal`.
    """
    claimed = unverified(envelope, limit=limit)
    if claimed.content_type != content_type:
        raise EnvelopeError(
            "wrong-content-type", f"the envelope holds `{claimed.content_type[:80]}`, not `{content_type}`"
        )
    key = keys.get(claimed.kid)
    if key is None or key.kid != claimed.kid:
        raise EnvelopeError("unknown-key", f"key {claimed.kid.hex()} is not in the trust root")
    if key.duty is not duty:
        raise EnvelopeError("wrong-duty", f"key {key.kid.hex()} is trusted for `{key.duty}`, not for `{duty}`")
    if not key.verify(claimed.signature, _signed(claimed.protected, duty.label if labelled else b"", claimed.payload)):
        raise EnvelopeError("bad-signature", f"key {key.kid.hex()} did not sign these bytes for `{duty}`")
    return Opened(claimed.payload, key)


def unverified(envelope: bytes, *, limit: int = cbor.LIMIT) -> Unverified:
    """Parse an envelope without verifying it. Raises `EnvelopeError` (`malformed`) unless it is canonical."""
    if envelope[:1] != _TAG_18:
        raise EnvelopeError("malformed", "not a signed envelope: COSE_Sign1 begins with tag 18")
    match _decode(envelope[1:], limit, _ENVELOPE_ITEMS):
        case (bytes(protected), {**unprotected}, bytes(payload), bytes(signature)) if (
            not unprotected and len(signature) == _SIGNATURE_BYTES
        ):
            content_type, kid = _headers(protected)
            return Unverified(protected, content_type, kid, payload, signature)
    raise EnvelopeError("malformed", "not a COSE_Sign1 of four parts with a 64-byte signature")


def _headers(protected: bytes) -> tuple[str, bytes]:
    if len(protected) > MAX_PROTECTED:
        text = f"the protected header is {len(protected)} bytes; the limit is {MAX_PROTECTED}"
        raise EnvelopeError("malformed", text)
    match _decode(protected, MAX_PROTECTED, _HEADER_ITEMS):
        case {1: int(algorithm), 3: str(content_type), 4: bytes(kid), **others} if not others and len(kid) == KID_BYTES:
            if algorithm != ED25519:
                raise EnvelopeError("malformed", f"signature algorithm {algorithm} is not Ed25519 ({ED25519})")
            return content_type, kid
    raise EnvelopeError(
        "malformed", "the protected header must contain exactly algorithm, content type and key identifier"
    )


def _signed(protected: bytes, label: bytes, payload: bytes) -> bytes:
    """The Sig_structure (RFC 9052, section 4.4)."""
    return cbor.encode(("Signature1", protected, label, payload))


def _decode(data: bytes, limit: int, items: int) -> cbor.Value:
    try:
        return cbor.decode(data, limit=limit, items=items)
    except CborError as error:
        raise EnvelopeError("malformed", f"not canonical CBOR: {error}") from None
