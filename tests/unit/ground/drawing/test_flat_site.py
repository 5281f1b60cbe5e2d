"""The site and the way of a bundle: zones with their uses, margins, and the legs of a mission, by hand."""

from pathlib import Path

import pytest
from msgspec.structs import replace

from rtshcua.app.programs import compile_sources
from rtshcua.ground.drawing.drawn_site import FlightMargins, PlannedLeg, PlannedStep, PlannedWay, Site, planned_legs
from rtshcua.ground.drawing.flat_site import site_of, told_band, way_of
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, Zone

MISSIONS = Path(__file__).resolve().parents[4] / "missions"


@pytest.fixture(scope="module")
def standard() -> tuple[Policy, Mission]:
    compiled, _ = compile_sources([MISSIONS / "standard.rts"], mission=None, issued_at_us=0)
    assert compiled.policy is not None
    assert compiled.mission is not None
    return compiled.policy, compiled.mission


def test_zones_have_the_use_that_the_airspace_gives_them(standard: tuple[Policy, Mission]) -> None:
    site = site_of(standard[0], 408_000)
    assert {zone.name: zone.use for zone in site.zones if not zone.derived} == {
        "city": "allowed",
        "bridge_a": "",
        "bridge_b": "",
        "school": "forbidden",
        "meadow": "",
    }
    assert [zone.name for zone in site.zones if zone.derived] == ["grow(school, 20 m)"]
    by_name = {zone.name: zone for zone in site.zones}
    assert (by_name["city"].floor, by_name["city"].ceiling) == (None, 120_000)
    assert by_name["school"].ground.radius_squared == 60_000**2
    assert by_name["grow(school, 20 m)"].ground.radius_squared == 80_000**2
    assert (site.home_within, site.return_altitude, site.elevation) == (50_000, 30_000, 408_000)
    assert site.margins == FlightMargins(3_000, 12_000, 2_000, 500_000)


def test_sure_and_possible_parts_of_zones_count_as_their_zones(standard: tuple[Policy, Mission]) -> None:
    """The compiler makes these where the elevation of home has an error."""
    policy = standard[0]
    assert policy.airspace is not None
    extra = (
        Zone("surely(meadow)", CIRCLE, LOWEST, 55_000, (0, 0, 1)),
        Zone("possibly(school)", CIRCLE, 0, 5, (0, 0, 1)),
    )
    first = len(policy.zones)
    changed = replace(
        policy,
        zones=(*policy.zones, *extra),
        airspace=replace(policy.airspace, inside=(first,), outside=(first + 1,)),
    )
    uses = {zone.name: zone.use for zone in site_of(changed).zones}
    assert (uses["meadow"], uses["school"], uses["city"]) == ("allowed", "forbidden", "")
    assert not {name for name in uses if name.startswith(("surely", "possibly"))}


def test_zone_with_times_is_marked(standard: tuple[Policy, Mission]) -> None:
    policy = standard[0]
    zones = (replace(policy.zones[0], daily=(0, 1)), *policy.zones[1:])
    first, second, *_ = site_of(replace(policy, zones=zones)).zones
    assert (first.timed, first.times) == (True, "at some times")
    assert (second.timed, second.times) == (False, "always")


@pytest.mark.parametrize(
    ("floor", "ceiling", "told"),
    [
        (None, None, "at every height"),
        (None, 60_000, "up to 60 m above home"),
        (20_500, None, "from 20.5 m above home"),
        (-3_000, 9_000, "-3 m to 9 m above home"),
        (0, None, "from 0 m above home"),
    ],
)
def test_band_is_told_with_its_datum(floor: int | None, ceiling: int | None, told: str) -> None:
    assert told_band(floor, ceiling) == told


def test_way_is_that_of_the_signed_plans(standard: tuple[Policy, Mission]) -> None:
    way = way_of(standard[1])
    assert way.name == "standard"
    assert [(step.number, step.motion.name, step.altitude) for step in way.steps] == [
        (1, "CLIMB", 20_000),
        (2, "FLY", 20_000),
        (3, "COVER", 20_000),
        (4, "COVER", 18_000),
        (5, "HOLD", 0),
        (6, "HOME", 0),
    ]
    assert [len(step.path) for step in way.steps][:2] == [0, 1]
    assert way.steps[-1].path == ((0, 0),)
    assert HIGHEST not in {step.altitude for step in way.steps}


