"""Moments of RFC 3339 are read exactly, and everything else is refused."""

import re
from datetime import UTC, datetime, timedelta, timezone

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.ground.language.exact_values import utc_us
from virtual.rows import rows

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
OFFSETS = st.integers(-24 * 60 + 1, 24 * 60 - 1).map(lambda minutes: timezone(timedelta(minutes=minutes)))


@given(st.integers(0, 2**53 - 1), OFFSETS)
def test_moments_agree_with_the_standard_library(expected: int, zone: timezone) -> None:
    time = (EPOCH + timedelta(microseconds=expected)).astimezone(zone)
    assert utc_us(time.isoformat()) == expected
    assert utc_us(time.isoformat().replace("T", "t")) == expected


@rows(
    ("text", "expected"),
    [
        ("1970-01-01T00:00Z", 0),
        ("1970-01-01T00:00:00z", 0),
        ("1970-01-01t00:00:00.000001Z", 1),
        ("1970-01-01T00:00:00.1000000000Z", 100_000),
        ("1970-01-01T01:00-00:00", 3_600_000_000),
        ("1970-01-01T01:00+01:00", 0),
        ("1969-12-31T23:00:01-01:00", 1_000_000),
        ("2026-05-01T08:00Z", 1_777_622_400_000_000),
        ("2000-02-29T23:59:59.999999Z", 951_868_799_999_999),
    ],
)
def test_moments_have_their_computed_values(text: str, expected: int) -> None:
    assert utc_us(text) == expected


@rows(
    ("text", "why"),
    [
        ("", "a date, `T`"),
        ("2026-05-01", "a date, `T`"),
        ("2026-05-01T08:00", "a date, `T`"),
        ("2026-05-01 08:00Z", "a date, `T`"),
        ("2026-05-01T08Z", "a date, `T`"),
        ("2026-5-01T08:00Z", "a date, `T`"),
        ("2026-05-01T08:00:00.Z", "a date, `T`"),
        ("2026-05-01T08:00+0200", "a date, `T`"),
        ("2026-05-01T08:00Z ", "a date, `T`"),
        ("2026-05-01T08:00Z\n", "a date, `T`"),
        ("٢٠٢٦-05-01T08:00Z", "a date, `T`"),
        ("2026-13-01T08:00Z", "day does not exist"),
        ("2026-02-29T08:00Z", "day does not exist"),
        ("0000-01-01T08:00Z", "day does not exist"),
        ("2026-05-01T24:00Z", "times are from"),
        ("2026-05-01T08:60Z", "times are from"),
        ("2026-05-01T08:59:60Z", "times are from"),
        ("2026-05-01T08:00+24:00", "offset from UTC is"),
        ("2026-05-01T08:00+01:60", "offset from UTC is"),
        ("2026-05-01T08:00:00.0000001Z", "6 decimals"),
        ("1969-12-31T23:59:59.999999Z", "1970 to 2255"),
        ("9999-12-31T23:59Z", "1970 to 2255"),
    ],
)
def test_invalid_moment_is_refused(text: str, why: str) -> None:
    with pytest.raises(ValueError, match=re.escape(why)):
        utc_us(text)


@given(st.text() | st.from_regex(r"\A[0-9TZ:.+-]{0,30}\Z"))
def test_any_text_is_a_moment_or_refused(text: str) -> None:
    try:
        assert utc_us(text) >= 0
    except ValueError:
        with pytest.raises(ValueError, match=r"\w"):
            utc_us(text)
