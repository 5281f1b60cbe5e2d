"""A Merkle tree whose nodes are kept, so that a proof is looked up instead of computed.

What is kept: the roots of all perfect subtrees, 32 octets each, in the order in which they become whole. Leaf n comes
after 2n - popcount(n) others, and the perfect trees that end with it come right after it, the smaller ones first; so
each node has a fixed place, the store only ever grows, and it may be a file mapped into memory. It costs at most
64 octets a leaf. Nobody needs to trust it: a wrong hash in it gives a proof that does not verify.
"""

from rtshcua.evidence.merkle import EMPTY, node_hash
from rtshcua.evidence.merkle_proofs import Range, consistency_ranges, inclusion_ranges

_HASH = 32
_MOST_EDGES = 1_024


class StoredTree:
    """The tree of the leaves pushed so far. `nodes` are those of an earlier tree; they are taken as they are."""

    __slots__ = ("_edges", "nodes", "size")

    def __init__(self, nodes: bytearray | None = None, size: int = 0) -> None:
        self.nodes = bytearray() if nodes is None else nodes
        self.size = size
        self._edges: dict[Range, bytes] = {}  # worked out before: ranges at the end of a tree, which are not kept
        if len(self.nodes) != _place(size, 0):
            raise ValueError(f"a tree of {size} leaves is kept in {_place(size, 0)} octets, not {len(self.nodes)}")

    def push(self, leaf: bytes) -> None:
        """Adds a leaf by its hash, and the nodes that it makes whole."""
        nodes, number = self.nodes, self.size
        nodes += leaf
        node, level = leaf, 0
        while number >> level & 1:
            left = _place((number >> level << level) - 1, level)
            node = node_hash(bytes(nodes[left : left + _HASH]), node)
            nodes += node
            level += 1
        self.size = number + 1

    def root(self, size: int | None = None) -> bytes:
        """The root of the tree, or of its first `size` leaves."""
        size = self.size if size is None else size
        self._check(size)
        return self._hash(0, size) if size else EMPTY

    def inclusion(self, index: int, size: int) -> list[bytes]:
        """The proof that leaf `index` is in the tree of the first `size` leaves."""
        self._check(size)
        return [self._hash(start, end) for start, end in inclusion_ranges(index, size)]

    def consistency(self, first: int, second: int) -> list[bytes]:
        """The proof that the tree of the first `second` leaves begins with that of the first `first`."""
        self._check(second)
        return [self._hash(start, end) for start, end in consistency_ranges(first, second)]

    def _check(self, size: int) -> None:
        if not 0 <= size <= self.size:
            raise ValueError(f"the tree has {self.size} leaves, not {size}")

    def _hash(self, start: int, end: int) -> bytes:
        """The root over a range as `inclusion_ranges` gives it: it begins where a perfect tree of its size would."""
        width = end - start
        if not width & width - 1:
            place = _place(end - 1, width.bit_length() - 1)
            return bytes(self.nodes[place : place + _HASH])
        edge = self._edges.get((start, end))
        if edge is None:
            if len(self._edges) >= _MOST_EDGES:
                self._edges.clear()
            middle = start + (1 << width.bit_length() - 1)
            edge = self._edges[start, end] = node_hash(self._hash(start, middle), self._hash(middle, end))
        return edge


def _place(last: int, level: int) -> int:
    """Where the node over 2**level leaves stands of which `last` is the last one."""
    return (2 * last - last.bit_count() + level) * _HASH
