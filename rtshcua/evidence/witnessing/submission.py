"""The parts of a log that are submitted to witnesses: the signed notes, and the tree for consistency proofs.

Line by line while the log is written (`Submission`), or from a complete file (`survey`): at most two passes,
keeping one note for each epoch.
"""

from bisect import bisect_left
from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

import msgspec

from rtshcua.evidence.finding import Finding, Flaw
from rtshcua.evidence.merkle import MerkleTree, leaf_hash
from rtshcua.evidence.merkle_proofs import StoredTree, consistency_ranges, proof_of
from rtshcua.evidence.note import Checkpoint, parse, split
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import Close, DecisionRecord, Effect, encode, is_signed, unsigned
from rtshcua.evidence.witnessing.cosign import Cosignature, read_cosignature
from rtshcua.evidence.witnessing.witness import CosignRequest

#: the most notes of a chain in one request; a witness that missed more is updated in several requests
MOST_NOTES: Final = 32


class _Bearer(msgspec.Struct):
    """The parts of a signed record that a witness receives."""

    checkpoint: str


_read = msgspec.json.Decoder(_Bearer).decode


def note_of(line: bytes) -> str | None:
    """The checkpoint in a line; None for a line that is not signed."""
    if not is_signed(line):
        return None
    try:
        return _read(line).checkpoint
    except msgspec.DecodeError:
        return None


class Submission:
    """Processes the lines of one log in order. It keeps at most 64 octets a line, and a note for each epoch."""

    def __init__(self) -> None:
        self._tree = StoredTree()
        self._sizes: list[int] = []
        self._notes: list[str] = []

    @property
    def records(self) -> int:
        """The number of lines so far."""
        return self._tree.size

    def take(self, line: bytes) -> str | None:
        """Add the next line; return its note if it is signed."""
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

    def again(self, size: int) -> CosignRequest:
        """Have the checkpoint of this size cosigned again, by a witness whose answer was lost."""
        return CosignRequest(size, (), self._notes[bisect_left(self._sizes, size)])

    def request(self, known: int | None, records: int) -> CosignRequest | None:
        """The request to a witness that last cosigned the tree of `known` leaves (0: none, as far as known), so that
        it cosigns the last checkpoint among the first `records` lines, or an intermediate one.

        None if there is nothing to cosign, or if the witness's size is not a checkpoint of this log.
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
        return CosignRequest(self._sizes[old], tuple(proof), self._notes[aim], tuple(self._notes[index + 1 : aim]))


def anchor(note: str, answer: str, witnesses: Iterable[bytes]) -> str | None:
    """The anchor made of a note and those lines of an answer that trusted witnesses signed; None without any."""
    text, keys = split(note)[0], tuple(witnesses)
    made = [
        line for line in answer.splitlines(keepends=True) if isinstance(read_cosignature(line, text, keys), Cosignature)
    ]
    return note + "".join(made) if made else None


class Survey(NamedTuple):
    """The signed notes of a log of so many lines, by size, the smallest first."""

    records: int
    notes: dict[int, str]

    @property
    def origin(self) -> str:
        """The origin of the log."""
        return next(iter(self.notes.values())).partition("\n")[0]

    @property
    def size(self) -> int:
        """The size at the last checkpoint."""
        return max(self.notes)


def survey(lines: Iterable[bytes]) -> Survey | Finding:
    """The notes of a log. Each is checked against the root computed from these lines, the record that carries it, and
    the note before it; an incomplete last line is skipped.

    A checkpoint that fails the check must not be cosigned, whatever proof it comes with: the leaves are computed
    here, not trusted.
    """
    tree, after, closed = MerkleTree(), None, False
    notes: dict[int, str] = {}
    for line in lines:
        if closed:
            return Flaw("close/junk-after", "the signed close is followed by more data").at(tree.size)
        if not line.endswith(b"\n"):
            break
        note = note_of(line)
        if note is not None:
            checkpoint = _checked(line, note, tree, after)
            if isinstance(checkpoint, Flaw):
                return checkpoint.at(tree.size)
            notes[tree.size], after = note, checkpoint.digest()
            closed = isinstance(read(line), Close)
        tree.push(leaf_hash(line))
    if 0 not in notes:
        return Flaw("genesis/missing", "the log does not begin with a signed genesis").at(0)
    return Survey(tree.size, notes)


def _checked(line: bytes, note: str, tree: MerkleTree, after: bytes | None) -> Checkpoint | Flaw:
    """The checkpoint of a signed record that follows the lines of the tree; its signature is checked later."""
    checkpoint = parse(split(note)[0])
    if isinstance(checkpoint, Flaw):
        return checkpoint
    if (checkpoint.size, checkpoint.root) != (tree.size, tree.root()):
        text = "the checkpoint does not match the records before it"
        return Flaw("seal/root", text, checkpoint.root.hex(), tree.root().hex())
    if checkpoint.after != after:
        return Flaw("seal/after", "the checkpoint does not follow that of the previous signed record")
    record = read(line)
    if isinstance(record, Flaw):
        return record
    assert not isinstance(record, DecisionRecord | Effect), "these records have no checkpoint"
    own = leaf_hash(encode(unsigned(record)))
    if checkpoint.record != own:
        text = "the checkpoint does not match the record that carries it: a field was changed"
        return Flaw("seal/self", text, own.hex(), checkpoint.record.hex())
    return checkpoint


def request_of(log: Survey, known: int | None, lines: Callable[[], Iterable[bytes]]) -> CosignRequest | Flaw:
    """The request about the end of the log, to a witness that last cosigned the tree of `known` leaves (None:
    nothing).

    `lines` iterates over the lines again.
    """
    if known is not None and known not in log.notes:
        if known >= log.records:
            text = "the witness saw a longer log: the end of this one was removed"
            return Flaw("anchor/beyond", text, f"{log.records} records", f"{known + 1} records or more")
        return Flaw("anchor/root", "the witness saw a checkpoint that is not in this log", "none", str(known))
    size, old = log.size, known or 0
    proof = proof_of(consistency_ranges(old, size), map(leaf_hash, lines())) if 0 < old < size else []
    after = -1 if known is None else known
    chain = [note for place, note in log.notes.items() if after < place < size]
    return CosignRequest(old, tuple(proof), log.notes[size], tuple(chain))
