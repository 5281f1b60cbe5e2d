"""The Merkle tree of RFC 9162 section 2.1.1 over SHA-256, grown leaf by leaf in logarithmic memory."""

from collections.abc import Iterable
from hashlib import sha256

_LEAF = sha256(b"\x00")
_NODE = sha256(b"\x01")
EMPTY = sha256(b"").digest()


def leaf_hash(entry: bytes) -> bytes:
    """SHA-256(0x00 || entry)."""
    hasher = _LEAF.copy()  # cheaper than joining the prefix to the bytes
    hasher.update(entry)
    return hasher.digest()


def node_hash(left: bytes, right: bytes) -> bytes:
    """SHA-256(0x01 || left || right)."""
    hasher = _NODE.copy()
    hasher.update(left + right)
    return hasher.digest()


class Tree:
    """The tree of the leaves pushed so far; it holds one hash for each set bit of `size`."""

    __slots__ = ("_perfect", "size")

    def __init__(self) -> None:
        self.size = 0
        self._perfect: list[bytes] = []  # roots of perfect subtrees, the largest first

    def push(self, leaf: bytes) -> None:
        """Adds a leaf by its hash."""
        perfect, bits = self._perfect, self.size
        while bits & 1:
            leaf = node_hash(perfect.pop(), leaf)
            bits >>= 1
        perfect.append(leaf)
        self.size += 1

    def root(self) -> bytes:
        """The root hash MTH(D[n]) of the leaves so far."""
        if not self._perfect:
            return EMPTY
        *rest, node = self._perfect
        while rest:
            node = node_hash(rest.pop(), node)
        return node


def root_of(leaves: Iterable[bytes]) -> bytes:
    """The root hash over leaf hashes."""
    tree = Tree()
    for leaf in leaves:
        tree.push(leaf)
    return tree.root()
