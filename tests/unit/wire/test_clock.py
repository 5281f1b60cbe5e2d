"""The check of a claimed time of day against a boundary's clock."""

import pytest

from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Now
from rtshcua.wire.clock import APART_US, bears_out

UTC_US = 1_800_000_000_000_000


@pytest.mark.parametrize(
    ("off_us", "own_us", "named_us", "borne"),
    [
        (0, 0, 0, True),
        (APART_US, 0, 0, True),
        (-APART_US, 0, 0, True),
        (APART_US + 1, 0, 0, False),
        (APART_US, 1, 0, False),
        (APART_US, 1, 1, True),
        (APART_US + 5, 0, 5, True),
        (0, APART_US + 1, 0, False),
        (0, 0, UTC_UNKNOWN_US, True),
    ],
)
def test_a_time_within_both_errors_and_two_seconds(off_us: int, own_us: int, named_us: int, *, borne: bool) -> None:
    assert bears_out(Now(5, UTC_US, own_us), Now(9, UTC_US + off_us, named_us)) is borne


@pytest.mark.parametrize(
    ("utc_us", "error_us", "borne"),
    [
        (UTC_US, UTC_UNKNOWN_US - 1, False),
        (UTC_US, UTC_UNKNOWN_US, True),
        (0, UTC_UNKNOWN_US, True),
        (UTC_UNKNOWN_US, UTC_UNKNOWN_US, True),
        (UTC_UNKNOWN_US + 1, UTC_UNKNOWN_US + 1, False),
    ],
)
def test_unknown_time_allows_no_claim(utc_us: int, error_us: int, *, borne: bool) -> None:
    assert bears_out(Now(5, UTC_US, UTC_UNKNOWN_US), Now(5, utc_us, error_us)) is borne
