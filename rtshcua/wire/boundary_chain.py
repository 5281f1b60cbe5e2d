"""The boundary's own evidence (paper symbol `d_ev`): one digest over all that it decided, accepted and let go ahead.

An entry is a tag and a payload; the digest after it is

    SHA-256("rtshcua/boundary" || 0x00 || the digest before it || tag (1 octet) || length (4) || payload)

numbers big-endian, beginning with 32 zero octets. A payload holds what the log's records say, and nothing else: so
whoever has the log works out the same digests. Two more digests are made in the same way, with other labels: of the
frames that carry out a command, without their signature, as they lie beside the log (`rtshcua/boundary-frames`); and of
what is only counted, answers that repeat the one before, documents and frames that were refused, and frames that were
signed ahead (`rtshcua/boundary-aside`).

Fixed tags, fixed layouts and one hash: a boundary without a heap keeps the same chain.
"""

from collections.abc import Iterable
from enum import IntEnum
from hashlib import sha256
from struct import Struct
from typing import Any, Final

from rtshcua.model.flat.situation import Now
from rtshcua.wire.digest import DIGEST_BYTES
from rtshcua.wire.preparation import ParameterWrite
from rtshcua.wire.request import DEGRADE

#: what stands before the first entry
START: Final = bytes(DIGEST_BYTES)
#: so many octets of a digest mark its entry in a statement, and so many entries of one are marked
MARK_BYTES: Final = 8
MOST_MARKS: Final = 128

_LABEL: Final = sha256(b"rtshcua/boundary\x00")
_FRAMES: Final = sha256(b"rtshcua/boundary-frames\x00")
_ASIDE: Final = sha256(b"rtshcua/boundary-aside\x00")
_HEAD: Final = Struct(">BI")
_BEGIN: Final = Struct(f">Q{DIGEST_BYTES}s16s{DIGEST_BYTES}sB")
_DECIDED: Final = Struct(">BBBhqB")
_SENT: Final = Struct(">BhhQQ")
_DOCUMENT: Final = Struct(">Bh3Q")
_AT: Final = Struct(">Q")
_WRITE: Final = Struct(">16sII")


class Tag(IntEnum):
    """What an entry is about."""

    BEGIN = 1  # a session begins
    DECIDED = 2  # a request was decided
    UNDECIDED = 3  # a request was refused a decision
    DOCUMENT = 4  # a signed document was accepted
    DECLINED = 5  # a document was refused; counted only
    SENT = 6  # a permit was turned into a command
    REFUSED = 7  # a permit was not
    PREPARED = 8  # a preparation permit was opened
    UNPREPARED = 9  # one was not
    FRAME = 10  # a frame passed that carries out a command
    STOPPED = 11  # a frame was refused; counted only
    AHEAD = 12  # a frame was signed ahead; counted only


