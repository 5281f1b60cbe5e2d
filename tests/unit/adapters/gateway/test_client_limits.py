"""Limits of the gateway's clients."""

from hypothesis import given
from hypothesis import strategies as st

from rtshcua.adapters.gateway.clients import Bucket

S = 1_000_000


@given(
    st.integers(1, 1_000),
    st.integers(1, 300),
    st.lists(st.tuples(st.integers(0, S), st.integers(0, 20)), max_size=60),
)
def test_bucket_gives_no_more_than_its_rate_and_burst(rate: int, burst: int, asked: list[tuple[int, int]]) -> None:
    """In every interval, at most the burst and the rate's share; and what is below that is given."""
    bucket, now_us, level, given_at = Bucket(rate, burst), 1_000 * S, burst * (S // rate), list[tuple[int, int]]()
    each_us = S // rate
    for wait_us, amount in asked:
        now_us += wait_us
        level = min(burst * each_us, level + wait_us)
        took = bucket.take(amount, now_us)
        assert took == (amount * each_us <= level)
        if took:
            level -= amount * each_us
            given_at.append((now_us, amount))
    for first, (start_us, _) in enumerate(given_at):
        total = 0
        for at_us, amount in given_at[first:]:
            total += amount
            assert total * each_us <= burst * each_us + at_us - start_us


def test_charge_makes_a_debt() -> None:
    bucket = Bucket(10, 10)
    bucket.charge(20, 0)
    assert not bucket.take(0, 999_999)
    assert bucket.take(0, S)
    assert not bucket.take(1, S)
    assert bucket.take(1, S + S // 10)
