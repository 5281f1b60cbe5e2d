"""Parts of policies that are written for a person: the library's vehicle and skills, with sizes for the flight at hand.

The vehicle's figures are those that stock PX4 and ArduCopter keep (docs/flying/speeds.md). `rtshcua gateway --allow`
and `rtshcua import` write such policies; each is a source like any other, to be read and changed.
"""

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from rtshcua.ground.exchange.zone_source import metres, place_text

VEHICLE: Final = "copter"
#: position error, and how far home may be from the declared place, in mm
ERROR_MM, WITHIN_MM = 3_000, 10_000
#: figures of the vehicle: mm/s, and the endurance in flight, s
CRUISE, CLIMB = 5_000, 1_500
FLIGHT_S: Final = 16 * 60
#: the least `highest` of the library's skills, in mm
LEAST_HIGHEST_MM: Final = 10_000
_SPEEDS: Final = "cruise 5 m/s, climb 1.5 m/s, descent 1.5 m/s, landing 0.5 m/s below 10 m, return 5 m/s, air 16 m/s"


class GeoPoint(NamedTuple):
    """A place in 1e-7 degree."""

    latitude: int
    longitude: int


def vehicle_lines(
    identity: str,
    home: GeoPoint,
    within_mm: int,
    return_mm: int,
    above_sea: int | None = None,
    reserve: int = 15,
    cameras: Sequence[str] = (),
) -> Iterator[str]:
    """The vehicle at a home; `above_sea` is its height in mm, if that is known, `reserve` the reserve in percent; the
    `cameras` are lines of their own.
    """
    yield f"vehicle {VEHICLE} {{"
    yield f'  identity "{identity}"'
    yield f"  home     {place_text(*home)} within {metres(within_mm)}"
    if above_sea is not None:
        yield f"  elevation {metres(above_sea)} above sea within 5 m"
    yield "  speed    at most 12 m/s"
    yield "  climb    at most 3 m/s"
    yield f"  position error {metres(ERROR_MM)}"
    yield "  energy   100 % = 18 min hover, 16 min flight"
    yield "  brakes   from 12 m/s in 6 s after 500 ms"
    yield f"  speeds   {_SPEEDS}"
    yield "  accelerates to 5 m/s in 5 s"
    yield "  wind     at most 8 m/s"
    yield f"  return   at {metres(return_mm)}"
    yield f"  reserve  {reserve} %"
    yield "  without  wind.speed, obstacle.distance, link.quality"
    yield from (f"  {each}" for each in cameras)
    yield "}"


def size_line(skill: str, more: str, longest_s: int, default_s: int, default_percent: int) -> str:
    """The sizes of a skill: no less than its defaults, of time and charge. `more` are others, each with a comma."""
    longest, charge = max(longest_s, default_s), max(percent(longest_s), default_percent)
    return f"sizes {skill}({more}longest = {longest} s, charge = {charge} %)"


def percent(seconds: int) -> int:
    """The charge for a time in flight, rounded up, and 1 % more."""
    return min(80, -(-100 * seconds // FLIGHT_S) + 1)
