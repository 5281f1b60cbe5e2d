"""Merkle proofs of RFC 9162: inclusion of a leaf (section 2.1.3), and consistency of two trees (section 2.1.4).

A proof is a list of hashes, each the root over one range of leaves. `inclusion_ranges` and `consistency_ranges`
return the ranges in the order of the proof. The hashes come from `StoredTree`, which keeps the nodes, or from
`proof_of`, which reads all leaves once.
"""

from collections.abc import Iterable, Iterator, Sequence

from rtshcua.evidence.merkle import EMPTY, MerkleTree, node_hash

#: leaves from the first number to before the second
Range = tuple[int, int]

_HASH = 32
_MOST_EDGES = 1_024


def inclusion_ranges(index: int, size: int) -> list[Range]:
    """The ranges whose hashes prove leaf `index` in the tree of `size` leaves (2.1.3.1), from its sibling upwards.

    Raises ValueError unless 0 <= index < size.
    """
    if not 0 <= index < size:
        raise ValueError(f"leaf {index} is not in a tree of {size}")
    ranges, start, end = [], 0, size
    while end - start > 1:
        middle = start + (1 << (end - start - 1).bit_length() - 1)
        if index < middle:
            ranges.append((middle, end))
            end = middle
        else:
            ranges.append((start, middle))
            start = middle
    ranges.reverse()
    return ranges


def consistency_ranges(first: int, second: int) -> list[Range]:
    """The ranges whose hashes prove that the tree of `second` leaves begins with that of `first` (2.1.4.1).

    The list is empty for the empty tree and for two trees of one size. Raises ValueError unless 0 <= first <=
    second.
    """
    if not 0 <= first <= second:
        raise ValueError(f"a tree of {second} leaves does not begin with {first}")
    ranges: list[Range] = []
    if first == 0:
        return ranges
    start, end = 0, second
    while first < end:
        middle = start + (1 << (end - start - 1).bit_length() - 1)
        if first <= middle:
            ranges.append((middle, end))
            end = middle
        else:
            ranges.append((start, middle))
            start = middle
    if start:  # else it is the whole first tree, whose root the verifier has
        ranges.append((start, end))
    ranges.reverse()
    return ranges


def proof_of(ranges: Sequence[Range], leaves: Iterable[bytes]) -> list[bytes]:
    """The hashes over `ranges`, from one pass over all leaf hashes with a few of them in memory.

    Raises ValueError if the leaves end before the last range does.
    """
    pairs, found = _numbered(leaves), {}
    for start, end in sorted(ranges):
        tree = MerkleTree()
        for number, leaf in pairs:
            if number >= start:
                tree.push(leaf)
            if number == end - 1:
                break
        if tree.size != end - start:
            raise ValueError(f"fewer than {end} leaves")
        found[start] = tree.root()
    return [found[start] for start, _ in ranges]


def _numbered(leaves: Iterable[bytes]) -> Iterator[tuple[int, bytes]]:
    yield from enumerate(leaves)


def root_from_inclusion(leaf: bytes, index: int, size: int, proof: Sequence[bytes]) -> bytes | None:
    """The root of the tree of `size` leaves whose leaf `index` is `leaf`, from its proof (2.1.3.2); None for a wrong
    proof.
    """
    if not 0 <= index < size:
        return None
    node, last, root = index, size - 1, leaf
    for sibling in proof:
        if not last:
            return None  # longer than any path
        if node & 1 or node == last:
            root = node_hash(sibling, root)
            while not node & 1 and node:  # levels at which this node has no sibling
                node >>= 1
                last >>= 1
        else:
            root = node_hash(root, sibling)
        node >>= 1
        last >>= 1
    return None if last else root


def verify_inclusion(leaf: bytes, index: int, size: int, proof: Sequence[bytes], root: bytes) -> bool:
    """Whether `proof` proves the leaf hash `leaf` at `index` of the tree of `size` leaves with this root (2.1.3.2)."""
    return root_from_inclusion(leaf, index, size, proof) == root


def verify_consistency(first: int, first_root: bytes, second: int, second_root: bytes, proof: Sequence[bytes]) -> bool:
    """Whether `proof` proves that the tree of `second` leaves begins with that of `first` (2.1.4.2).

    Every tree begins with the empty one, whose root is fixed: that proof is empty, as is the proof of two equal
    trees.
    """
    if not 0 <= first <= second:
        return False
    if first == second:
        return not proof and first_root == second_root and (first > 0 or first_root == EMPTY)
    if first == 0:
        return not proof and first_root == EMPTY
    path = list(proof)
    if not first & first - 1:
        path.insert(0, first_root)  # the first tree is perfect, and so a node of the second
    if not path:
        return False
    node, last = first - 1, second - 1
    while node & 1:
        node >>= 1
        last >>= 1
    old = new = path[0]
    for sibling in path[1:]:
        if not last:
            return False
        if node & 1 or node == last:
            old, new = node_hash(sibling, old), node_hash(sibling, new)
            while not node & 1 and node:
                node >>= 1
                last >>= 1
        else:
            new = node_hash(new, sibling)
        node >>= 1
        last >>= 1
    return not last and old == first_root and new == second_root


class StoredTree:
    """A Merkle tree that keeps its nodes, so that a proof is looked up and not computed.

    `nodes` are those of an earlier tree, taken without a check. The store holds the roots of all perfect subtrees,
    32 octets each, in the order in which they are completed. Leaf n comes after 2n - popcount(n) other nodes, and
    is followed by the perfect trees that end with it, the smaller ones first. So each node has a fixed place, the
    store only grows, and it may be a file mapped into memory. It takes at most 64 octets a leaf. It need not be
    trusted: a wrong hash gives a proof that does not verify.
    """

    __slots__ = ("_edges", "nodes", "size")

    def __init__(self, nodes: bytearray | None = None, size: int = 0) -> None:
        self.nodes = bytearray() if nodes is None else nodes
        self.size = size
        self._edges: dict[Range, bytes] = {}  # cached: ranges at the end of a tree, which are not stored
        if len(self.nodes) != _place(size, 0):
            raise ValueError(f"a tree of {size} leaves takes {_place(size, 0)} octets, not {len(self.nodes)}")

    def push(self, leaf: bytes) -> None:
        """Add a leaf by its hash, and the nodes that it completes."""
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
        """The consistency proof between the trees of sizes `first` and `second`."""
        self._check(second)
        return [self._hash(start, end) for start, end in consistency_ranges(first, second)]

    def _check(self, size: int) -> None:
        if not 0 <= size <= self.size:
            raise ValueError(f"the tree has {self.size} leaves, not {size}")

    def _hash(self, start: int, end: int) -> bytes:
        """The root over a range as `inclusion_ranges` returns it: it begins where a perfect tree of its size would."""
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
    """The place of the node over 2**level leaves whose last leaf is `last`."""
    return (2 * last - last.bit_count() + level) * _HASH
