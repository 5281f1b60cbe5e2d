"""Places, distances and homes of a flown track, by hand; and the units of signals."""

from typing import Any, cast

import pytest

from reference import flat_case as flat
from rtshcua.ground.flight.flown import Flight, FlightTelemetry, GeoPlace, SignalSeries, TrackPoint
from rtshcua.ground.flight.track import GAP_US, HomeHeight, distance, home_of, parts, place_at
from rtshcua.ground.flight.units import unit_of
from rtshcua.model.flat.signal import DRAIN
from rtshcua.model.quantity import Dimension

S = 1_000_000
HERE = 473_977_400


def point(t_s: float, above_home: int = 10_000) -> TrackPoint:
    return TrackPoint(round(t_s * S), HERE, 85_455_900, 498_000, above_home, None, 0, 0, 0, None)


def test_place_is_the_nearest_within_five_seconds() -> None:
    track = [point(0), point(1), point(20)]
    for at, nearest in ((-5, 0), (0.4, 0), (0.6, 1), (6, 1), (15, 20), (25, 20)):
        found = place_at(track, round(at * S))
        assert found is not None
        assert (found.point.t_us, found.off_us) == (nearest * S, round((at - nearest) * S))
    for at in (-5.1, 6.1, 10, 14.9, 25.1):
        assert place_at(track, round(at * S)) is None
    assert place_at([], 0) is None


def test_old_place_says_how_old_it_is() -> None:
    for at, remark in ((1, ""), (3.5, "place reported 3.500 s earlier"), (-1.25, "place reported 1.250 s later")):
        found = place_at([point(0)], round(at * S))
        assert found is not None
        assert found.remark == remark


def test_parts_end_at_gaps() -> None:
    assert list(parts([])) == []
    assert list(parts([point(0)])) == [range(1)]
    assert list(parts([point(0), point(GAP_US / S), point(GAP_US / S + 5.1)])) == [range(2), range(2, 3)]


def test_distance_is_that_in_the_air_without_gaps() -> None:
    heights = [0, 50, 900, 5_000, 10_000, 10_000, 2_000, 300, 0]
    track = [point(at, height) for at, height in enumerate(heights)]
    places = [(0, 0), (400, 0), (0, 300), (0, 0), (3_000, 4_000), (3_000, 4_000), (0, 0), (0, 100), (900, 900)]
    assert distance(track, places) == 300 + 5_000 + 0 + 5_000 + 100
    late = [each._replace(t_us=each.t_us + (10 * S if number >= 4 else 0)) for number, each in enumerate(track)]
    assert distance(late, places) == 300 + 5_000 + 100


def test_vehicle_below_home_flies() -> None:
    assert distance([point(0, -20_000), point(1, -20_000)], [(0, 0), (70, 0)]) == 70


def flight(home: GeoPlace | None, *track: TrackPoint) -> Flight:
    telemetry = FlightTelemetry(len(track), track, home, (), (), (), (), None)
    return Flight(cast("Any", None), flat.POLICY, flat.MISSION, (), telemetry, (), 0, ())


def test_home_is_the_reported_one() -> None:
    assert home_of(flight(GeoPlace(HERE, 85_000_000, 480_000))) == HomeHeight(HERE, 85_000_000, 480_000, True)


@pytest.mark.parametrize("home", [None, GeoPlace(0, 0, 0), GeoPlace(910_000_000, 0, 400_000)])
def test_home_without_a_report_is_the_declared_one_at_the_height_of_most_points(home: GeoPlace | None) -> None:
    """The first reports are from before the autopilot knew its home."""
    before = [point(at, 498_000) for at in range(3)]
    found = home_of(flight(home, *before, *(point(at) for at in range(3, 9))))
    declared = flat.POLICY.projection
    assert found == HomeHeight(declared.latitude, declared.longitude, 488_000, False)
    assert home_of(flight(home)).above_sea is None


@pytest.mark.parametrize(
    ("name", "dimension", "datum", "symbol", "suffix", "digits"),
    [
        ("altitude", Dimension.ALTITUDE, "home", "m above home", "above_home_m", 3),
        ("gps_height", Dimension.ALTITUDE, "sea", "m above sea", "above_sea_m", 3),
        (DRAIN, Dimension.RATIO, "", "% per minute", "percent_per_min", 2),
        ("battery", Dimension.RATIO, "", "%", "percent", 2),
        ("speed", Dimension.SPEED, "", "m/s", "m_s", 3),
        ("satellites", Dimension.COUNT, "", "", "", 0),
    ],
)
def test_unit_names_its_datum(
    name: str, dimension: Dimension, datum: str, symbol: str, suffix: str, digits: int
) -> None:
    assert unit_of(SignalSeries(name, dimension.value, datum, {}, 0, ())) == (symbol, suffix, digits)
