"""Relations of zones, proved exactly, and places that show them."""

import shapely
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.decision.zones import PreparedZone
from rtshcua.ground.analysis.plane import Plane, nearest_inside
from rtshcua.model.flat.zone import AREA, CIRCLE, HIGHEST, LOWEST, POLYGON, Zone

RING = (0, 0, 9_000, 0, 9_000, 9_000, 0, 9_000, 3_000, 3_000, 3_000, 6_000, 6_000, 6_000, 6_000, 3_000)
ZONES = (
    Zone("ring", AREA, LOWEST, HIGHEST, (2, 4, 4, *RING)),
    Zone("in the hole", CIRCLE, LOWEST, HIGHEST, (4_500, 4_500, 1_000_000)),
    Zone("in the ring", POLYGON, LOWEST, HIGHEST, (1_000, 1_000, 2_000, 1_000, 2_000, 8_000, 1_000, 8_000)),
    Zone("sliver", POLYGON, LOWEST, HIGHEST, (-5_000, 7, 20_000, 2, 20_000, 12, -5_000, 17)),
    Zone("west", POLYGON, LOWEST, HIGHEST, (-6_000, -10, 19_990, -10, 19_990, 100, -6_000, 100)),
)
PLANE = Plane(ZONES, tuple(PreparedZone(number, zone) for number, zone in enumerate(ZONES)))


def anywhere(_: tuple[int, int]) -> bool:
    return True


def test_hole_does_not_belong_to_a_zone() -> None:
    assert PLANE.apart(0, 1)
    assert not PLANE.within(1, 0)
    assert PLANE.within(2, 0)
    assert not PLANE.apart(2, 0)


def test_place_is_found_if_there_is_room() -> None:
    for sides in (
        {0: True, 2: False},
        {0: False, 1: True},
        {3: True, 4: False},
        {0: True, 3: True},
        {0: False, 3: False},
    ):
        place = PLANE.place(sides, anywhere)
        assert place is not None
        assert {zone: PLANE.contains(zone, place) for zone in sides} == sides


def test_no_place_is_returned_if_there_is_none() -> None:
    assert PLANE.place({1: True, 0: True}, anywhere) is None
    assert PLANE.place({1: True}, lambda place: place[0] > 9_000) is None


_SPANS = st.integers(-60_000, 60_000)


@given(st.tuples(_SPANS, _SPANS), st.integers(0, 6_000))
def test_nearest_place_is_as_near_as_shapely_finds_one(place: tuple[int, int], margin_mm: int) -> None:
    """Of an L, and of a circle."""
    corner = (-30_000, -30_000, 30_000, -30_000, 30_000, 30_000, 10_000, 30_000, 10_000, 10_000, -30_000, 10_000)
    zones = (
        Zone("corner", POLYGON, LOWEST, HIGHEST, corner),
        Zone("round", CIRCLE, LOWEST, HIGHEST, (5_000, -5_000, 20_000**2)),
    )
    for zone in zones:
        plan = shapely.Polygon([*zip(corner[::2], corner[1::2], strict=True)])
        if zone.shape == CIRCLE:
            plan = shapely.Point(5_000, -5_000).buffer(20_000, quad_segs=64)
        room = plan.buffer(-margin_mm)
        found = nearest_inside(zone, place, margin_mm)
        if room.contains(shapely.Point(place)):
            continue
        assert found is not None
        assert shapely.Point(place).distance(shapely.Point(found)) <= shapely.Point(place).distance(room) + 10
        assert room.distance(shapely.Point(found)) <= 10
