"""E0514, E0515: what lies on the straight ways from a step; the fan against shapely, and whole missions."""

from math import hypot
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from shapely import MultiPoint, Point, Polygon, box, convex_hull, unary_union

from reference.sources import found, mission, policy, program, skill
from rtshcua.decision.values import FALSE, TRUE
from rtshcua.decision.zones import PreparedZone
from rtshcua.ground.compiler.proofs.fan import Fan, Landmarks, disc, hull
from rtshcua.model.flat.zone import AREA, CIRCLE, HIGHEST, LOWEST, POLYGON, Zone
from virtual.rows import rows

POINTS = st.tuples(st.integers(-40, 40), st.integers(-40, 40))


class Zones(Landmarks):
    """The landmarks of zones without a policy around them."""

    def __init__(self, *zones: Zone) -> None:
        self._zones = zones
        self._found = {}


def zone(shape: int, data: tuple[int, ...]) -> Zone:
    return Zone("z", shape, LOWEST, HIGHEST, data)


def answer(flat: Zone, points: list[tuple[int, int]], error: int) -> int:
    fan = Fan(points, (-error, -error, error, error), Zones(flat))
    return fan.within(PreparedZone(0, flat))


def ring(west: int, south: int, east: int, north: int, *, hole: bool = False) -> tuple[int, ...]:
    corners = [(west, south), (east, south), (east, north), (west, north)]
    return tuple(number for corner in (corners[::-1] if hole else corners) for number in corner)


RINGED = zone(AREA, (3, 4, 4, 4, *ring(-30, -30, 30, 30), *ring(-20, -20, 5, 5, hole=True), *ring(-10, -10, -2, -2)))
SOLID = zone(POLYGON, (-30, -30, 30, -30, 30, 30, 0, -10, -30, 30))
SHAPES: dict[str, tuple[Zone, Any]] = {
    "ringed": (RINGED, unary_union([box(-30, -30, 30, 30) - box(-20, -20, 5, 5), box(-10, -10, -2, -2)])),
    "bent": (SOLID, Polygon([(-30, -30), (30, -30), (30, 30), (0, -10), (-30, 30)])),
}


@pytest.mark.parametrize("name", SHAPES)
@given(points=st.lists(POINTS, min_size=1, max_size=5), error=st.integers(0, 6))
def test_a_fan_says_of_a_zone_what_the_plane_says(name: str, points: list[tuple[int, int]], error: int) -> None:
    flat, shape = SHAPES[name]
    corners = [(x + dx, y + dy) for x, y in points for dx in (-error, error) for dy in (-error, error)]
    swept = convex_hull(Polygon([*corners, corners[0], corners[0]]) if len(set(corners)) > 2 else Polygon())
    assume(not swept.is_empty and swept.area > 0)
    got = answer(flat, points, error)
    if shape.boundary.intersects(swept):
        assert got == TRUE | FALSE
    else:
        assert got == (TRUE if shape.contains(swept) else FALSE)


@given(points=st.lists(POINTS, min_size=1, max_size=6), error=st.integers(0, 6), radius=st.integers(1, 60))
def test_a_fan_says_of_a_circle_what_its_distances_say(points: list[tuple[int, int]], error: int, radius: int) -> None:
    got = answer(zone(CIRCLE, (3, -2, radius * radius)), points, error)
    corners = [(x + dx, y + dy) for x, y in points for dx in (-error, error) for dy in (-error, error)]
    farthest = max(hypot(x - 3, y + 2) for x, y in corners)
    assert (got == TRUE) == (farthest < radius)
    distance = MultiPoint(corners).convex_hull.distance(Point(3, -2))
    if got == FALSE:
        assert distance >= radius
    elif got == TRUE | FALSE:
        assert distance <= radius + 5  # what is clear by more is said to be


@given(radius=st.integers(1, 1 << 20))
def test_a_disc_holds_its_circle(radius: int) -> None:
    corners = hull(disc(radius))
    for (ax, ay), (bx, by) in zip(corners, [*corners[1:], corners[0]], strict=True):
        length = hypot(bx - ax, by - ay)
        assert (ax * by - ay * bx) / length >= radius * (1 - 1e-9)
    assert max(hypot(x, y) for x, y in corners) <= radius * 1.03 + 2


def test_the_hull_of_nothing_much() -> None:
    assert hull([(1, 1), (1, 1)]) == [(1, 1)]
    assert hull([(0, 0), (2, 2), (1, 1)]) == [(0, 0), (2, 2)]
    assert disc(0) == [(0, 0)]


