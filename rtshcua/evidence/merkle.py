"""The Merkle tree of RFC 9162, section 2.1.1, over SHA-256, grown leaf by leaf in logarithmic memory."""

from collections.abc import Iterable
from hashlib import sha256
from typing import ClassVar

LEAF = sha256(b"\x00")  # the constant beginning of a leaf's hash
_NODE = sha256(b"\x01")
EMPTY = sha256(b"").digest()


def leaf_hash(entry: bytes) -> bytes:
    """SHA-256(0x00 || entry)."""
    hasher = LEAF.copy()  # faster than joining the prefix to the bytes
    hasher.update(entry)
    return hasher.digest()


def node_hash(left: bytes, right: bytes) -> bytes:
    """SHA-256(0x01 || left || right)."""
    hasher = _NODE.copy()
    hasher.update(left + right)
    return hasher.digest()


class MerkleTree:
    """The tree of the leaves so far; it holds one hash for each set bit of `size`.

    Leaves are combined when the root is read, and after `TILE` leaves at the latest, so that most calls of `push`
    compute no hash.
    """

    TILE: ClassVar = 256

    __slots__ = ("_leaves", "_perfect", "size")

    def __init__(self) -> None:
        self.size = 0
        self._perfect: list[bytes] = []  # roots of perfect subtrees, the largest first,
        self._leaves: list[bytes] = []  # and the leaves after them

    def push(self, leaf: bytes) -> None:
        """Add a leaf by its hash."""
        leaves = self._leaves
        leaves.append(leaf)
        self.size += 1
        if len(leaves) == self.TILE:
            self._fold()

    def graft(self, height: int, node: bytes) -> None:
        """Add a perfect subtree of 2**height leaves by its root; `size` must be a multiple of that."""
        self._fold()
        self._join(self.size >> height, (node,))
        self.size += 1 << height

    def _fold(self) -> None:
        self._join(self.size - len(self._leaves), self._leaves)
        self._leaves.clear()

    def _join(self, number: int, nodes: Iterable[bytes]) -> None:
        """Append nodes of one size, of which `number` precede them in the tree: each is joined to the preceding ones
        of its size, as often as its number ends in ones.
        """
        perfect = self._perfect
        for node in nodes:
            bits = number
            while bits & 1:
                node = node_hash(perfect.pop(), node)
                bits >>= 1
            perfect.append(node)
            number += 1

    def root(self) -> bytes:
        """The root hash MTH(D[n]) of the leaves so far."""
        self._fold()
        if not self._perfect:
            return EMPTY
        *rest, node = self._perfect
        while rest:
            node = node_hash(rest.pop(), node)
        return node


def root_of(leaves: Iterable[bytes]) -> bytes:
    """The root hash over leaf hashes."""
    tree = MerkleTree()
    for leaf in leaves:
        tree.push(leaf)
    return tree.root()
