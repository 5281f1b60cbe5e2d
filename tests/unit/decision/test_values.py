"""The values of a slot, by hand."""

from rtshcua.decision.values import ABSENT, MAYBE, MISSING, PRESENT, interval, maybe, members, point


def test_kinds_of_known_values() -> None:
    assert point(7) == (7, 7, PRESENT, None)
    assert interval(-2, 5) == (-2, 5, PRESENT, None)
    assert members([9, 4, 6]) == (4, 9, PRESENT, frozenset({4, 6, 9}))
    assert maybe(members([3])) == (3, 3, MAYBE, frozenset({3}))
    assert maybe(MISSING)[2] == ABSENT
