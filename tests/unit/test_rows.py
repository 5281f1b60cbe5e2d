"""Tests over the rows of a table: all rows are tried, and those that fail are named."""

import pytest

from virtual.rows import rows


def test_every_row_runs_and_failing_rows_are_named() -> None:
    tried = []

    @rows(("number", "text"), [(1, "a"), pytest.param(2, "b", id="the second"), (3, "c")])
    def odd(number: int, text: str) -> None:
        tried.append((number, text))
        if number == 3:
            pytest.fail("no three")
        assert number % 2

    with pytest.raises(BaseExceptionGroup, match="2 of 3 rows") as failed:
        odd()
    assert tried == [(1, "a"), (2, "b"), (3, "c")]
    notes = [error.__notes__ for error in failed.value.exceptions]
    assert notes == [["in row 2 (the second): number=2, text='b'"], ["in row 3: number=3, text='c'"]]


@pytest.mark.parametrize("ids", [["one", "two"], {"one": 1, "two": 2}, {1: "one", 2: "two"}.get])
def test_rows_are_named_like_parameters(ids: object) -> None:
    @rows("number", [1, 2], ids=ids)
    def none(number: int) -> None:
        raise ValueError(number)

    with pytest.raises(BaseExceptionGroup) as failed:
        none()
    notes = [error.__notes__ for error in failed.value.exceptions]
    assert notes == [["in row 1 (one): number=1"], ["in row 2 (two): number=2"]]


@pytest.fixture(scope="module")
def ten() -> int:
    return 10


@rows("more", [1, 2])
@rows("factor", [2, 3])
def test_rows_take_fixtures_and_tables_multiply(ten: int, factor: int, more: int) -> None:
    assert ten * factor + more in (21, 22, 31, 32)


def test_invalid_rows_are_refused() -> None:
    for table in ([], [(1,)], [pytest.param(1, 2, marks=pytest.mark.soak)]):
        with pytest.raises(AssertionError):
            rows(("one", "other"), table)
    with pytest.raises(AssertionError):
        rows("other", [1])(lambda one: None)
