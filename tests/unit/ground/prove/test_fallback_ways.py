"""Ways of fallbacks (E0514, E0515): hull sweeps compared with shapely, and whole missions."""

from math import hypot
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from shapely import MultiPoint, Point, Polygon, box, convex_hull, unary_union

from reference.sources import findings, found, mission, policy, program, skill
from rtshcua.decision.values import FALSE, TRUE
from rtshcua.decision.zones import PreparedZone
from rtshcua.diagnostics.codes import Severity
from rtshcua.ground.prove.airspace_keeping import HullSweep, Landmarks, disc, hull
from rtshcua.model.flat.zone import AREA, CIRCLE, HIGHEST, LOWEST, POLYGON, Zone
from virtual.rows import rows

POINTS = st.tuples(st.integers(-40, 40), st.integers(-40, 40))


class Zones(Landmarks):
    """Landmarks of zones without a policy."""

    def __init__(self, *zones: Zone) -> None:
        self._zones = zones
        self._found = {}


def zone(shape: int, data: tuple[int, ...]) -> Zone:
    return Zone("z", shape, LOWEST, HIGHEST, data)


def answer(flat: Zone, points: list[tuple[int, int]], error: int) -> int:
    sweep = HullSweep(points, (-error, -error, error, error), Zones(flat))
    return sweep.within(PreparedZone(0, flat))


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
def test_hull_sweep_of_a_zone_agrees_with_shapely(name: str, points: list[tuple[int, int]], error: int) -> None:
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
def test_hull_sweep_of_a_circle_agrees_with_distances(points: list[tuple[int, int]], error: int, radius: int) -> None:
    got = answer(zone(CIRCLE, (3, -2, radius * radius)), points, error)
    corners = [(x + dx, y + dy) for x, y in points for dx in (-error, error) for dy in (-error, error)]
    farthest = max(hypot(x - 3, y + 2) for x, y in corners)
    assert (got == TRUE) == (farthest < radius)
    distance = MultiPoint(corners).convex_hull.distance(Point(3, -2))
    if got == FALSE:
        assert distance >= radius
    elif got == TRUE | FALSE:
        assert distance <= radius + 5  # a larger distance is reported as clear


@given(radius=st.integers(1, 1 << 20))
def test_disc_polygon_contains_its_circle(radius: int) -> None:
    corners = hull(disc(radius))
    for (ax, ay), (bx, by) in zip(corners, [*corners[1:], corners[0]], strict=True):
        length = hypot(bx - ax, by - ay)
        assert (ax * by - ay * bx) / length >= radius * (1 - 1e-9)
    assert max(hypot(x, y) for x, y in corners) <= radius * 1.03 + 2


def test_hull_of_degenerate_point_sets() -> None:
    assert hull([(1, 1), (1, 1)]) == [(1, 1)]
    assert hull([(0, 0), (2, 2), (1, 1)]) == [(0, 0), (2, 2)]
    assert disc(0) == [(0, 0)]


UP, HOME = "takeoff(altitude = 20 m)", "return_home()"
CITY = "airspace inside city outside school"


def goto(place: str) -> str:
    return f"goto({place}, altitude = 20 m)"


def other(within: int) -> str:
    """Return a vehicle whose home may be this far from its declared place."""
    return f"""vehicle other {{
  identity "o"  home 47.39774 N, 8.54559 E within {within} m  speed at most 12 m/s  climb at most 3 m/s
  position error 3 m  energy 100 % = 18 min hover  reserve 15 %
}}
"""


def test_way_home_through_a_zone_that_no_leg_touches_is_reported() -> None:
    """The corners of the path and the ways from them avoid the zone, but a way from between them does not."""
    post = "zone post = circle(47.39900 N, 8.54559 E, 6 m)\n"
    legs = [goto("47.40000 N, 8.54480 E"), goto("47.40000 N, 8.54640 E"), goto("47.39800 N, 8.54700 E")]
    rules = policy("airspace inside city outside post")
    flight = mission(UP, *legs, HOME).replace("on quad", "on other")
    [(code, message)] = found(program(other(1), post, rules, flight))
    assert code == "E0514"
    assert message.startswith("the straight way home from this step, which begins 61 m east and 251 m north of home")


