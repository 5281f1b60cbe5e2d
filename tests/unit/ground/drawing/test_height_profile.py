"""The side view: heights and zones stand where they are, and labels do not overlap."""

from itertools import combinations, pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.ground.drawing.canvas import contains
from rtshcua.ground.drawing.drawn_site import (
    FlightMark,
    FlownPlace,
    FlownWay,
    LeftAirspace,
    PlannedStep,
    PlannedWay,
    RefusedParts,
    Site,
    ZoneOutline,
    ZoneView,
)
from rtshcua.ground.drawing.height_profile import HeightProfile, flown_heights, inside, planned_heights
from rtshcua.model.flat.contract import MotionKind


def zone(name: str, use: str, west: int, east: int, floor: int | None, ceiling: int | None) -> ZoneView:
    ring = ((west, -50_000), (east, -50_000), (east, 50_000), (west, 50_000))
    return ZoneView(name, "", use, "", "", "", ZoneOutline((ring,)), floor, ceiling, (), "", changed=False)


SITE = Site(
    "p",
    (
        zone("field", "allowed", -1_000_000, 1_000_000, None, 60_000),
        zone("pit", "forbidden", 100_000, 150_000, None, 12_000),
    ),
    (0, 0),
    5_000,
    30_000,
)
WAY = PlannedWay(
    "there",
    (
        PlannedStep(1, (), MotionKind.CLIMB, 20_000),
        PlannedStep(2, ((200_000, 0),), MotionKind.FLY, 40_000),
        PlannedStep(3, (), MotionKind.HOLD),
        PlannedStep(4, ((0, 0),), MotionKind.HOME),
    ),
)


def line(points: str) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in (point.split(",") for point in points.split(" "))]


def scale(profile: HeightProfile) -> float:
    """px of a metre of height."""
    first, second = (mark for mark in profile.heights if mark.told in ("0 m", "20 m"))
    return (first.at - second.at) / 20


def test_climb_and_descent_are_upright() -> None:
    profile = planned_heights(SITE, WAY)
    drawn = line(profile.ways[0])
    heights = [(profile.home - y) / scale(profile) for _, y in drawn]
    assert heights == pytest.approx([0, 20, 40, 40, 40, 0], abs=0.1)
    (x0, x1, x2, x3, x4, x5) = (x for x, _ in drawn)
    assert x0 == x1 < x2 == x3 < x4 == x5
    assert x4 - x3 == pytest.approx(x2 - x1, abs=0.1)
    assert profile.plot.x + 10 < x0
    assert x5 < profile.plot.x + profile.plot.width - 10
    assert len(profile.stops) == 3  # the steps 2 and 3 end at one place


def test_zone_is_drawn_where_the_way_is_over_it() -> None:
    profile = planned_heights(SITE, WAY)
    drawn = line(profile.ways[0])
    per_metre = (drawn[2][0] - drawn[1][0]) / 200
    pits = [band for band in profile.bands if band.kind == "forbidden"]
    assert [(band.box.x - drawn[0][0]) / per_metre for band in pits] == pytest.approx([100, 250], abs=0.1)
    assert [band.box.width / per_metre for band in pits] == pytest.approx([50, 50], abs=0.1)
    assert all((profile.home - band.box.y) / scale(profile) == pytest.approx(12, abs=0.1) for band in pits)
    assert all(band.hatch for band in pits)
    (field,) = (band for band in profile.bands if band.kind == "allowed")
    assert (field.box.x, field.box.width) == (profile.plot.x, profile.plot.width)
    assert field.title == "field: up to 60 m above home"


def test_heights_above_sea_need_the_elevation() -> None:
    plain = planned_heights(SITE, WAY)
    assert plain.above == ("above home", "")
    assert not any(mark.other for mark in plain.heights)
    site = Site(SITE.policy, SITE.zones, SITE.home, SITE.home_within, SITE.return_altitude, 408_500)
    both = planned_heights(site, WAY)
    assert both.above == ("above home", "above sea")
    assert ("20 m", "428.5 m") in [(mark.told, mark.other) for mark in both.heights]
    assert {"return at 30 m above home", "40 m above home"} <= {label.text for label in both.labels}


def test_refused_step_and_the_place_where_it_leaves_are_marked() -> None:
    profile = planned_heights(SITE, WAY, RefusedParts(frozenset({2}), (LeftAirspace(2, 100_000, 0),)))
    (failed,) = profile.failed
    drawn = line(profile.ways[0])
    assert line(failed) == drawn[1:3]
    (mark,) = profile.marks
    assert mark.kind == "left"
    assert (mark.x, mark.y) == pytest.approx(
        ((drawn[1][0] + drawn[2][0]) / 2, (drawn[1][1] + drawn[2][1]) / 2), abs=0.1
    )


