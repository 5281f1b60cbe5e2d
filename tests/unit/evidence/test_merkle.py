"""The tree against the recursive definition of RFC 9162, and against published roots."""

from hashlib import sha256

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.evidence.merkle import EMPTY, MerkleTree, leaf_hash, node_hash, root_of
from virtual.rows import rows


def definition(entries: list[bytes]) -> bytes:
    """MTH(D[n]) word for word (RFC 9162, section 2.1.1)."""
    n = len(entries)
    if n == 0:
        return sha256(b"").digest()
    if n == 1:
        return sha256(b"\x00" + entries[0]).digest()
    k = 1
    while k * 2 < n:
        k *= 2
    return sha256(b"\x01" + definition(entries[:k]) + definition(entries[k:])).digest()


@given(st.lists(st.binary(max_size=8), max_size=70))
def test_root_is_that_of_the_definition_after_every_leaf(entries: list[bytes]) -> None:
    tree = MerkleTree()
    assert tree.root() == definition([])
    for count, entry in enumerate(entries, 1):
        tree.push(leaf_hash(entry))
        assert tree.size == count
        assert tree.root() == definition(entries[:count])
    assert root_of(map(leaf_hash, entries)) == definition(entries)


# The inputs and roots that Certificate Transparency's own implementations test with.
ENTRIES = [bytes.fromhex(text) for text in (
    "", "00", "10", "2021", "3031", "40414243", "5051525354555657", "606162636465666768696a6b6c6d6e6f",
)]  # fmt: skip
ROOTS = [
    "6e340b9cffb37a989ca544e6bb780a2c78901d3fb33738768511a30617afa01d",
    "fac54203e7cc696cf0dfcb42c92a1d9dbaf70ad9e621f4bd8d98662f00e3c125",
    "aeb6bcfe274b70a14fb067a5e5578264db0fa9b51af5e0ba159158f329e06e77",
    "d37ee418976dd95753c1c73862b9398fa2a2cf9b4ff0fdfe8b30cd95209614b7",
    "4e3bbb1f7b478dcfe71fb631631519a3bca12c9aefca1612bfce4c13a86264d4",
    "76e67dadbcdf1e10e1b74ddc608abd2f98dfb16fbce75277b5232a127f2087ef",
    "ddb89be403809e325750d3d263cd78929c2942b7942a34b77e122c9594a74c8c",
    "5dc9da79a70659a9ad559cb701ded9a2ab9d823aad2f4960cfe370eff4604328",
]


@rows("count", range(1, 9))
def test_known_roots(count: int) -> None:
    assert root_of(map(leaf_hash, ENTRIES[:count])).hex() == ROOTS[count - 1]


def test_prefixes_keep_leaves_and_nodes_apart() -> None:
    left, right = leaf_hash(b"a"), leaf_hash(b"b")
    assert leaf_hash(left + right) != node_hash(left, right)
    assert sha256(b"").digest() == EMPTY


@pytest.mark.parametrize("count", [MerkleTree.TILE - 1, MerkleTree.TILE, MerkleTree.TILE + 1, 2 * MerkleTree.TILE + 5])
def test_root_is_right_for_any_reads_in_between(count: int) -> None:
    entries = [number.to_bytes(2) for number in range(count)]
    for asked in (None, 1, MerkleTree.TILE - 1, MerkleTree.TILE, count // 2):
        tree = MerkleTree()
        for number, entry in enumerate(entries):
            if number == asked:
                assert tree.root() == definition(entries[:number])
            tree.push(leaf_hash(entry))
        assert (tree.size, tree.root()) == (count, definition(entries))