@pytest.mark.parametrize(("within", "expected"), [(5, []), (40, ["E0514"])])
def test_position_error_of_home_counts_for_the_way_home(within: int, expected: list[str]) -> None:
    pole = "zone pole = circle(47.39855 N, 8.54590 E, 15 m)\n"
    flight = mission(UP, goto("47.39950 N, 8.54540 E"), HOME).replace("on quad", "on other")
    rules = policy("airspace inside city outside pole")
    assert [code for code, _ in found(program(other(within), pole, rules, flight))] == expected


@rows("within", [5, 20, 26, 30, 60, 200, 2000])
def test_home_disc_outside_the_airspace_is_reported(within: int) -> None:
    yard = "zone yard = circle(47.39774 N, 8.54559 E, 30 m)\n"
    flight = mission(UP, "hover()", HOME).replace("on quad", "on other")
    findings = found(program(other(within), yard, policy("airspace inside yard"), flight))
    if within < 26:  # with 3 m of position error, and a corner of the polygon around the disc
        assert findings == []
    else:
        code, message = next(
            each for each in findings if each[0] != "E0804"
        )  # with so large an error the return also takes too long
        assert (code, message.split(",")[0]) == (
            "E0508",
            f"home may lie up to {within} m from its declared place",
        )


def towered(ceiling: int, returns: str, *steps: str, inside: str = "city") -> list[tuple[str, str, str]]:
    """Return code, message and help of each error of a mission around a tower 195 m north of home."""
    vehicle = other(5).replace("reserve 15 %", f"reserve 15 %  {returns}")
    tower = f"zone tower = circle(47.39950 N, 8.54559 E, 15 m)  ceiling {ceiling} m above home\n"
    around = "zone around = circle(47.39950 N, 8.54559 E, 40 m)  entry 47.39920 N, 8.54559 E\n"
    low = "zone low = circle(47.39774 N, 8.54559 E, 400 m)  ceiling 35 m above home\n"
    rules = policy(f"airspace inside {inside} outside tower")
    look = skill(
        "look(over: zone, top: altitude in 5 m .. 60 m = 20 m, pattern: one of grid, perimeter, orbit = orbit, "
        "pace: speed in 1 m/s .. 8 m/s = 6 m/s)",
        motion="cover over at top pattern pattern speed pace",
        lasts="at most 3 min",
        energy="at most 30 %",
    )
    flight = mission(UP, *steps, HOME).replace("on quad", "on other")
    found = findings(program(vehicle, tower, around, low, look, rules, flight))
    return [(each.code.id, each.message, each.help or "") for each in found if each.code.severity is Severity.ERROR]


ORBIT = (goto("around.entry"), "look(around)", goto("around.entry"))


@rows(
    ("ceiling", "returns", "expected", "help"),
    [
        (28, "return at 30 m", [], ""),
        (29, "return at 30 m", ["E0514"], "with `return at 31 m` the way home leads above all zones on it"),
        (28, "", ["E0514"], "with `return at 30 m` the way home leads above all zones on it"),
        (38, "return at 20 m", ["E0514"], "with `return at 40 m` the way home leads above all zones on it"),
        (16, "", [], ""),  # it always flies above the tower
    ],
)
def test_return_altitude_above_an_obstacle_is_suggested(
    ceiling: int, returns: str, expected: list[str], help: str
) -> None:
    found = towered(ceiling, returns, *ORBIT)
    assert [code for code, _, _ in found] == expected
    if found:
        ((_, message, helps),) = found
        assert message.endswith("would enter `tower`, near 47.39957 N, 8.54575 E")
        assert (help in helps) if help else ("return at" not in helps)


@rows(("ceiling", "help"), [(32, "`return at 34 m`"), (33, "")])
def test_return_altitude_outside_the_airspace_is_not_suggested(ceiling: int, help: str) -> None:
    ((code, _, helps),) = towered(ceiling, "return at 30 m", *ORBIT, inside="low")
    assert code == "E0514"
    assert help in helps
    assert ("return at" in helps) == bool(help)


