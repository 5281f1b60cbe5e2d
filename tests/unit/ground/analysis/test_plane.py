"""Relations of zones, proved exactly, and places that show them."""

from rtshcua.decision.zones import PreparedZone
from rtshcua.ground.analysis.plane import Plane
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
