"""Proofs compared with the recursive definitions of RFC 9162, and invalid proofs."""

from functools import cache
from hashlib import sha256

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.evidence.merkle import EMPTY, root_of
from rtshcua.evidence.merkle_proofs import (
    StoredTree,
    consistency_ranges,
    inclusion_ranges,
    proof_of,
    root_from_inclusion,
    verify_consistency,
    verify_inclusion,
)

LEAVES = [sha256(b"\0%d" % number).digest() for number in range(70)]
MOST = 40


def split(count: int) -> int:
    k = 1
    while k * 2 < count:
        k *= 2
    return k


def mth(leaves: list[bytes]) -> bytes:
    """MTH over leaf hashes (section 2.1.1)."""
    if not leaves:
        return sha256(b"").digest()
    if len(leaves) == 1:
        return leaves[0]
    k = split(len(leaves))
    return sha256(b"\1" + mth(leaves[:k]) + mth(leaves[k:])).digest()


def path(m: int, leaves: list[bytes]) -> list[bytes]:
    """PATH(m, D[n]) (section 2.1.3.1)."""
    if len(leaves) == 1:
        return []
    k = split(len(leaves))
    if m < k:
        return [*path(m, leaves[:k]), mth(leaves[k:])]
    return [*path(m - k, leaves[k:]), mth(leaves[:k])]


def subproof(m: int, leaves: list[bytes], whole: bool) -> list[bytes]:
    """SUBPROOF(m, D[n], b) (section 2.1.4.1)."""
    if m == len(leaves):
        return [] if whole else [mth(leaves)]
    k = split(len(leaves))
    if m <= k:
        return [*subproof(m, leaves[:k], whole), mth(leaves[k:])]
    return [*subproof(m - k, leaves[k:], False), mth(leaves[:k])]


@pytest.fixture(scope="module")
def stored() -> StoredTree:
    tree = StoredTree()
    for leaf in LEAVES:
        tree.push(leaf)
    return tree


def test_the_stored_tree_has_the_root_of_each_prefix(stored: StoredTree) -> None:
    assert stored.root() == mth(LEAVES)
    for size in range(len(LEAVES) + 1):
        assert stored.root(size) == mth(LEAVES[:size]) == root_of(LEAVES[:size])


def test_every_inclusion_proof_is_that_of_the_definition(stored: StoredTree) -> None:
    for size in range(1, MOST):
        root = mth(LEAVES[:size])
        for index in range(size):
            proof = path(index, LEAVES[:size])
            assert stored.inclusion(index, size) == proof
            assert proof_of(inclusion_ranges(index, size), LEAVES) == proof
            assert root_from_inclusion(LEAVES[index], index, size, proof) == root
            assert verify_inclusion(LEAVES[index], index, size, proof, root)


@pytest.mark.unmeasured
def test_every_consistency_proof_is_that_of_the_definition(stored: StoredTree) -> None:
    for second in range(1, MOST):
        for first in range(1, second + 1):
            proof = subproof(first, LEAVES[:second], True)
            assert stored.consistency(first, second) == proof
            assert proof_of(consistency_ranges(first, second), LEAVES) == proof
            assert verify_consistency(first, mth(LEAVES[:first]), second, mth(LEAVES[:second]), proof)


@given(st.integers(1, 70), st.data())
def test_an_inclusion_proof_serves_no_other_leaf_place_size_or_root(size: int, data: st.DataObject) -> None:
    index = data.draw(st.integers(0, size - 1))
    other_index, other_size = data.draw(st.integers(-1, 71)), data.draw(st.integers(-1, 71))
    root, proof = mth(LEAVES[:size]), path(index, LEAVES[:size])
    assert not verify_inclusion(sha256(b"").digest(), index, size, proof, root)
    assert not verify_inclusion(LEAVES[index], index, size, proof, EMPTY)
    assert not verify_inclusion(LEAVES[index], index, size, [*proof, EMPTY], root)
    for at in range(len(proof)):
        assert not verify_inclusion(LEAVES[index], index, size, proof[:at] + proof[at + 1 :], root)
        assert not verify_inclusion(LEAVES[index], index, size, [*proof[:at], EMPTY, *proof[at + 1 :]], root)
    if 0 <= other_index < size != index:
        assert (verify_inclusion(LEAVES[index], other_index, size, proof, root)) == (other_index == index)
    if verify_inclusion(LEAVES[index], index, other_size, proof, root):
        # Sizes between which the path turns the same way are not told apart by a path: that is what roots are for.
        assert len(inclusion_ranges(index, other_size)) == len(proof)


