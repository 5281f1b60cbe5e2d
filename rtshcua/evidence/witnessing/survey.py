"""A whole log that is handed to a witness: its signed notes, found to be of these lines, and the request they make.

Two passes at most, and what is kept is a note for each epoch, however long the log is.
"""

from collections.abc import Callable, Iterable
from typing import NamedTuple

from rtshcua.evidence.finding import Finding, Flaw
from rtshcua.evidence.merkle import Tree, leaf_hash
from rtshcua.evidence.merkle_proofs import consistency_ranges, proof_of
from rtshcua.evidence.note import Checkpoint, parse, split
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import Close, Decision, Effect, encode, unsigned
from rtshcua.evidence.witnessing.submission import note_of
from rtshcua.evidence.witnessing.witness import Request


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
    tree, after, closed = Tree(), None, False
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


def _checked(line: bytes, note: str, tree: Tree, after: bytes | None) -> Checkpoint | Flaw:
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
    assert not isinstance(record, Decision | Effect), "these bear no checkpoint"
    own = leaf_hash(encode(unsigned(record)))
    if checkpoint.record != own:
        text = "the checkpoint is not that of the record that carries it: one of its fields was changed"
        return Flaw("seal/self", text, own.hex(), checkpoint.record.hex())
    return checkpoint


def request_of(log: Survey, known: int | None, lines: Callable[[], Iterable[bytes]]) -> Request | Flaw:
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
    return Request(old, tuple(proof), log.notes[size], tuple(chain))
