"""A log as its witnesses are shown it: the signed notes, and the tree that proves one to begin with another."""

from bisect import bisect_left
from collections.abc import Iterable
from typing import Final

import msgspec

from rtshcua.evidence.merkle import leaf_hash
from rtshcua.evidence.merkle_proofs import StoredTree
from rtshcua.evidence.note import split
from rtshcua.evidence.witnessing.cosign import Cosignature, read_cosignature
from rtshcua.evidence.witnessing.witness import Request

#: the most notes that go behind a checkpoint in one request; a witness that missed more is led on in several
MOST_NOTES: Final = 32

_MARK: Final = b',"checkpoint":"'  # no text can hold it, for a quote inside a text stands behind a backslash


class _Bearer(msgspec.Struct):
    """A signed record, as far as a witness is shown it."""

    checkpoint: str


_read = msgspec.json.Decoder(_Bearer).decode


def note_of(line: bytes) -> str | None:
    """The checkpoint that a line carries; None for a line that is not signed."""
    if _MARK not in line:
        return None
    try:
        return _read(line).checkpoint
    except msgspec.DecodeError:
        return None


class Submission:
    """Takes the lines of one log in order. It keeps at most 64 octets a line, and a note for each epoch."""

    def __init__(self) -> None:
        self._tree = StoredTree()
        self._sizes: list[int] = []
        self._notes: list[str] = []

    @property
    def records(self) -> int:
        """How many lines were taken."""
        return self._tree.size

    def take(self, line: bytes) -> str | None:
        """Take the next line; gives its note, if it is signed."""
        note = note_of(line)
        if note is not None:
            self._sizes.append(self._tree.size)
            self._notes.append(note)
        self._tree.push(leaf_hash(line))
        return note

    def last(self, records: int) -> int | None:
        """The size of the last checkpoint among the first so many lines."""
        index = bisect_left(self._sizes, records)
        return self._sizes[index - 1] if index else None

    def has(self, size: int) -> bool:
        """Whether the log has a checkpoint of this size."""
        index = bisect_left(self._sizes, size)
        return self._sizes[index : index + 1] == [size]

    def again(self, size: int) -> Request:
        """To have the checkpoint of this size cosigned once more, by a witness whose answer was lost."""
        return Request(size, (), self._notes[bisect_left(self._sizes, size)])

    def request(self, known: int | None, records: int) -> Request | None:
        """What to send a witness that cosigned the tree of `known` leaves last, or is thought to know nothing, so that
        it cosigns the last checkpoint among the first `records` lines, or one on the way there.

        None when there is nothing to cosign, or when what the witness knows is no checkpoint of this log.
        """
        index = -1
        if known is not None:
            if not self.has(known):
                return None
            index = bisect_left(self._sizes, known)
        aim = min(bisect_left(self._sizes, records) - 1, index + 1 + MOST_NOTES)
        if aim <= index:
            return None
        old = max(index, 0)
        proof = self._tree.consistency(self._sizes[old], self._sizes[aim])
        return Request(self._sizes[old], tuple(proof), self._notes[aim], tuple(self._notes[index + 1 : aim]))


def anchor(note: str, answer: str, witnesses: Iterable[bytes]) -> str | None:
    """The anchor of a note: with those lines of a witness's answer that one of the witnesses made; None without any."""
    text, keys = split(note)[0], tuple(witnesses)
    made = [
        line for line in answer.splitlines(keepends=True) if isinstance(read_cosignature(line, text, keys), Cosignature)
    ]
    return note + "".join(made) if made else None