@given(st.integers(1, 70), st.data())
def test_a_consistency_proof_serves_no_other_trees(second: int, data: st.DataObject) -> None:
    first = data.draw(st.integers(1, second))
    old, new = mth(LEAVES[:first]), mth(LEAVES[:second])
    proof = subproof(first, LEAVES[:second], True)
    wrong = sha256(b"another").digest()
    assert not verify_consistency(first, wrong, second, new, proof)
    assert not verify_consistency(first, old, second, wrong, proof)
    assert not verify_consistency(first, old, second, new, [*proof, wrong])
    for at in range(len(proof)):
        assert not verify_consistency(first, old, second, new, proof[:at] + proof[at + 1 :])
        assert not verify_consistency(first, old, second, new, [*proof[:at], wrong, *proof[at + 1 :]])


def test_every_tree_begins_with_the_empty_one_and_with_itself() -> None:
    root = mth(LEAVES[:5])
    assert consistency_ranges(0, 5) == consistency_ranges(5, 5) == consistency_ranges(0, 0) == []
    assert verify_consistency(0, EMPTY, 5, root, [])
    assert verify_consistency(5, root, 5, root, [])
    assert verify_consistency(0, EMPTY, 0, EMPTY, [])
    assert not verify_consistency(0, root, 5, root, [])
    assert not verify_consistency(0, EMPTY, 0, root, [])
    assert not verify_consistency(0, EMPTY, 5, root, [root])
    assert not verify_consistency(5, root, 5, EMPTY, [])
    assert not verify_consistency(5, root, 5, root, [root])
    assert not verify_consistency(6, root, 5, root, [])
    assert not verify_consistency(-1, EMPTY, 5, root, [])
    assert not verify_consistency(3, root, 5, root, [])


def test_proof_of_wrong_length_is_refused() -> None:
    for first, second in ((3, 7), (1, 8), (6, 9), (4, 5)):
        old, new = mth(LEAVES[:first]), mth(LEAVES[:second])
        proof = subproof(first, LEAVES[:second], True)
        for wrong in ([*proof, EMPTY], [*proof, EMPTY, EMPTY], proof[:-1], []):
            assert not verify_consistency(first, old, second, new, wrong)
    proof = path(3, LEAVES[:7])
    for wrong in ([*proof, EMPTY], [*proof, EMPTY, EMPTY], proof[:-1], []):
        assert root_from_inclusion(LEAVES[3], 3, 7, wrong) is None


@pytest.mark.parametrize(("index", "size"), [(0, 0), (5, 5), (-1, 5), (6, 5)])
def test_a_leaf_outside_the_tree_has_no_proof(index: int, size: int, stored: StoredTree) -> None:
    with pytest.raises(ValueError, match="not in a tree"):
        inclusion_ranges(index, size)
    assert root_from_inclusion(LEAVES[0], index, size, []) is None


@pytest.mark.parametrize(("first", "second"), [(-1, 4), (5, 4)])
def test_a_tree_does_not_begin_with_a_larger_one(first: int, second: int) -> None:
    with pytest.raises(ValueError, match="does not begin"):
        consistency_ranges(first, second)


def test_leaves_that_end_too_early_give_no_proof() -> None:
    with pytest.raises(ValueError, match="fewer than 9 leaves"):
        proof_of(inclusion_ranges(3, 9), LEAVES[:8])


def test_cache_of_ranges_is_bounded() -> None:
    @cache
    def root(start: int, end: int) -> bytes:
        """As RFC 9162, 2.1.1, defines it."""
        if end - start == 1:
            return leaves[start]
        middle = start + (1 << (end - start - 1).bit_length() - 1)
        return sha256(b"\1" + root(start, middle) + root(middle, end)).digest()

    tree = StoredTree()
    leaves = [sha256(b"\0%d" % number).digest() for number in range(1_100)]
    for leaf in leaves:
        tree.push(leaf)
    assert [tree.root(size) for size in range(1_101)] == [EMPTY, *(root(0, size) for size in range(1, 1_101))]


def test_stored_tree_is_restored(stored: StoredTree) -> None:
    half = StoredTree()
    for leaf in LEAVES[:33]:
        half.push(leaf)
    again = StoredTree(half.nodes, 33)
    for leaf in LEAVES[33:]:
        again.push(leaf)
    assert again.nodes == stored.nodes
    with pytest.raises(ValueError, match="takes"):
        StoredTree(bytearray(32), 2)
    with pytest.raises(ValueError, match="has 70 leaves"):
        stored.root(71)
    with pytest.raises(ValueError, match="has 70 leaves"):
        stored.inclusion(0, 71)
    with pytest.raises(ValueError, match="has 70 leaves"):
        stored.consistency(1, 71)
