"""Kleene's tables by hand, and their lifting to sets by definition."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.decision.evaluate import known
from rtshcua.decision.values import ABSENT, AND, EVERYWHERE, FALSE, MAYBE, NOT, OR, PRESENT, TRUE, UNKNOWN, singles
from virtual.rows import rows

T, F, U = TRUE, FALSE, UNKNOWN
KLEENE_AND = {(T, T): T, (T, F): F, (T, U): U, (F, F): F, (F, U): F, (U, U): U}
KLEENE_OR = {(T, T): T, (T, F): T, (T, U): T, (F, F): F, (F, U): U, (U, U): U}


@rows(("pair", "result"), KLEENE_AND.items())
def test_and(pair: tuple[int, int], result: int) -> None:
    assert AND[pair[0]][pair[1]] == AND[pair[1]][pair[0]] == result


@rows(("pair", "result"), KLEENE_OR.items())
def test_or(pair: tuple[int, int], result: int) -> None:
    assert OR[pair[0]][pair[1]] == OR[pair[1]][pair[0]] == result


def test_not() -> None:
    assert (NOT[T], NOT[F], NOT[U]) == (F, T, U)


@given(st.integers(1, 7), st.integers(1, 7))
def test_set_truth_is_exactly_that_of_members(a: int, b: int) -> None:
    assert set(singles(AND[a][b])) == {AND[x][y] for x in singles(a) for y in singles(b)}
    assert set(singles(OR[a][b])) == {OR[x][y] for x in singles(a) for y in singles(b)}
    assert set(singles(NOT[a])) == {NOT[x] for x in singles(a)}


@rows(("truth", "result"), [(T, T), (F, F), (U, U), (T | F, F), (T | U, U), (F | U, F), (T | F | U, F)])
def test_false_and_unknown_together_are_false_everywhere(truth: int, result: int) -> None:
    assert EVERYWHERE[truth] == result


@pytest.mark.parametrize("truth", [TRUE, FALSE, TRUE | FALSE])
def test_maybe_missing_value_may_be_unknown(truth: int) -> None:
    assert [known(truth, gap) for gap in (PRESENT, MAYBE, ABSENT)] == [truth, truth | UNKNOWN, UNKNOWN]
