"""The head of a log: the link of the next line, the tree over all lines, and the open segment."""

from collections.abc import Callable
from hashlib import sha256

from msgspec.structs import replace

from rtshcua.evidence.merkle import LEAF, MerkleTree, leaf_hash
from rtshcua.evidence.note import Checkpoint, sign
from rtshcua.evidence.records import Record, Signed, encode, next_key_of, unsigned

START = "0" * 64  # the genesis has no line before it

_TOGETHER = 256  # lines


class Head:
    """The number of the next record, the hash of the last line, and the tree over all lines.

    For the open segment: its number `epoch`, its `first` record, its `records` and `octets`, and their digest. Its
    lines are hashed in batches, which is faster, and recording does not wait for it. `after` is the digest of the
    last checkpoint, which the next one names.
    """

    __slots__ = ("_hash", "_lines", "_octets", "_push", "after", "epoch", "first", "prev", "seq", "tree")

    def __init__(self) -> None:
        self.seq = self.first = 0
        self.prev = START
        self.tree = MerkleTree()
        self._push = self.tree.push
        self.epoch = -1
        self.after: bytes | None = None
        self._begin()

    def _begin(self) -> None:
        self.first = self.seq
        self._octets = 0  # lines that are hashed already,
        self._hash = sha256()
        self._lines: list[bytes] = []  # and later lines that are not

    @property
    def records(self) -> int:
        """The number of lines in the segment."""
        return self.seq - self.first

    @property
    def octets(self) -> int:
        """The number of octets in the segment."""
        self._settle()
        return self._octets

    def digest(self) -> str:
        """SHA-256 of the segment so far, hexadecimal."""
        self._settle()
        return self._hash.hexdigest()

    def _settle(self) -> None:
        if self._lines:
            data = b"".join(self._lines)
            self._hash.update(data)
            self._octets += len(data)
            self._lines.clear()

    def add(self, record: Record) -> bytes:
        """Append the line of a record that was made with this head's `prev` and `seq`."""
        line = encode(record)
        self.take(line)
        return line

    def take(self, line: bytes) -> None:
        """Advance past this line, an ordinary record."""
        hasher = LEAF.copy()  # inlined `leaf_hash`
        hasher.update(line)
        leaf = hasher.digest()
        self._push(leaf)
        self.prev = leaf.hex()
        self.seq += 1
        lines = self._lines
        lines.append(line)
        if len(lines) == _TOGETHER:
            self._settle()

    def begin(self, line: bytes, after: bytes) -> None:
        """Advance past this line, a signed record with a checkpoint of this digest. A segment begins with it."""
        self.epoch += 1
        self.after = after
        self._begin()
        self.take(line)

    def seal(self, record: Signed, origin: str, public: bytes, signer: Callable[[bytes], bytes]) -> bytes:
        """The line of a signed record that is made with this head, with its checkpoint over the lines so far."""
        checkpoint = checkpoint_of(record, origin, self)
        line = encode(replace(record, checkpoint=sign(checkpoint, public, signer)))
        self.begin(line, checkpoint.digest())
        return line


def checkpoint_of(record: Signed, origin: str, head: Head) -> Checkpoint:
    """The checkpoint that a signed record must contain when the log is at `head`."""
    own = leaf_hash(encode(unsigned(record)))
    return Checkpoint(origin, head.seq, head.tree.root(), own, next_key_of(record), head.after)
