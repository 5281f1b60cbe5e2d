"""The offset of the autopilot's clock: by the telemetry, by GPS, and the logs of other boots."""

from typing import Any, cast

import pytest

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.records import Genesis
from rtshcua.ground.flight.autopilot_log import (
    AutopilotLog,
    AutopilotLogKind,
    AutopilotPoint,
    LogCondition,
    UtcOfBoot,
    utc_of_boot,
)
from rtshcua.ground.flight.boot_clock import BootTimes, OffsetSource, boot_times
from rtshcua.ground.flight.flown import Flight, FlightTelemetry, TrackPoint
from rtshcua.model.flat.situation import UTC_UNKNOWN_US

S = 1_000_000
UTC = 1_790_000_000 * S


class Began:
    """What the clock reads of a genesis."""

    def __init__(self, utc_error_us: int) -> None:
        self.utc_us, self.utc_error_us = UTC, utc_error_us


def flight(pairs: list[tuple[int, int]], utc_error_us: int = 100_000) -> Flight:
    track = tuple(TrackPoint(t_us, 0, 0, 0, 0, None, 0, 0, 0, None) for t_us, _ in pairs)
    telemetry = FlightTelemetry(len(pairs), track, None, (), (), (), tuple(pairs), None)
    return Flight(cast("Genesis", Began(utc_error_us)), cast("Any", None), cast("Any", None), (), telemetry, (), 0, ())


def log(first_us: int, last_us: int, utc: UtcOfBoot | None = None) -> AutopilotLog:
    track = tuple(AutopilotPoint(at_us, 0, 0, 0) for at_us in (first_us, last_us))
    return AutopilotLog(AutopilotLogKind.ULOG, LogCondition.WHOLE, "x", track, utc)


def found(flown: Flight, of: AutopilotLog) -> BootTimes | Refusal:
    assert flown.telemetry is not None
    return boot_times(flown, flown.telemetry, of)


def times(flown: Flight, of: AutopilotLog) -> BootTimes:
    result = found(flown, of)
    assert isinstance(result, BootTimes), result
    return result


def test_offset_is_that_of_the_least_delayed_report() -> None:
    """40 s after the boot; delays of 5 to 104 ms, one of 3 s."""
    pairs = [(n * S // 10 + 5_000 + 1_000 * (n * 37 % 100), 40 * S + n * S // 10) for n in range(200)]
    pairs[90] = (pairs[90][0] + 3 * S, pairs[90][1])
    clock = times(flight(pairs), log(30 * S, 70 * S)).clock
    assert clock.source is OffsetSource.TELEMETRY
    assert clock.offset_us == 5_000 - 40 * S
    assert clock.error_us == 95_000  # 95 of 100 reports are no later
    assert clock.utc_apart_us is None


def test_log_of_another_boot_is_refused_by_its_times() -> None:
    pairs = [(n * S, 40 * S + n * S) for n in range(10)]
    refusal = found(flight(pairs), log(3_000 * S, 3_200 * S))
    assert isinstance(refusal, Refusal)
    assert refusal.slug == "other-boot"
    assert "3000.0 s to 3200.0 s" in refusal.text
    assert "40.0 s to 49.0 s" in refusal.text


@pytest.mark.parametrize(("apart_us", "refused"), [(0, False), (2_000_000, False), (-2_000_000, False),
                                                   (3_600_000_000, True), (-3_600_000_000, True)])  # fmt: skip
def test_log_of_another_boot_is_refused_by_gps(apart_us: int, refused: bool) -> None:
    """Both boots have the same times since the boot, an hour apart."""
    pairs = [(n * S, 40 * S + n * S) for n in range(10)]
    of = log(30 * S, 60 * S, UtcOfBoot(UTC - 40 * S + apart_us, 0))
    result = found(flight(pairs), of)
    if refused:
        assert isinstance(result, Refusal)
        assert result.slug == "other-boot"
        assert ("after" if apart_us > 0 else "before") in result.text
    else:
        assert isinstance(result, BootTimes)
        assert result.clock.utc_apart_us == apart_us
    unknown = times(flight(pairs, UTC_UNKNOWN_US), of)
    assert unknown.clock.utc_apart_us == apart_us  # stated, but it proves nothing


def test_points_of_another_boot_have_no_time() -> None:
    """The autopilot booted again after 30 s of the flight; its log is of the second boot."""
    pairs = [(n * S, 900 * S + n * S) for n in range(30)] + [(n * S, (n - 20) * S) for n in range(30, 90)]
    result = times(flight(pairs), log(5 * S, 80 * S))
    assert result.clock.offset_us == 20 * S
    assert result.boot_us == (*[None] * 30, *((n - 20) * S for n in range(30, 90)))


def test_32_bits_of_milliseconds_begin_again() -> None:
    """The clock of PX4 in simulation can begin in 1970; and a flight may last over the end of the 32 bits."""
    turn = (1 << 32) * 1_000
    since_1970 = 1_710_773_360 * S
    pairs = [(n * S, (since_1970 + n * S) % turn) for n in range(10)]
    result = times(flight(pairs), log(since_1970 - S, since_1970 + 60 * S))
    assert result.clock.offset_us == -since_1970
    assert result.boot_us == tuple(since_1970 + n * S for n in range(10))
    pairs = [(n * S, (turn - 5 * S + n * S) % turn) for n in range(10)]
    assert times(flight(pairs), log(turn - 60 * S, turn + 60 * S)).clock.offset_us == 5 * S - turn


def test_reports_out_of_order_are_of_one_boot() -> None:
    pairs = [(0, 40 * S), (S, 41 * S), (S + 10, 41 * S - 200_000), (2 * S, 42 * S)]
    assert None not in times(flight(pairs), log(30 * S, 60 * S)).boot_us


def test_offset_by_gps_alone() -> None:
    """An autopilot whose reports have no time since its boot."""
    pairs = [(n * S, 0) for n in range(10)]
    of = log(30 * S, 60 * S, UtcOfBoot(UTC - 35 * S, 20_000))
    result = times(flight(pairs), of)
    assert result.clock.source is OffsetSource.GPS
    assert (result.clock.offset_us, result.clock.error_us) == (-35 * S, 120_000)
    assert result.boot_us == tuple(35 * S + n * S for n in range(10))
    for flown, unlike, slug in (
        (flight(pairs, UTC_UNKNOWN_US), of, "no-clock"),
        (flight(pairs), log(30 * S, 60 * S), "no-clock"),
        (flight(pairs), log(30 * S, 60 * S, UtcOfBoot(UTC + 35 * S, 0)), "other-boot"),
    ):
        refusal = found(flown, unlike)
        assert isinstance(refusal, Refusal)
        assert refusal.slug == slug


def test_utc_of_boot_is_the_median_of_reports() -> None:
    assert utc_of_boot([]) is None
    assert utc_of_boot([(5, UTC + 5), (7, UTC + 8), (9, UTC + 7)]) == UtcOfBoot(UTC, 2)
    outlier = [(n, UTC + n) for n in range(99)] + [(99, 0)]
    assert utc_of_boot(outlier) == UtcOfBoot(UTC, 0)
