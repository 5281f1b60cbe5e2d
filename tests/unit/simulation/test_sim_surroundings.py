"""Things in the world: what is seen of them from where the vehicle is, and what happens to who flies into one."""

from collections.abc import Callable
from math import cos, hypot, pi, sin
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.simulation.faults import Pillar as Standing
from rtshcua.simulation.kinematics import Body
from rtshcua.simulation.surroundings import RANGE_MAX_M, RANGE_MIN_M, SECTORS, Pillar, Surroundings

BEAM = pi / SECTORS


def naive(pillar: Pillar, body: Body, bearing: float) -> float | None:
    """Walks along many rays of the beam."""
    for step in range(round(RANGE_MAX_M / 0.05)):
        for ray in range(-10, 11):
            angle = bearing + BEAM * ray / 10
            north, east = body.north + step * 0.05 * cos(angle), body.east + step * 0.05 * sin(angle)
            if hypot(north - pillar.north, east - pillar.east) <= pillar.radius:
                return step * 0.05
    return None


@given(st.floats(-30, 30), st.floats(-30, 30), st.floats(0.5, 5), st.floats(-pi, pi))
def test_the_distance_is_that_of_a_walk_along_the_beam(north: float, east: float, radius: float, yaw: float) -> None:
    pillar, body = Pillar(north, east, radius, 20.0), Body(yaw=yaw)
    surroundings = Surroundings()
    surroundings.pillars.append(pillar)
    seen, walked = surroundings.ahead(body), naive(pillar, body, yaw)
    if walked is None or seen is None:
        # a hair's breadth on the edge of the beam, or of the range
        edge = Pillar(north, east, radius * 0.98 - 0.05, 20.0), Pillar(north, east, radius * 1.02 + 0.05, 20.0)
        assert walked is seen or naive(edge[0], body, yaw) is None or naive(edge[1], body, yaw) is not None
    else:
        assert abs(max(walked, RANGE_MIN_M) - seen) < 0.3


def test_all_around_and_from_above() -> None:
    surroundings = Surroundings()
    surroundings.pillars += [Pillar(10.0, 0.0, 1.0, 5.0), Pillar(0.0, 20.0, 1.0, 30.0)]
    around = surroundings.around(Body(yaw=pi / 2))
    assert around[0] == pytest.approx(19.0)
    assert around[54] == pytest.approx(9.0)
    assert sum(seen is not None for seen in around) in range(2, 8)
    assert surroundings.around(Body(yaw=pi / 2, up=6.0))[54] is None
    surroundings.see(3.0)
    assert surroundings.around(Body())[0] == 3.0


def test_the_nearer_one_hides_the_other_and_the_range_ends() -> None:
    surroundings = Surroundings()
    surroundings.pillars += [Pillar(30.0, 0.0, 1.0, 9.0), Pillar(15.0, 0.0, 1.0, 9.0)]
    assert surroundings.ahead(Body()) == pytest.approx(14.0)
    assert surroundings.ahead(Body(north=-30.0)) is None
    assert surroundings.ahead(Body(north=14.5)) == RANGE_MIN_M


def test_the_vehicle_sees_what_it_flies_towards(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour, faults=(Standing(0, 60_000, 0, 2_000, 30_000),))
    for number in (132, 330):
        p.long(511, number, 100_000)
    p.take_off(10)
    p.go_to(40, 0, 10)
    p.wait(25)
    t, ahead = p.truth, p.last("DISTANCE_SENSOR")
    assert abs(ahead.current_distance - (58_000 - t.north_mm) / 10) < 15
    around = p.last("OBSTACLE_DISTANCE")
    assert (around.increment, len(around.distances), around.frame) == (5, 72, 12)
    assert around.distances[0] == pytest.approx(ahead.current_distance, abs=15)
    assert around.distances[36] == around.max_distance + 1
    p.go_to(0, 0, 10)
    p.wait(8)
    assert p.last("DISTANCE_SENSOR").current_distance == 4_000, "it points home now"


def test_who_flies_into_it_crashes(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour, faults=(Standing(0, 30_000, 0, 2_000, 30_000),))
    p.take_off(10)
    p.go_to(60, 0, 10)
    p.until(lambda: not p.truth.armed, seconds=30)
    p.wait(3)
    assert (p.truth.crashed, p.truth.up_mm, p.truth.in_air) == (True, 0, False)
    assert 27_000 < p.truth.north_mm < 29_000
    assert any("disarming" in text.lower() for text in p.texts())


def test_over_it_is_free_and_it_may_go_away(pilot: Callable[..., Any]) -> None:
    p = pilot("px4", faults=(Standing(0, 20_000, 0, 2_000, 10_000), Standing(0, 40_000, 0, 2_000, 50_000, 20_000_000)))
    p.take_off(15)
    p.wait(5)
    p.go_to(60, 0, 15)
    p.wait(25)
    assert p.truth.north_mm > 55_000
    assert not p.truth.crashed
