"""Where a vehicle was, how far it flew, and where its home is, by the telemetry of its flight."""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from math import isqrt
from statistics import median_low
from typing import Final, NamedTuple

from rtshcua.ground.flight.flown import Flight, GeoPlace, TrackPoint
from rtshcua.model.flat.zone import HALF_TURN

#: over a longer time without a position, points are not joined, and nobody knows where the vehicle was, us
GAP_US: Final = 5_000_000
#: a vehicle that is nearer to the height of home is taken to stand on the ground, mm
_ALOFT: Final = 1_000


class KnownPlace(NamedTuple):
    """The reported place nearest in time, and how far its report is from the time in question, us."""

    point: TrackPoint
    off_us: int

    @property
    def remark(self) -> str:
        """How old the place is, where that matters; else empty."""
        off_us = abs(self.off_us)
        if off_us <= 1_000_000:
            return ""
        when = "earlier" if self.off_us > 0 else "later"
        return f"place reported {off_us // 1_000_000}.{off_us // 1_000 % 1_000:03d} s {when}"


class HomeHeight(NamedTuple):
    """The place of home in 1e-7 degree, and its height above mean sea level in mm, None if it is not known. `reported`:
    the vehicle said where its home is; otherwise it is the declared one.
    """

    latitude: int
    longitude: int
    above_sea: int | None
    reported: bool


def exists(at: TrackPoint | GeoPlace) -> bool:
    """Whether a place is on earth, and not 0 N 0 E, which autopilots report before they know where they are."""
    on_earth = abs(at.latitude) <= HALF_TURN // 2 and abs(at.longitude) <= HALF_TURN
    return on_earth and (at.latitude, at.longitude) != (0, 0)


def home_of(flight: Flight) -> HomeHeight:
    """The vehicle's home (HOME_POSITION), or else the declared one, with the height that most of the track implies."""
    telemetry, declared = flight.telemetry, flight.policy.projection
    if telemetry is not None and telemetry.home is not None and exists(telemetry.home):
        return HomeHeight(*telemetry.home, True)
    implied = [] if telemetry is None else [each.above_sea - each.above_home for each in telemetry.track]
    return HomeHeight(declared.latitude, declared.longitude, median_low(implied) if implied else None, False)


def parts(track: Sequence[TrackPoint]) -> Iterator[range]:
    """The numbers of the points in each part of a track between gaps; what was flown in a gap is not known."""
    begin = 0
    for number in range(1, len(track) + 1):
        if number == len(track) or track[number].t_us - track[number - 1].t_us > GAP_US:
            yield range(begin, number)
            begin = number


def place_at(track: Sequence[TrackPoint], t_us: int) -> KnownPlace | None:
    """Where the vehicle was: the reported place nearest in time; None if there is none within `GAP_US`."""
    after = bisect_right(track, t_us, key=lambda each: each.t_us)
    near = min(track[max(after - 1, 0) : after + 1], key=lambda each: abs(each.t_us - t_us), default=None)
    return None if near is None or abs(near.t_us - t_us) > GAP_US else KnownPlace(near, t_us - near.t_us)


def is_aloft(point: TrackPoint) -> bool:
    """Whether the vehicle was higher or lower than home by so much that it flew."""
    return abs(point.above_home) >= _ALOFT


def distance(track: Sequence[TrackPoint], places: Sequence[tuple[int, int]]) -> int:
    """The length of a track over ground while the vehicle flew, without what lies in gaps, mm. `places` are those of
    its points, in mm.
    """
    flown = 0
    for part in parts(track):
        for number in part[1:]:
            if is_aloft(track[number - 1]) or is_aloft(track[number]):
                (x0, y0), (x1, y1) = places[number - 1], places[number]
                flown += isqrt((x1 - x0) ** 2 + (y1 - y0) ** 2)
    return flown
