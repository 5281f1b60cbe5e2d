"""What a home of the boundary attests of itself: an Entity Attestation Token (RFC 9711) in COSE_Sign1.

The boundary's key signs it without external data, so that any reader of COSE verifies it; everything else that this key
signs carries the duty's label, so neither is taken for the other. A home measures itself: nothing below it vouches.
"""

from collections.abc import Mapping
from enum import IntEnum
from hashlib import sha256
from typing import Final

import msgspec

from rtshcua.wire import cbor, cose
from rtshcua.wire.cbor import CborError
from rtshcua.wire.digest import DIGEST_BYTES
from rtshcua.wire.document import FLIGHT_BYTES
from rtshcua.wire.keys import KID_BYTES, Duty, VerificationKey
from rtshcua.wire.untrusted import Untrusted

#: media type of a token (RFC 9782)
CONTENT_TYPE: Final = "application/eat+cwt"
#: the profile of the claims below
PROFILE: Final = "tag:rtshcua,2026:boundary"
SOFTWARE: Final = "rtshcua-boundary"
#: the largest token, in octets
MAX_ATTESTATION: Final = 512

_UEID_BYTES: Final = 17
#: the type of a UEID that is a random number (RFC 9711, section 4.2.1.1): here the digest of a public key
_RANDOM: Final = b"\1"
_LINK_NAME_BYTES: Final = 8


class AttestationError(Untrusted):
    """A token that is refused: `malformed`, or `other-boundary`: its UEID is not that of the key that signed it."""


class DebugState(IntEnum):
    """Whether the home can be debugged (RFC 9711, section 4.2.9)."""

    ENABLED = 0
    DISABLED = 1


class HomeAttestation(msgspec.Struct, frozen=True):
    """What a home says of itself in one flight (its id, 16 octets).

    `mode` is its name, `code` SHA-256 of its code image, `measures` what isolates a process (boundary/home/process).
    `boots` counts its starts with what it keeps. `evidence` is the digest of the boundary's own evidence when the token
    was made (paper symbol `d_ev`). `ueid` names the boundary, `log_kid` and `link_name` the keys that it has, empty for
    those it has not.
    """

    flight: bytes
    ueid: bytes
    debug: DebugState
    boots: int
    code: bytes
    mode: str
    evidence: bytes
    measures: int
    log_kid: bytes
    link_name: bytes


def open_attestation(token: bytes, keys: Mapping[bytes, VerificationKey]) -> HomeAttestation:
    """What one of the keys (by `kid`), of duty `boundary`, attested. Raises `EnvelopeError` and `AttestationError`."""
    opened = cose.open1(
        token, keys=keys, duty=Duty.BOUNDARY, content_type=CONTENT_TYPE, limit=MAX_ATTESTATION, labelled=False
    )
    try:
        claims = cbor.decode(opened.payload, limit=MAX_ATTESTATION, items=64)
    except CborError as error:
        raise AttestationError("malformed", f"not canonical CBOR: {error}") from None
    found = _read(claims)
    if found is None:
        raise AttestationError("malformed", "not the claims of a boundary's home")
    if found.ueid != _RANDOM + sha256(opened.key.public).digest()[: _UEID_BYTES - 1]:
        raise AttestationError("other-boundary", "the UEID is not that of the key that signed it")
    return found


def _read(claims: object) -> HomeAttestation | None:
    # labels: RFC 9711, section 4; those below -65536 are for private use (RFC 8392, section 9.1). A measurement has the
    # content format of CBOR (60), and names its algorithm as COSE does: SHA-256 is -16.
    match claims:
        case {
            10: bytes(flight), 256: bytes(ueid), 263: int(debug), 265: str(profile), 267: int(boots),
            270: str(software), 273: ((60, bytes(measured)),), -70001: str(mode), -70002: bytes(evidence),
            -70003: int(measures), -70004: (bytes(log_kid), bytes(link_name)), **others,
        }:  # fmt: skip
            code = _measured(measured)
            sizes = (len(flight), len(ueid), len(evidence)) == (FLIGHT_BYTES, _UEID_BYTES, DIGEST_BYTES)
            named = len(log_kid) in (0, KID_BYTES) and len(link_name) in (0, _LINK_NAME_BYTES)
            known = (profile, software) == (PROFILE, SOFTWARE) and debug in (0, 1) and boots >= 0 and measures >= 0
            if others or code is None or not (sizes and named and known):
                return None
            state = DebugState(debug)
            return HomeAttestation(flight, ueid, state, boots, code, mode, evidence, measures, log_kid, link_name)
    return None


def _measured(data: bytes) -> bytes | None:
    """The digest of the one measurement."""
    try:
        content = cbor.decode(data, limit=MAX_ATTESTATION, items=8)
    except CborError:
        return None
    match content:
        case {1: -16, 2: bytes(digest), **others} if not others and len(digest) == DIGEST_BYTES:
            return digest
    return None
