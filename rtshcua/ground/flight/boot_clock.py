"""The autopilot's clock, which counts from its boot, beside the clock of the computer on board.

`GLOBAL_POSITION_INT.time_boot_ms` is the clock of the autopilot's own log (PX4: hrt_absolute_time; ArduPilot:
AP_HAL::micros64). A report comes later than it was made, so the offset is the least difference between the time of
receipt and the time in the report. A constant delay of the link cannot be told from the offset.

`time_boot_ms` has 32 bits: it begins again after 49.7 days, and the clock of PX4 in simulation can begin in 1970. So of
the times that it can mean, the one nearest to the log counts.
"""

from enum import StrEnum
from typing import Final, NamedTuple

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.flight.autopilot_log import AutopilotLog, nearest_rank
from rtshcua.ground.flight.flown import Flight, FlightTelemetry
from rtshcua.model.flat.situation import UTC_UNKNOWN_US

#: the autopilot has booted again if its clock goes back by more, us; less may be reports out of order
_AGAIN_US: Final = 1_000_000
#: two clocks of one boot do not differ by more, beyond their errors, us: a receiver's UTC may lack a leap second
_SLACK_US: Final = 2_000_000

#: `time_boot_ms` begins again after this time, us
_TURN_US: Final = (1 << 32) * 1_000

OTHER_BOOT: Final = "other-boot"


class OffsetSource(StrEnum):
    """How the offset was found."""

    TELEMETRY = "telemetry"
    GPS = "gps"


class BootClock(NamedTuple):
    """The offset of the two clocks: a time since the log's first record is `offset_us` and the time since the boot.
    `error_us` bounds the delay of 95 of 100 reports, or by GPS the errors of both clocks. `utc_apart_us` is how far
    the autopilot's UTC is ahead of ours at the same moment; None if one of them is unknown.
    """

    source: OffsetSource
    offset_us: int
    error_us: int
    utc_apart_us: int | None


class BootTimes(NamedTuple):
    """The clock, and the time since the boot at each point of the flight's track; None where another boot flew."""

    clock: BootClock
    boot_us: tuple[int | None, ...]


def boot_times(flight: Flight, telemetry: FlightTelemetry, log: AutopilotLog) -> BootTimes | Refusal:
    """Find the offset by the telemetry, or else by GPS; refuse a log of another boot."""
    reported = {boot for _, boot in telemetry.boot_us}
    found = _by_telemetry(flight, telemetry, log) if len(reported) > 1 else _by_gps(flight, telemetry, log)
    if isinstance(found, Refusal):
        return found
    clock, apart = found.clock, found.clock.utc_apart_us
    bound = flight.genesis.utc_error_us + clock.error_us + _SLACK_US
    if apart is not None and flight.genesis.utc_error_us < UTC_UNKNOWN_US and abs(apart) > bound:
        text = (
            f"the autopilot's log is of another boot: by GPS its times are {_seconds(abs(apart))} "
            f"{'after' if apart > 0 else 'before'} those of the flight"
        )
        return Refusal(OTHER_BOOT, text, _HELP)
    return found


_HELP: Final = "give the autopilot's log of this flight"


def _by_telemetry(flight: Flight, telemetry: FlightTelemetry, log: AutopilotLog) -> BootTimes | Refusal:
    first, last = log.track[0].boot_us, log.track[-1].boot_us
    near = (first + last) // 2
    pairs = [
        (t_us, near + (boot - near + _TURN_US // 2) % _TURN_US - _TURN_US // 2) for t_us, boot in telemetry.boot_us
    ]
    boots = _boots(pairs)
    within = [sum(first <= boot <= last for _, boot in pairs[begin:end]) for begin, end in boots]
    most = max(within)
    if not most:
        lowest, highest = (f(boot for _, boot in pairs) for f in (min, max))
        text = (
            f"the autopilot's log is of another boot: it has {_seconds(first)} to {_seconds(last)} after its boot, the "
            f"flight {_seconds(lowest)} to {_seconds(highest)}"
        )
        return Refusal(OTHER_BOOT, text, _HELP)
    begin, end = boots[within.index(most)]
    delays = sorted(t_us - boot for t_us, boot in pairs[begin:end])
    offset_us = delays[0]
    apart = None if log.utc_of_boot is None else log.utc_of_boot.utc_us - offset_us - flight.genesis.utc_us
    clock = BootClock(OffsetSource.TELEMETRY, offset_us, nearest_rank(delays, 95) - offset_us, apart)
    times = (boot if begin <= number < end else None for number, (_, boot) in enumerate(pairs))
    return BootTimes(clock, tuple(times))


def _boots(pairs: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """The first and the end of the pairs of each boot."""
    begins = [0]
    begins += [number for number in range(1, len(pairs)) if pairs[number][1] < pairs[number - 1][1] - _AGAIN_US]
    return list(zip(begins, [*begins[1:], len(pairs)], strict=True))


def _by_gps(flight: Flight, telemetry: FlightTelemetry, log: AutopilotLog) -> BootTimes | Refusal:
    genesis = flight.genesis
    if log.utc_of_boot is None or genesis.utc_error_us >= UTC_UNKNOWN_US:
        whose = (
            "the autopilot's log has no UTC" if log.utc_of_boot is None else "the flight's log does not know its UTC"
        )
        text = f"no common clock: the telemetry has no times since the autopilot's boot, and {whose}"
        return Refusal("no-clock", text, "a flight with GLOBAL_POSITION_INT in its telemetry has these times")
    offset_us = log.utc_of_boot.utc_us - genesis.utc_us
    boots = tuple(point.t_us - offset_us for point in telemetry.track)
    if not any(log.track[0].boot_us <= boot <= log.track[-1].boot_us for boot in boots):
        return Refusal(OTHER_BOOT, "the autopilot's log is of another time: by UTC it has nothing of the flight", _HELP)
    error_us = genesis.utc_error_us + log.utc_of_boot.error_us
    return BootTimes(BootClock(OffsetSource.GPS, offset_us, error_us, None), boots)


def _seconds(us: int) -> str:
    return f"{us // 1_000_000}.{us % 1_000_000 // 100_000} s"