PLAIN = Site("p", (), (0, 0), 5_000, 30_000, None, FlightMargins(1_000, 10_000))


def legs(site: Site, *steps: PlannedStep) -> list[tuple[tuple[int, ...], tuple[int, ...], int, int]]:
    found: list[PlannedLeg] = list(planned_legs(PlannedWay("w", steps), site))
    return [(tuple(leg.begin), tuple(leg.end), leg.low, leg.high) for leg in found]


UP = PlannedStep(1, (), MotionKind.CLIMB, 20_000)
FAR = PlannedStep(2, ((300_000, 0),), MotionKind.FLY, 25_000)
HOME = PlannedStep(3, ((0, 0),), MotionKind.HOME)


def test_return_climbs_crosses_and_descends() -> None:
    """The crossing may begin 2 m below the return altitude, as `decision/volume.py` assumes."""
    assert legs(PLAIN, UP, FAR, HOME) == [
        ((0, 0, 0), (0, 0, 20_000), 0, 20_000),
        ((0, 0, 20_000), (300_000, 0, 25_000), 20_000, 25_000),
        ((300_000, 0, 25_000), (300_000, 0, 30_000), 25_000, 30_000),
        ((300_000, 0, 30_000), (0, 0, 30_000), 28_000, 30_000),
        ((0, 0, 30_000), (0, 0, 0), 0, 30_000),
    ]


def test_return_near_home_may_stay_low() -> None:
    """Within a third of the return altitude, at least 10 m, and the errors of home and position."""
    near = PlannedStep(2, ((16_000, 0),), MotionKind.FLY, 20_000)
    beyond = PlannedStep(2, ((16_001, 0),), MotionKind.FLY, 20_000)
    assert legs(PLAIN, UP, near, HOME)[3] == ((16_000, 0, 30_000), (0, 0, 30_000), 20_000, 30_000)
    assert legs(PLAIN, UP, beyond, HOME)[3][2:] == (28_000, 30_000)


def test_return_at_home_only_descends() -> None:
    assert legs(PLAIN, UP, HOME)[1:] == [((0, 0, 20_000), (0, 0, 0), 0, 20_000)]


def test_higher_flight_returns_at_its_own_height() -> None:
    high = PlannedStep(2, ((300_000, 0),), MotionKind.FLY, 50_000)
    assert [end[2] for _, end, *_ in legs(PLAIN, UP, high, HOME)] == [20_000, 50_000, 50_000, 50_000, 0]


def test_landing_and_holding() -> None:
    land, hold = PlannedStep(3, (), MotionKind.LAND), PlannedStep(2, (), MotionKind.HOLD)
    assert legs(PLAIN, UP, hold, land) == [
        ((0, 0, 0), (0, 0, 20_000), 0, 20_000),
        ((0, 0, 20_000), (0, 0, 0), 0, 20_000),
    ]


@pytest.mark.parametrize(
    ("speed", "stops"),
    [(5_000, 2_500 + 6_250), (0, 6_000 + 36_000), (1, 1)],
)
def test_stopping_distance(speed: int, stops: int) -> None:
    """From 12 m/s at most, 500 ms at this speed and then 2 m/s less in each second: v t + v^2 / 2 a."""
    assert FlightMargins(3_000, 12_000, 2_000, 500_000).stopping(speed) == stops
    assert FlightMargins(3_000, 12_000).stopping(speed) == 0


def test_legs_of_a_path_with_heights_are_between_those_of_their_ends() -> None:
    places, heights = ((0, 9_000), (9_000, 9_000), (9_000, 9_000)), (12_000, 12_000, 16_000)
    levelled = PlannedStep(2, places, MotionKind.COVER, 16_000, heights=heights)
    assert legs(PLAIN, UP, levelled)[1:] == [
        ((0, 0, 20_000), (0, 9_000, 12_000), 12_000, 20_000),
        ((0, 9_000, 12_000), (9_000, 9_000, 12_000), 12_000, 12_000),
        ((9_000, 9_000, 12_000), (9_000, 9_000, 16_000), 12_000, 16_000),
    ]