def test_way_without_a_distance_is_drawn() -> None:
    profile = planned_heights(SITE, PlannedWay("up", WAY.steps[:1]))
    assert len({x for x, _ in line(profile.ways[0])}) == 1
    assert [mark.told for mark in profile.across] == ["0 m"]
    assert {band.box.width for band in profile.bands} == {profile.plot.width}


FLOWN = FlownWay(
    (
        tuple(FlownPlace(second * 1_000_000, second * 2_000, 0, second * 500, -1_000) for second in range(61)),
        (FlownPlace(90_000_000, 180_000, 0, 30_000), FlownPlace(125_000_000, 180_000, 0, 0)),
    ),
    (FlightMark(30_000_000, 60_000, 0, "2 allowed"), FlightMark(130_000_000, 180_000, 0, "landed", "refused")),
)


def test_flown_heights_stand_over_their_times() -> None:
    profile = flown_heights(SITE, FLOWN)
    first, second = map(line, profile.flown)
    times = {mark.told: mark.at for mark in profile.across}
    assert list(times) == ["0:00", "0:30", "1:00", "1:30", "2:00"]
    assert first[0][0] == pytest.approx(times["0:00"], abs=0.1)
    assert first[-1] == pytest.approx((times["1:00"], profile.home - 30 * scale(profile)), abs=0.1)
    assert second[0][0] == pytest.approx(times["1:30"], abs=0.1)
    (ground,) = map(line, profile.ground)
    assert {round((profile.home - y) / scale(profile), 1) for _, y in ground} == {-1.0}
    assert [mark.kind for mark in profile.marks] == ["event", "refused"]
    assert profile.marks[0].y == pytest.approx(profile.home - 15 * scale(profile), abs=0.1)
    pits = [band for band in profile.bands if band.kind == "forbidden"]
    assert len(pits) == 1
    assert pits[0].box.x == pytest.approx(first[50][0], abs=0.1)


def test_flight_without_a_track_is_drawn() -> None:
    assert flown_heights(SITE, FlownWay(())).flown == ()
    assert flown_heights(SITE, FlownWay(((),))).marks == ()


def test_labels_do_not_overlap() -> None:
    many = tuple(
        zone(f"zone_with_a_name_{n}", "", n * 9_000, n * 9_000 + 15_000, None, 50_000 - n * 900) for n in range(40)
    )
    site = Site("p", many, (0, 0), 5_000, 30_000, 400_000)
    for profile in (planned_heights(site, WAY), flown_heights(site, FLOWN), planned_heights(SITE, WAY)):
        boxes = [label.box for label in profile.labels]
        assert not [pair for pair in combinations(boxes, 2) if pair[0].meets_any(pair[1:])]
        assert all(box.x > 0 and box.x + box.width < profile.width for box in boxes)
        assert len(profile.labels) + len(profile.unlabelled) >= len({band.title for band in profile.bands})


PLACES = st.tuples(st.integers(-200, 200), st.integers(-200, 200))
SHAPES = st.one_of(
    st.builds(lambda at, r: ZoneOutline(centre=at, radius_squared=r * r), PLACES, st.integers(1, 150)),
    st.builds(
        lambda a, b: ZoneOutline(((a, (a[0] + b, a[1]), (a[0] + b, a[1] + b), (a[0], a[1] + b)),)),
        PLACES,
        st.integers(1, 150),
    ),
)


@given(ground=SHAPES, one=PLACES, other=PLACES)
def test_parts_inside_match_a_walk_along_the_line(
    ground: ZoneOutline, one: tuple[int, int], other: tuple[int, int]
) -> None:
    parts = list(inside(ground, one, other))
    assert all(0 <= begin < end <= 1 for begin, end in parts)
    assert all(before[1] <= after[0] for before, after in pairwise(parts))
    for step in range(1, 200):
        share = step / 200
        if any(abs(share - edge) < 1e-6 for part in parts for edge in part):
            continue
        x, y = one[0] + (other[0] - one[0]) * share, one[1] + (other[1] - one[1]) * share
        edges = ground.rings and any(
            x in (corner[0] for corner in ring) or y in (corner[1] for corner in ring) for ring in ground.rings
        )
        if not edges:
            assert contains(ground, x, y) == any(begin < share < end for begin, end in parts)
