"""Threat: a trusted key signs malformed data, as a document or not. It is refused without an exception."""

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import to_builtins
from msgspec.structs import replace

from reference.documents import approval, low, presented, recall, replacement
from reference.world import APPROVAL_KEY, MISSION_KEY, START, allowed, renewed
from rtshcua.wire import artefact, cose, names
from rtshcua.wire.artefact import ArtefactError
from rtshcua.wire.binding import bind
from rtshcua.wire.bundle import BundleError, parse
from rtshcua.wire.cbor import CborError, decode, encode
from rtshcua.wire.keys import Duty
from rtshcua.wire.names import Artefact
from rtshcua.wire.replacement import ReplacementDocument, _after

OF = low()
KINDS = {
    names.APPROVAL: (APPROVAL_KEY, Duty.APPROVAL, cose.unverified(approval(OF)).payload),
    names.RECALL: (APPROVAL_KEY, Duty.APPROVAL, cose.unverified(recall(OF)).payload),
    names.REPLACEMENT: (MISSION_KEY, Duty.MISSION, cose.unverified(replacement(OF)).payload),
}
SEEDS = st.integers(0, (1 << 64) - 1)
ODD = (
    0,
    -1,
    1,
    2,
    7,
    1 << 31,
    1 << 53,
    (1 << 63) - 1,
    -(1 << 63),
    b"",
    bytes(32),
    "",
    "*",
    "\x00",
    (),
    (0,),
    None,
    True,
)


def signed(kind: Artefact, payload: bytes) -> bytes:
    key, duty, _ = KINDS[kind]
    return cose.sign1(payload, key=key, duty=duty, content_type=kind.content_type)


def odd(value: object, of: Random) -> object:
    """The value with an invalid part."""
    if isinstance(value, tuple) and value and of.random() < 0.95:
        at = of.randrange(len(value))
        match of.randrange(12):
            case 0:
                return value[:at] + value[at + 1 :]
            case 1:
                return (*value[:at], value[at], *value[at:])
            case _:
                return (*value[:at], odd(value[at], of), *value[at + 1 :])
    return of.choice(ODD)


def bound(payload: bytes) -> bytes:
    """The same malformed data with correct ids and bindings, so that later checks are reached."""
    said = parse(names.REPLACEMENT, payload, ReplacementDocument)
    mission = bind(said.mission, OF.bundle.policy_digest, after=_after(said.flight, said.supersedes, said.kept))
    return artefact.wrap(names.REPLACEMENT, to_builtins(replace(said, mission=mission), builtin_types=(bytes,)))


def nonsense(seed: int) -> None:
    of = Random(seed)
    kind = of.choice(list(KINDS))
    payload = KINDS[kind][2]
    try:
        if of.random() < 0.3:
            changed = bytearray(payload)
            changed[of.randrange(len(payload))] ^= 1 << of.randrange(8)
            payload = bytes(changed)
        else:
            payload = encode(odd(decode(payload), of))
            if kind is names.REPLACEMENT and of.random() < 0.8:
                payload = bound(payload)
    except (CborError, BundleError, ArtefactError):
        return
    session = renewed(OF)
    document = signed(kind, payload)
    if of.random() < 0.5:
        session.boundary.consider(document, START)
    receipt = presented(session, document)
    if not receipt.accepted:
        assert session.bundle is OF.bundle
        allowed(session)


@pytest.mark.claim("A4")
@given(SEEDS)
def test_malformed_signed_document_is_refused(seed: int) -> None:
    nonsense(seed)


@given(st.sampled_from(list(KINDS)), st.binary(max_size=200))
def test_signed_garbage_payload_is_refused(kind: Artefact, payload: bytes) -> None:
    assert not presented(renewed(OF), signed(kind, payload)).accepted