UP, HOME = "takeoff(altitude = 20 m)", "return_home()"
CITY = "airspace inside city outside school"


def goto(place: str) -> str:
    return f"goto({place}, altitude = 20 m)"


def other(within: int) -> str:
    """A vehicle whose real home may be so far from its declared one."""
    return f"""vehicle other {{
  identity "o"  home 47.39774 N, 8.54559 E within {within} m  speed at most 12 m/s  climb at most 3 m/s
  position error 3 m  energy 100 % = 18 min hover  reserve 15 %
}}
"""


def test_a_way_home_through_the_midst_of_a_zone_that_no_leg_touches() -> None:
    """The corners of the path are fine, and so are the ways from these: what lies between them is not."""
    post = "zone post = circle(47.39900 N, 8.54559 E, 6 m)\n"
    legs = [goto("47.40000 N, 8.54480 E"), goto("47.40000 N, 8.54640 E"), goto("47.39800 N, 8.54700 E")]
    rules = policy("airspace inside city outside post")
    flight = mission(UP, *legs, HOME).replace("on quad", "on other")
    [(code, message)] = found(program(other(1), post, rules, flight))
    assert code == "E0514"
    assert message.startswith("the straight way home from this step, which begins 61 m east and 251 m north of home")


@pytest.mark.parametrize(("within", "expected"), [(5, []), (40, ["E0514"])])
def test_where_home_may_really_be_counts(within: int, expected: list[str]) -> None:
    pole = "zone pole = circle(47.39855 N, 8.54590 E, 15 m)\n"
    flight = mission(UP, goto("47.39950 N, 8.54540 E"), HOME).replace("on quad", "on other")
    rules = policy("airspace inside city outside pole")
    assert [code for code, _ in found(program(other(within), pole, rules, flight))] == expected


@rows("within", [5, 20, 26, 30, 60, 200, 2000])
def test_the_less_is_known_of_home_the_more_is_found(within: int) -> None:
    yard = "zone yard = circle(47.39774 N, 8.54559 E, 30 m)\n"
    flight = mission(UP, "hover()", HOME).replace("on quad", "on other")
    findings = found(program(other(within), yard, policy("airspace inside yard"), flight))
    if within < 26:  # with 3 m of position error, and a corner of the polygon around the disc
        assert findings == []
    else:
        code, message = next(each for each in findings if each[0] != "E0804")  # so far is not flown in time either
        assert (code, message.split(",")[0]) == (
            "E0508",
            f"home may lie up to {within} m from where it is declared",
        )


def test_zones_with_times_are_left_for_on_board() -> None:
    night = "zone night = circle(47.39860 N, 8.54559 E, 20 m) active 22:00 .. 06:00\n"
    vehicle_clock = mission(UP, goto("47.39950 N, 8.54559 E"), HOME)
    assert found(program(night, policy("airspace inside city outside night"), vehicle_clock)) == []


@rows(
    ("link", "expected"),
    [
        ("goto(47.39799 N, 8.54559 E, altitude = 20 m)", []),
        ("goto(47.39799 N, 8.54559 E, altitude = 59 m)", []),
        ("goto(47.39799 N, 8.54559 E, altitude = 60 m)", ["E0515"]),  # touches the ceiling
        ("goto(47.39850 N, 8.54559 E, altitude = 20 m)", ["E0515"]),
        ("rise(59 m)", []),
        ("rise(60 m)", ["E0515"]),
    ],
)
def test_links_that_fly_keep_the_airspace(link: str, expected: list[str]) -> None:
    rise = skill("rise(up: altitude in 5 m .. 60 m)", motion="climb to up")
    probe = skill("probe()", fallback=f"{link}, return_home, emergency_land")
    rules = policy("airspace inside meadow")
    assert [code for code, _ in found(program(rise, probe, rules, mission(UP, "probe()", HOME)))] == expected


def test_the_way_home_from_where_a_link_flew_counts() -> None:
    flown = f"{goto('47.39760 N, 8.54970 E')}, return_home, emergency_land"
    rules = policy(CITY, contingency="emergency_land")
    north = goto("47.39860 N, 8.54970 E")
    probe = skill("probe()", fallback=flown)
    messages = found(program(probe, rules, mission(UP, goto("47.39840 N, 8.54820 E"), north, "probe()", HOME)))
    assert [code for code, _ in messages if code in ("E0514", "E0515")] == ["E0514"]
