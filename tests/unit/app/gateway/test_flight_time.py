"""The gateway issues by the flight's time of day, which may be the vehicle's and then has an error of seconds."""

from typing import Any
from unittest.mock import sentinel

import pytest

from rtshcua.app.gateway.gateway_service import FlightTime, GatewaySession
from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Now

S = 1_000_000


def line(kind: str = "effect", **changed: Any) -> dict[str, Any]:
    return {"type": kind, "at_us": 100 * S, "utc_us": 5_000 * S, "utc_error_us": 6 * S, **changed}


def session(*lines: dict[str, Any]) -> GatewaySession:
    heard = GatewaySession(sentinel.process, sentinel.link)
    for each in lines:
        heard.hear(each)
    return heard


def test_records_tell_the_time_and_the_last_one_counts() -> None:
    heard = session(line(), line("decision", at_us=101 * S, utc_us=4_001 * S))
    assert heard.time == FlightTime(101 * S, 4_001 * S, 6 * S)


def test_a_flight_that_waits_tells_the_time_of_the_first_bundle() -> None:
    assert session(line("vehicle")).time == FlightTime(100 * S, 5_000 * S, 6 * S)


@pytest.mark.parametrize("other", [
    {"type": "hello", "at_us": 1, "utc_us": 1, "utc_error_us": 1}, line(utc_error_us=UTC_UNKNOWN_US),
    line(utc_us=None), line(at_us="100"), {"type": "effect"},
])  # fmt: skip
def test_other_lines_do_not_change_the_time(other: dict[str, Any]) -> None:
    assert session(other).time is None
    assert session(line(), other).time == FlightTime(100 * S, 5_000 * S, 6 * S)


def test_error_grows_by_half_a_millisecond_a_second() -> None:
    time = FlightTime(100 * S, 5_000 * S, 6 * S)
    assert time.now(110 * S) == Now(110 * S, 5_010 * S, 6 * S + 5_000)
    assert time.now(99 * S) == Now(99 * S, 4_999 * S, 6 * S)
