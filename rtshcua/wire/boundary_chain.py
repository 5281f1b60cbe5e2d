"""The boundary's own evidence (paper symbol `d_ev`): one digest over everything that it decided, accepted and sent.

An entry is a tag and a payload; the digest after it is

    SHA-256("rtshcua/boundary" || 0x00 || previous digest || tag (1 octet) || length (4) || payload)

with big-endian numbers, beginning with 32 zero octets. A payload contains only what the log's records say, so the
digests can be recomputed from the log. Two more digests are made in the same way, with other labels: one over the
frames that carry out a command, without their signature, as they are stored beside the log
(`rtshcua/boundary-frames`); and one over what is only counted: repeated answers, refused documents and frames, and
frames signed ahead (`rtshcua/boundary-aside`).

With fixed tags, fixed layouts and one hash, a boundary without a heap can keep the same chain.
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

#: the digest before the first entry
START: Final = bytes(DIGEST_BYTES)
#: the length of an entry's mark in a statement, in octets of its digest, and the greatest number of marks
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
    """The kind of an entry."""

    BEGIN = 1  # a session begins
    DECIDED = 2  # a decision was made on a request
    UNDECIDED = 3  # a request was refused without a decision
    DOCUMENT = 4  # a signed document was accepted
    DECLINED = 5  # a document was refused; counted only
    SENT = 6  # a permit was turned into a command
    REFUSED = 7  # a permit was refused
    PREPARED = 8  # a preparation permit was opened
    UNPREPARED = 9  # a preparation permit was refused
    FRAME = 10  # a frame that carries out a command was sent
    STOPPED = 11  # a frame was refused; counted only
    AHEAD = 12  # a frame was signed ahead; counted only


class BoundaryChain:
    """The digest after `count` entries, the digest of the `frames`, and the one `aside` of what is only counted:
    `repeated` answers, `declined` documents, `stopped` frames, and frames signed `ahead`. Once its end is signed
    the chain is `over`, and its owner must refuse everything.
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
        """Add an entry; return the new digest."""
        digest = self.digest = _next(_LABEL, self.digest, tag, payload)
        self.count += 1
        if len(self._marks) < MOST_MARKS:
            self._marks.append(digest[:MARK_BYTES])
        return digest

    def repeat(self, payload: bytes) -> bytes:
        """Count an answer that repeats the one before; the digest does not change."""
        self.repeated += 1
        self.aside = _next(_ASIDE, self.aside, Tag.DECIDED, payload)
        return self.digest

    def decline(self, document: bytes) -> bytes:
        """Count a refused document; the digest does not change."""
        self.declined += 1
        self.aside = _next(_ASIDE, self.aside, Tag.DECLINED, sha256(document).digest())
        return self.digest

    def leave(self, frame: bytes) -> None:
        """Add a frame that carries out a command, given as octets."""
        self.frames += 1
        self.left = _next(_FRAMES, self.left, Tag.FRAME, frame)

    def stop(self, frame: bytes) -> None:
        """Count a refused frame."""
        self.stopped += 1
        self.aside = _next(_ASIDE, self.aside, Tag.STOPPED, sha256(frame).digest())

    def sign_ahead(self, frame: bytes) -> None:
        """Count a frame that was signed ahead. The boundary does not see whether it is sent."""
        self.ahead += 1
        self.aside = _next(_ASIDE, self.aside, Tag.AHEAD, sha256(frame).digest())

    def marks(self) -> bytes:
        """The marks of the entries since the last call, `MOST_MARKS` at most."""
        marks, self._marks = b"".join(self._marks), []
        return marks


def begin(session: int, before: bytes, flight: bytes, bundle: bytes, *, enforced: bool) -> bytes:
    """The payload of a session's first entry: its number, the last digest of the previous session (zero if there is
    none), the flight's id, SHA-256 of the bundle, and whether decisions are enforced (mode `none`: no).
    """
    return _BEGIN.pack(session, before, flight, bundle, enforced)


def decided(
    request: bytes, outcome: int, reason: int, rule_step: int, target: int, valid_until_us: int, consumed: int
) -> bytes:
    """The payload of a decision: the parts of the answer that the log records, and the whole request. `target` is the
    number of a link of the fallback chain; -1 for none and for the target of a degrade rule.
    """
    return _DECIDED.pack(outcome, reason, rule_step, max(target, DEGRADE), valid_until_us, consumed) + request


def undecided(status: int, request: bytes) -> bytes:
    """The payload of a request that was refused without a decision: the status of the answer, and SHA-256 of its
    octets.
    """
    return bytes((status,)) + request


def document(kind: int, step: int, now: Now, document: bytes) -> bytes:
    """The payload of an accepted document: kind and step of its receipt, the moment, and SHA-256 of its octets."""
    return _DOCUMENT.pack(kind, step, now.monotonic_us, now.utc_us, now.utc_error_us) + document


def sent(kind: int, step: int, link: int, token: int, now_us: int) -> bytes:
    """The payload of a dispatch; `link` is -1 also for the target of a degrade rule."""
    return _SENT.pack(kind, step, max(link, DEGRADE), token, now_us)


def refused(slug: str, now_us: int) -> bytes:
    """The payload of a refused permit: the reason, and the monotonic time."""
    return _AT.pack(now_us) + slug.encode()


def prepared(writes: Iterable[ParameterWrite], *, restoring: bool) -> bytes:
    """The payload of a preparation: its parameters, each with its old and its new value."""
    body = [_WRITE.pack(name.encode(), before, value) for name, before, value in writes]
    return bytes((restoring, len(body))) + b"".join(body)


def unprepared(slug: str) -> bytes:
    """The payload of a refused preparation permit."""
    return slug.encode()


def following(digest: bytes, tag: Tag, payload: bytes) -> bytes:
    """The digest after an entry, from the digest before it."""
    return _next(_LABEL, digest, tag, payload)


def after_frame(digest: bytes, frame: bytes) -> bytes:
    """The digest of the frames after one more was sent."""
    return _next(_FRAMES, digest, Tag.FRAME, frame)


def _next(label: Any, digest: bytes, tag: Tag, payload: bytes) -> bytes:
    hasher = label.copy()
    hasher.update(digest + _HEAD.pack(tag, len(payload)) + payload)
    after: bytes = hasher.digest()
    return after
