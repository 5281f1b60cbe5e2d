"""Signed documents for a vehicle in flight: the common part of approvals, recalls, replacements and cancellations.

Each is a COSE_Sign1 around an artefact with a content type of its own, so that none can be mistaken for another. A
document is valid for a bounded time: it contains the moments of issue and of expiry, in UTC us.
"""

from typing import Final, TypeVar

from rtshcua.model.flat.situation import Now
from rtshcua.model.flat.struct import Flat
from rtshcua.wire import artefact, cose, names
from rtshcua.wire.bundle import open_envelope, parse
from rtshcua.wire.cbor import CborError, head
from rtshcua.wire.cose import Opened
from rtshcua.wire.keys import Duty, SigningKey, VerificationKey
from rtshcua.wire.names import Artefact
from rtshcua.wire.trust import HUMAN, TrustRoot, key_refusal, speaker_refusal
from rtshcua.wire.untrusted import Untrusted

#: length of a flight's id in bytes: random for each flight, and `boot` in the genesis of its log
FLIGHT_BYTES: Final = 16
#: a larger document is refused unread, in bytes; only one that holds a mission is large
MAX_DOCUMENT: Final = 1 << 18
MAX_WITHOUT_MISSION: Final = 1 << 11
#: the longest validity of an approval, a recall or a cancellation, in us
MAX_LIFE_US: Final = 3_600_000_000

_OUTSET: Final = b"\xd2\x84"  # tag 18, an array of four
_STRING: Final = 2
_EMPTY_MAP: Final = b"\xa0"

_HANDED_IN: Final = (names.APPROVAL, names.RECALL, names.REPLACEMENT, names.CANCELLATION)
_KINDS: Final = {kind.content_type: kind for kind in _HANDED_IN}


_F = TypeVar("_F", bound=Flat)


class DocumentError(Untrusted):
    """A document that is refused.

    `too-large`, `unknown-document`, `malformed`, `other-flight`, `root-expired`, `issued-in-future`, `expired`,
    `too-long-lived`, the slugs of `speaker_refusal`, and those of what the document is about.
    """


def kind_of(document: bytes) -> Artefact:
    """The kind of a document, unverified. Raises `DocumentError` and `EnvelopeError`.

    The outline is checked first, so that a flood of garbage costs no decoding time in flight.
    """
    _check_size(document, MAX_DOCUMENT)
    if not _outlined(document):
        raise DocumentError("malformed", "not a signed envelope")
    content_type = cose.unverified(document).content_type
    kind = _KINDS.get(content_type)
    if kind is None:
        text = f"`{content_type[:80]}` is not a document for a vehicle in flight"
        raise DocumentError("unknown-document", text)
    if kind is not names.REPLACEMENT:
        _check_size(document, MAX_WITHOUT_MISSION)
    return kind


def _check_size(document: bytes, most: int) -> None:
    if len(document) > most:
        raise DocumentError("too-large", f"the document is {len(document)} bytes; the limit is {most}")


def _outlined(document: bytes) -> bool:
    """Whether the bytes have the layout of our COSE_Sign1: tag, protected header, empty map, payload, signature."""
    if document[:2] != _OUTSET:
        return False
    at = len(_OUTSET)
    try:
        for number in range(3):
            major, length, at = head(document, at)
            if major != _STRING:
                return False
            at += length
            if number == 0:
                if document[at : at + 1] != _EMPTY_MAP:
                    return False
                at += 1
    except CborError:
        return False
    return at == len(document)


def sign_document(kind: Artefact, body: Flat, key: SigningKey, duty: Duty) -> bytes:
    """The signed document. Raises `WrongDuty` for a key of another duty."""
    return cose.sign1(artefact.pack(kind, body), key=key, duty=duty, content_type=kind.content_type)


def open_document(
    document: bytes, kind: Artefact, shape: type[_F], duty: Duty, root: TrustRoot, now: Now
) -> tuple[_F, Opened]:
    """The content of a document, if a key that the root trusts for the duty signed it and the root has certainly not
    expired; and the signed payload with its key.

    Raises `DocumentError`, `EnvelopeError`, `BundleError` and `ArtefactError`.
    """
    check_root(root, now)
    opened = open_envelope(document, root, duty, kind, MAX_DOCUMENT)
    return parse(kind, opened.payload, shape), opened


def check_root(root: TrustRoot, now: Now) -> None:
    """Check that the root has certainly not expired."""
    if now.utc_us + now.utc_error_us >= root.expires_at_us:
        raise DocumentError(
            "root-expired", f"trust root version {root.version} has expired, or may have within the clock's error"
        )


def check_vehicle(named: str, vehicle: str) -> None:
    """Check that a document is for this vehicle."""
    if named != vehicle:
        raise DocumentError("wrong-vehicle", f"the document is for `{named[:80]}`; this vehicle is `{vehicle}`")


def check_flight(named: bytes, flight: bytes) -> None:
    """Check that a document is for this flight, and not for another one of the same mission."""
    if named != flight:
        raise DocumentError("other-flight", "the document is for another flight")


def check_key(key: VerificationKey, vehicle: str, now: Now) -> None:
    """Check that a key is certainly authorised for a vehicle."""
    refusal = key_refusal(key, vehicle=vehicle, now_us=now.utc_us + now.utc_error_us)
    if refusal is not None:
        raise DocumentError(refusal, f"key {key.kid.hex()} is not authorised for `{vehicle}` now")


def check_times(issued_at_us: int, expires_at_us: int, now: Now) -> None:
    """Check that a document is valid now. Within the clock's error, it counts as issued and as expired."""
    if issued_at_us > now.utc_us + now.utc_error_us:
        raise DocumentError("issued-in-future", "the document's time of issue is in the future")
    if now.utc_us + now.utc_error_us >= expires_at_us:
        raise DocumentError("expired", "the document has expired, or may have within the clock's error")
    if not 0 < expires_at_us - issued_at_us <= MAX_LIFE_US:
        most = MAX_LIFE_US // 60_000_000
        raise DocumentError("too-long-lived", f"the document is valid for longer than the limit of {most} min")


def check_person(key: VerificationKey, role: str, vehicle: str, now: Now) -> None:
    """Check that a key is certainly authorised to answer in person for a role on a vehicle."""
    refusal = speaker_refusal(key, role=role, source=HUMAN, vehicle=vehicle, now_us=now.utc_us + now.utc_error_us)
    if refusal is not None:
        text = f"key {key.kid.hex()} is not authorised for role `{role}` in person on `{vehicle}` now"
        raise DocumentError(refusal, text)
