"""Compares the cosignatures of witnesses with the log: how far it is anchored, or that it was rewritten or truncated.

A witness never cosigns two trees that contradict each other. A cosignature at one size therefore covers all
smaller sizes, and with a threshold of k the log is anchored up to the size that k witnesses reached.
"""

from collections.abc import Iterable, Iterator
from hashlib import sha256
from itertools import pairwise
from typing import Final, NamedTuple

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.note import MARK, parse
from rtshcua.evidence.witnessing.cosign import Cosignature, cosignatures

#: the event of an effect with an anchor in its `detail`
ANCHORED: Final = "anchored"
#: the longest note that is read, in characters: the checkpoint and some dozens of cosignatures
LONGEST_NOTE: Final = 1 << 14


class Witnessed(NamedTuple):
    """The largest tree of the log that one witness cosigned, and when (seconds since the Unix epoch)."""

    public: bytes
    name: str
    size: int
    time_s: int


class AnchoredExtent(NamedTuple):
    """How far the threshold of witnesses saw the log.

    `records` counts the anchored lines from the first on: the tree that was cosigned, and the signed record that
    carries its checkpoint, which the checkpoint names. `tail` is the number of later lines. `witnessed` is what
    each witness saw, the largest first; it may go further than what is anchored, if too few went there. `rejected`
    counts the ignored notes, which have a wrong signature in the name of a witness; `first` names the first of
    these.
    """

    records: int
    tail: int
    threshold: int
    witnessed: tuple[Witnessed, ...]
    rejected: int = 0
    first: str = ""

    @property
    def ahead(self) -> tuple[Witnessed, ...]:
        """What fewer witnesses than the threshold saw beyond what is anchored."""
        return tuple(seen for seen in self.witnessed if seen.size >= self.records)


class Anchors:
    """Processes the checkpoints of one log and its anchors, in any order, and compares each pair once.

    `witnesses` are the public keys that the trust root names for duty `witness` (`TrustRoot.witnesses`). Only a
    digest of each checkpoint is kept: some hundred bytes for each epoch.
    """

    def __init__(self, origin: str, witnesses: Iterable[bytes], threshold: int) -> None:
        self._origin = origin
        self._keys = tuple(sorted(witnesses))
        self._threshold = threshold
        self._signed: dict[int, bytes] = {}
        self._ahead: dict[int, tuple[bytes, Cosignature]] = {}
        self._seen: dict[bytes, Witnessed] = {}
        self._rejected, self._first = 0, ""

    def checkpoint(self, note: str) -> Flaw | None:
        """Add a checkpoint of the log from a signed record, whose own signature was verified."""
        text = note.rpartition("\n\n")[0] + "\n"
        size = int(text.split("\n", 2)[1])
        digest = sha256(text.encode()).digest()
        self._signed[size] = digest
        waiting = self._ahead.pop(size, None)
        return None if waiting is None else _compare(size, digest, *waiting)

    def anchor(self, note: str) -> Flaw | None:
        """Add an anchor from any source. An anchor of another log, or without a trusted witness, is ignored. A note
        with a wrong signature of a witness is rejected as a whole, because anyone can write such notes into a file
        of anchors.
        """
        if len(note) > LONGEST_NOTE:
            return None
        found = cosignatures(note, self._keys)
        if isinstance(found, Flaw):
            self._reject(note, found)
            return None
        text, signers = found
        checkpoint = parse(text)
        if not signers or isinstance(checkpoint, Flaw) or checkpoint.origin != self._origin:
            return None
        size, digest = checkpoint.size, sha256(text.encode()).digest()
        for signer in signers:
            before = self._seen.get(signer.public)
            if before is None or before.size < size:
                self._seen[signer.public] = Witnessed(signer.public, signer.name, size, signer.time_s)
        own = self._signed.get(size)
        waiting = self._ahead.setdefault(size, (digest, signers[0]))
        if own is None:
            return _compare(size, digest, *waiting)
        del self._ahead[size]
        return _compare(size, own, digest, signers[0])

    def _reject(self, note: str, flaw: Flaw) -> None:
        if note.startswith(self._origin + "\n"):
            self._rejected, self._first = self._rejected + 1, self._first or flaw.text

    def finish(self, records: int) -> AnchoredExtent | Flaw:
        """The result for a log of so many lines, after all its checkpoints and anchors."""
        if self._ahead:
            size = max(self._ahead)
            witness = self._ahead[size][1]
            if size >= records:
                text = f"witness `{witness.name}` saw a longer log: the end of this one was removed"
                return Flaw("anchor/beyond", text, f"{records} records", f"{size + 1} records or more")
            text = f"witness `{witness.name}` saw a checkpoint of {size} records, which is not in the log"
            return Flaw("anchor/root", text, "none", f"a signed record {size}")
        witnessed = tuple(sorted(self._seen.values(), key=lambda seen: (-seen.size, seen.public)))
        count = witnessed[self._threshold - 1].size + 1 if len(witnessed) >= self._threshold else 0
        return AnchoredExtent(count, records - count, self._threshold, witnessed, self._rejected, self._first)


def _compare(size: int, own: bytes, seen: bytes, witness: Cosignature) -> Flaw | None:
    if own == seen:
        return None
    text = f"witness `{witness.name}` saw another log at {size} records: this one was rewritten"
    return Flaw("anchor/root", text, own.hex(), seen.hex())


def notes(text: str) -> Iterator[str]:
    """The notes in an anchor file: each has two parts, text and signatures, which end with an empty line. Incomplete
    notes are skipped.
    """
    for body, signatures in pairwise(text.split("\n\n")):
        if signatures.startswith(MARK) and not body.startswith(MARK):
            yield f"{body}\n\n{signatures}\n"
