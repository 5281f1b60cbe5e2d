"""What witnesses saw of a log, held against the log: how far it is anchored, or that it was rewritten or cut.

A witness cosigns no two trees that contradict each other. So what it cosigned at one size stands for all smaller ones,
and with a threshold of k the log is anchored as far as the k-th of its witnesses went.
"""

from collections.abc import Iterable, Iterator
from hashlib import sha256
from itertools import pairwise
from typing import Final, NamedTuple

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.note import MARK, parse
from rtshcua.evidence.witnessing.cosign import Cosignature, cosignatures

#: the event of an effect that holds an anchor in its `detail`
ANCHORED: Final = "anchored"
#: the longest note that is looked at, in characters: the checkpoint and some dozens of cosignatures
LONGEST_NOTE: Final = 1 << 14


class Witnessed(NamedTuple):
    """The largest tree of the log that one witness cosigned, and when (seconds since the Unix epoch)."""

    public: bytes
    name: str
    size: int
    time_s: int


class AnchoredExtent(NamedTuple):
    """How far the threshold of witnesses saw the log.

    `records` counts the lines from the first on that are anchored: the tree that was cosigned, and the signed record
    that carries its checkpoint, which is named in it. `tail` is how many lines come after. `witnessed` is what each
    witness saw, the largest first; it may go further than what is anchored, when too few went there. `rejected` notes
    say nothing, for they have a signature in the name of a witness that it did not make; `first` says of which.
    """

    records: int
    tail: int
    threshold: int
    witnessed: tuple[Witnessed, ...]
    rejected: int = 0
    first: str = ""

    @property
    def ahead(self) -> tuple[Witnessed, ...]:
        """What went further than what is anchored: by fewer witnesses than the threshold."""
        return tuple(seen for seen in self.witnessed if seen.size >= self.records)


class Anchors:
    """Takes the checkpoints of one log and the anchors for it, in any order, and compares each pair once.

    `witnesses` are the public keys that the trust root names for duty `witness` (`TrustRoot.witnesses`). Of a
    checkpoint only a digest is kept: some hundred bytes for each epoch.
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
        """A checkpoint of the log, as a signed record carries it, whose own signature was verified."""
        text = note.rpartition("\n\n")[0] + "\n"
        size = int(text.split("\n", 2)[1])
        digest = sha256(text.encode()).digest()
        self._signed[size] = digest
        waiting = self._ahead.pop(size, None)
        return None if waiting is None else _compare(size, digest, *waiting)

    def anchor(self, note: str) -> Flaw | None:
        """An anchor, wherever it comes from. What no trusted witness cosigned, or of another log, says nothing. A note
        with a wrong signature of one of them is rejected as a whole: anyone can write such notes, in a file of anchors.
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
        """The outcome for a log of so many lines, once all its checkpoints and anchors were given."""
        if self._ahead:
            size = max(self._ahead)
            witness = self._ahead[size][1]
            if size >= records:
                text = f"witness `{witness.name}` saw a longer log: its end was cut off"
                return Flaw("anchor/beyond", text, f"{records} records", f"{size + 1} records or more")
            text = f"witness `{witness.name}` saw a checkpoint of {size} records, which the log does not have"
            return Flaw("anchor/root", text, "none", f"a signed record {size}")
        witnessed = tuple(sorted(self._seen.values(), key=lambda seen: (-seen.size, seen.public)))
        count = witnessed[self._threshold - 1].size + 1 if len(witnessed) >= self._threshold else 0
        return AnchoredExtent(count, records - count, self._threshold, witnessed, self._rejected, self._first)


def _compare(size: int, own: bytes, seen: bytes, witness: Cosignature) -> Flaw | None:
    if own == seen:
        return None
    text = f"witness `{witness.name}` saw another log at {size} records: this one was written anew"
    return Flaw("anchor/root", text, own.hex(), seen.hex())


def notes(text: str) -> Iterator[str]:
    """The notes in the text of an anchor file: the parts of each, text and signatures, end with an empty line. What was
    half written is passed over.
    """
    for body, signatures in pairwise(text.split("\n\n")):
        if signatures.startswith(MARK) and not body.startswith(MARK):
            yield f"{body}\n\n{signatures}\n"