def test_suggested_return_altitude_is_the_least_sufficient() -> None:
    for ceiling in (21, 33, 38):
        ((_, _, help),) = towered(ceiling, "", *ORBIT)
        named = int(help.split("`return at ")[1].split(" m`")[0])
        assert towered(ceiling, f"return at {named} m", *ORBIT) == []
        assert towered(ceiling, f"return at {named - 1} m", *ORBIT) != []


def test_return_altitude_is_suggested_for_a_returning_step() -> None:
    behind = (goto("47.39860 N, 8.54700 E"), goto("47.40000 N, 8.54620 E"), goto("47.40000 N, 8.54559 E"))
    codes = {code: help for code, _, help in towered(33, "return at 30 m", *behind)}
    assert sorted(codes) == ["E0508", "E0514"]
    assert all("with `return at 35 m` the way home leads above all zones on it" in help for help in codes.values())
    assert towered(33, "return at 35 m", *behind) == []


@rows(
    ("place", "expected"),
    [
        ("47.39789 N, 8.54559 E", ["E0514"]),  # 17 m from home: within 10 + 5 + 3 m
        ("47.39795 N, 8.54559 E", []),  # 23 m
    ],
)
def test_way_home_may_be_low_near_home(place: str, expected: list[str]) -> None:
    """The steps fly around a hedge north of home; a return from close behind it may not climb."""
    hedge = (
        "zone hedge = polygon(47.397840 N, 8.54545 E, 47.397840 N, 8.54573 E, 47.397850 N, 8.54573 E, "
        "47.397850 N, 8.54545 E)  ceiling 25 m above home\n"
    )
    vehicle = other(5).replace("reserve 15 %", "reserve 15 %  return at 30 m")
    around = [goto("47.39774 N, 8.54600 E"), goto("47.39811 N, 8.54600 E"), goto(place)]
    flight = mission(UP, *around, "emergency_land()").replace("on quad", "on other")
    rules = policy("airspace inside city outside hedge")
    found = [each.code.id for each in findings(program(vehicle, hedge, rules, flight))]
    assert found == expected


def test_climb_and_descent_of_the_way_home_are_proved() -> None:
    """A roof over a part of the way, and a roof over the possible places of home."""
    roof = "zone roof = circle(47.39950 N, 8.54559 E, 15 m)  floor 24 m ceiling 50 m above home\n"
    vehicle = other(12).replace("reserve 15 %", "reserve 15 %  return at 55 m")
    under = mission(UP, goto("47.39950 N, 8.54559 E"), HOME).replace("on quad", "on other")
    told = found(program(vehicle, roof, policy("airspace inside city outside roof"), under))
    message, *_ = [message for code, message in told if code != "E0815"]
    assert message == (
        "the climb before the way home from this step, which begins 196 m north of home, would enter `roof`, near "
        "47.39937 N, 8.54559 E"
    )
    porch = roof.replace("47.39950 N, 8.54559 E, 15 m", "47.39774 N, 8.54575 E, 3 m")
    out = mission("takeoff(altitude = 10 m)", "goto(47.39950 N, 8.54559 E, altitude = 10 m)", HOME)
    rules = policy("airspace inside city outside roof")
    messages = [message for _, message in found(program(vehicle, porch, rules, out.replace("on quad", "on other")))]
    assert any(message.startswith("the descent at the end of the way home") for message in messages)


def test_timed_zones_do_not_refuse_a_mission_without_an_issue_time() -> None:
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
def test_flying_links_must_stay_in_the_airspace(link: str, expected: list[str]) -> None:
    rise = skill("rise(up: altitude in 5 m .. 60 m)", motion="climb to up")
    probe = skill("probe()", fallback=f"{link}, return_home, emergency_land")
    rules = policy("airspace inside meadow")
    assert [code for code, _ in found(program(rise, probe, rules, mission(UP, "probe()", HOME)))] == expected


def test_way_home_from_the_end_of_a_link_is_proved() -> None:
    flown = f"{goto('47.39760 N, 8.54970 E')}, return_home, emergency_land"
    rules = policy(CITY, contingency="emergency_land")
    north = goto("47.39860 N, 8.54970 E")
    probe = skill("probe()", fallback=flown)
    messages = found(program(probe, rules, mission(UP, goto("47.39840 N, 8.54820 E"), north, "probe()", HOME)))
    assert [code for code, _ in messages if code in ("E0514", "E0515")] == ["E0514"]
