"""A log as its witnesses are shown it: the signed notes, and the tree that proves one to begin with another.

Line by line while it is written (`Submission`), or whole, from a file that is handed to a witness (`survey`): in two
passes at most, and what is kept is a note for each epoch, however long the log is.
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

#: the most notes that go behind a checkpoint in one request; a witness that missed more is led on in several
MOST_NOTES: Final = 32


class _Bearer(msgspec.Struct):
    """A signed record, as far as a witness is shown it."""

    checkpoint: str


_read = msgspec.json.Decoder(_Bearer).decode


def note_of(line: bytes) -> str | None:
    """The checkpoint that a line carries; None for a line that is not signed."""
    if not is_signed(line):
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

    def again(self, size: int) -> CosignRequest:
        """To have the checkpoint of this size cosigned once more, by a witness whose answer was lost."""
        return CosignRequest(size, (), self._notes[bisect_left(self._sizes, size)])

    def request(self, known: int | None, records: int) -> CosignRequest | None:
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
        return CosignRequest(self._sizes[old], tuple(proof), self._notes[aim], tuple(self._notes[index + 1 : aim]))


def anchor(note: str, answer: str, witnesses: Iterable[bytes]) -> str | None:
    """The anchor of a note: with those lines of a witness's answer that one of the witnesses made; None without any."""
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
        """Whose log it is."""
        return next(iter(self.notes.values())).partition("\n")[0]

    @property
    def size(self) -> int:
        """That of the last checkpoint."""
        return max(self.notes)


def survey(lines: Iterable[bytes]) -> Survey | Finding:
    """The notes of a log, each with the root that these lines give, of the record that carries it, and after the one
    before it; a last line that is not whole is passed over.

    A checkpoint that is not so is not worth anybody's signature, whatever proof comes with it: the leaves are computed
    here, and not believed.
    """
    tree, after, closed = MerkleTree(), None, False
    notes: dict[int, str] = {}
    for line in lines:
        if closed:
            return Flaw("close/junk-after", "there is something after the signed close").at(tree.size)
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
    """The checkpoint of a signed record that stands after the lines of the tree; its signature is looked at later."""
    checkpoint = parse(split(note)[0])
    if isinstance(checkpoint, Flaw):
        return checkpoint
    if (checkpoint.size, checkpoint.root) != (tree.size, tree.root()):
        text = "the checkpoint is not that of the records before it"
        return Flaw("seal/root", text, checkpoint.root.hex(), tree.root().hex())
    if checkpoint.after != after:
        return Flaw("seal/after", "the checkpoint follows another one than that of the signed record before")
    record = read(line)
    if isinstance(record, Flaw):
        return record
    assert not isinstance(record, DecisionRecord | Effect), "these bear no checkpoint"
    own = leaf_hash(encode(unsigned(record)))
    if checkpoint.record != own:
        text = "the checkpoint is not that of the record that carries it: one of its fields was changed"
        return Flaw("seal/self", text, own.hex(), checkpoint.record.hex())
    return checkpoint


def request_of(log: Survey, known: int | None, lines: Callable[[], Iterable[bytes]]) -> CosignRequest | Flaw:
    """What to ask a witness that cosigned the tree of `known` leaves last (None: nothing) about the end of the log.

    `lines` gives the lines once more.
    """
    if known is not None and known not in log.notes:
        if known >= log.records:
            text = "the witness saw a longer log: the end of this one was cut off"
            return Flaw("anchor/beyond", text, f"{log.records} records", f"{known + 1} records or more")
        return Flaw("anchor/root", "the witness saw a checkpoint that this log does not have", "none", str(known))
    size, old = log.size, known or 0
    proof = proof_of(consistency_ranges(old, size), map(leaf_hash, lines())) if 0 < old < size else []
    after = -1 if known is None else known
    chain = [note for place, note in log.notes.items() if after < place < size]
    return CosignRequest(old, tuple(proof), log.notes[size], tuple(chain))
