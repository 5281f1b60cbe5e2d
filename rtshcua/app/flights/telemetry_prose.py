"""What the telemetry of a flight leaves open, in words."""

from collections.abc import Iterator
from typing import Final

from rtshcua.app.wording import many, seconds
from rtshcua.diagnostics.suggest import listed
from rtshcua.ground.flight.flown import FlightTelemetry

#: the most silences and steps of the clock that are told
_MOST: Final = 20

#: telemetry after the last record is told, and drawn apart, from this on, us
_LATER_US: Final = 100_000


def goes_on(telemetry: FlightTelemetry) -> bool:
    """Whether it goes on after the last record of the log."""
    return telemetry.later_us >= _LATER_US


def doubts(telemetry: FlightTelemetry, *, drawn: bool = False) -> Iterator[str]:
    """Yield what makes it doubtful whose the telemetry is, and of which time; also what a report has `drawn` apart."""
    if goes_on(telemetry):
        later = f"it goes on for {seconds(telemetry.later_us)} after the last record of the log"
        yield f"{later}: drawn dashed, and not counted" if drawn else later
    if telemetry.vehicles:
        systems, told = listed(map(str, telemetry.vehicles)), telemetry.vehicles[0]
        yield f"it has vehicles with the system ids {systems}; which one was commanded is not known, this is `{told}`"
    for step in telemetry.steps[:_MOST]:
        way = "back" if step.by_us < 0 else "forward"
        yield f"its clock went {way} by {seconds(abs(step.by_us))} after {seconds(step.after_us)}"
    if telemetry.stray:
        yield f"{many(telemetry.stray, 'position')} of an unknown time, which the log does not have, are left out"


def silences(telemetry: FlightTelemetry, lasted_us: int) -> Iterator[str]:
    """Yield the longest silences, in the order of time."""
    longest = sorted(telemetry.silences, key=lambda each: each.from_us - each.to_us)[:_MOST]
    for silence in sorted(longest):
        to = "the end" if silence.to_us >= lasted_us + telemetry.later_us else seconds(silence.to_us)
        yield f"no frame of the autopilot from {seconds(silence.from_us)} to {to}"
    if len(telemetry.silences) > _MOST:
        yield f"and {many(len(telemetry.silences) - _MOST, 'shorter silence')}"
