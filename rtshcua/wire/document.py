"""Signed documents that are handed to a vehicle while it is under way: what approvals, recalls,
replacements and cancellations share.

Each is a COSE_Sign1 around an artefact of its own content type, so that none can be taken for another. A document
speaks for a bounded time: it says when it was issued and when it ends, in UTC us.
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

#: length of a flight's id in bytes: random, drawn for each, and `boot` in the genesis of its log
FLIGHT_BYTES: Final = 16
#: a document larger than this is refused unread, in bytes; one that holds no mission has no reason to be large
MAX_DOCUMENT: Final = 1 << 18
MAX_WITHOUT_MISSION: Final = 1 << 11
#: how long an approval, a recall or a cancellation may speak at most, in us
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
    """What a document says that it is, not verified. Raises `DocumentError` and `EnvelopeError`.

    It looks at the document's outline first: whoever floods a flight with garbage must not keep it busy decoding that.
    """
    _check_size(document, MAX_DOCUMENT)
    if not _outlined(document):
        raise DocumentError("malformed", "not a signed envelope")
    content_type = cose.unverified(document).content_type
    kind = _KINDS.get(content_type)
    if kind is None:
        text = f"`{content_type[:80]}` is no document for a vehicle under way"
        raise DocumentError("unknown-document", text)
    if kind is not names.REPLACEMENT:
        _check_size(document, MAX_WITHOUT_MISSION)
    return kind


def _check_size(document: bytes, most: int) -> None:
    if len(document) > most:
        raise DocumentError("too-large", f"a document of {len(document)} bytes is not read; at most {most} are")


def _outlined(document: bytes) -> bool:
    """Whether the bytes are laid out as a COSE_Sign1 of ours: tag, protected header, empty map, payload, signature."""
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
    """What a document says, if a key that the root trusts for the duty signed it, and the root is still good for
    certain; and what was signed, by which key.

    Raises `DocumentError`, `EnvelopeError`, `BundleError` and `ArtefactError`.
    """
    check_root(root, now)
    opened = open_envelope(document, root, duty, kind, MAX_DOCUMENT)
    return parse(kind, opened.payload, shape), opened


def check_root(root: TrustRoot, now: Now) -> None:
    """Whether the root is still good, for certain."""
    if now.utc_us + now.utc_error_us >= root.expires_at_us:
        raise DocumentError("root-expired", f"trust root version {root.version} has expired, or may have")


def check_vehicle(named: str, vehicle: str) -> None:
    """Whether a document is for this vehicle."""
    if named != vehicle:
        raise DocumentError("wrong-vehicle", f"it is for `{named[:80]}`, this vehicle is `{vehicle}`")


def check_flight(named: bytes, flight: bytes) -> None:
    """Whether a document is for this flight, and no other of the same mission."""
    if named != flight:
        raise DocumentError("other-flight", "it is for another flight than this one")


def check_key(key: VerificationKey, vehicle: str, now: Now) -> None:
    """Whether a key may speak for a vehicle, for certain."""
    refusal = key_refusal(key, vehicle=vehicle, now_us=now.utc_us + now.utc_error_us)
    if refusal is not None:
        raise DocumentError(refusal, f"key {key.kid.hex()} may not speak for `{vehicle}` now")


def check_times(issued_at_us: int, expires_at_us: int, now: Now) -> None:
    """Whether a document speaks now. In doubt it is issued, within the clock's error, and in doubt it has expired."""
    if issued_at_us > now.utc_us + now.utc_error_us:
        raise DocumentError("issued-in-future", "it says that it will be issued later than now")
    if now.utc_us + now.utc_error_us >= expires_at_us:
        raise DocumentError("expired", "it has expired, or may have: the clock does not tell")
    if not 0 < expires_at_us - issued_at_us <= MAX_LIFE_US:
        most = MAX_LIFE_US // 60_000_000
        raise DocumentError("too-long-lived", f"it speaks for longer than the {most} min that a document may")


def check_person(key: VerificationKey, role: str, vehicle: str, now: Now) -> None:
    """Whether a key may answer in person for a role on a vehicle, for certain."""
    refusal = speaker_refusal(key, role=role, source=HUMAN, vehicle=vehicle, now_us=now.utc_us + now.utc_error_us)
    if refusal is not None:
        text = f"key {key.kid.hex()} may not speak for role `{role}` in person on `{vehicle}` now"
        raise DocumentError(refusal, text)