class BoundaryChain:
    """The digest after `count` entries, that of so many `frames`, and the one `aside`, of what is only counted:
    `repeated` answers, `declined` documents, `stopped` frames, and frames that were signed `ahead`. Once it is `over`,
    its end was signed: whoever has it lets nothing happen any more.
    """

    __slots__ = (
        "_marks", "ahead", "aside", "count", "declined", "digest", "frames", "left", "over", "repeated", "stopped",
    )  # fmt: skip

    def __init__(self) -> None:
        self.digest = START
        self.count = 0
        self.left = START
        self.frames = 0
        self.aside = START
        self.repeated = self.declined = self.stopped = self.ahead = 0
        self.over = False
        self._marks: list[bytes] = []

    def add(self, tag: Tag, payload: bytes) -> bytes:
        """The digest after one entry more."""
        digest = self.digest = _next(_LABEL, self.digest, tag, payload)
        self.count += 1
        if len(self._marks) < MOST_MARKS:
            self._marks.append(digest[:MARK_BYTES])
        return digest

    def repeat(self, payload: bytes) -> bytes:
        """An answer that is the same as the one before; the digest stays."""
        self.repeated += 1
        self.aside = _next(_ASIDE, self.aside, Tag.DECIDED, payload)
        return self.digest

    def decline(self, document: bytes) -> bytes:
        """A document that was refused; the digest stays."""
        self.declined += 1
        self.aside = _next(_ASIDE, self.aside, Tag.DECLINED, sha256(document).digest())
        return self.digest

    def leave(self, frame: bytes) -> None:
        """A frame that carries out a command passed, as these octets."""
        self.frames += 1
        self.left = _next(_FRAMES, self.left, Tag.FRAME, frame)

    def stop(self, frame: bytes) -> None:
        """A frame was refused."""
        self.stopped += 1
        self.aside = _next(_ASIDE, self.aside, Tag.STOPPED, sha256(frame).digest())

    def sign_ahead(self, frame: bytes) -> None:
        """A frame was signed ahead: whether it is sent the boundary does not see."""
        self.ahead += 1
        self.aside = _next(_ASIDE, self.aside, Tag.AHEAD, sha256(frame).digest())

    def marks(self) -> bytes:
        """The marks of the entries since the last call, of `MOST_MARKS` at most."""
        marks, self._marks = b"".join(self._marks), []
        return marks


def begin(session: int, before: bytes, flight: bytes, bundle: bytes, *, enforced: bool) -> bytes:
    """The payload of a session's first entry: its number, the digest that was kept of the session before (zero where
    there is none), the flight's id, SHA-256 of the bundle, and whether anything is enforced (mode `none`: not).
    """
    return _BEGIN.pack(session, before, flight, bundle, enforced)


def decided(
    request: bytes, outcome: int, reason: int, rule_step: int, target: int, valid_until_us: int, consumed: int
) -> bytes:
    """The payload of a decision: what of the answer the log's record of it says, and the whole request. `target` is the
    number of a link of the fallback chain, -1 for none and for the target of a degrade rule.
    """
    return _DECIDED.pack(outcome, reason, rule_step, max(target, DEGRADE), valid_until_us, consumed) + request


def undecided(status: int, request: bytes) -> bytes:
    """The payload of a request that was refused a decision: the status of the answer, and SHA-256 of its octets."""
    return bytes((status,)) + request


def document(kind: int, step: int, now: Now, document: bytes) -> bytes:
    """The payload of an accepted document: kind and step of its receipt, the moment, and SHA-256 of its octets."""
    return _DOCUMENT.pack(kind, step, now.monotonic_us, now.utc_us, now.utc_error_us) + document


def sent(kind: int, step: int, link: int, token: int, now_us: int) -> bytes:
    """The payload of a dispatch; `link` is -1 for the target of a degrade rule too."""
    return _SENT.pack(kind, step, max(link, DEGRADE), token, now_us)


def refused(slug: str, now_us: int) -> bytes:
    """The payload of a permit by which nothing is sent: why, at a monotonic time."""
    return _AT.pack(now_us) + slug.encode()


def prepared(writes: Iterable[ParameterWrite], *, restoring: bool) -> bytes:
    """The payload of a preparation: its parameters, each with the value that it had and the one that it gets."""
    body = [_WRITE.pack(name.encode(), before, value) for name, before, value in writes]
    return bytes((restoring, len(body))) + b"".join(body)


def unprepared(slug: str) -> bytes:
    """The payload of a preparation permit by which nothing may be set."""
    return slug.encode()


def following(digest: bytes, tag: Tag, payload: bytes) -> bytes:
    """The digest after an entry, of the one before it."""
    return _next(_LABEL, digest, tag, payload)


def after_frame(digest: bytes, frame: bytes) -> bytes:
    """The digest of the frames that left, with one more."""
    return _next(_FRAMES, digest, Tag.FRAME, frame)


def _next(label: Any, digest: bytes, tag: Tag, payload: bytes) -> bytes:
    hasher = label.copy()
    hasher.update(digest + _HEAD.pack(tag, len(payload)) + payload)
    after: bytes = hasher.digest()
    return after
