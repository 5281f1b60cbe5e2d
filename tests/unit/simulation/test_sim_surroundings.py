"""Obstacles: range finder readings, and collisions."""

from collections.abc import Callable
from math import cos, hypot, pi, sin
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.model.faults import Pillar as Standing
from rtshcua.simulation.kinematics import Body
from rtshcua.simulation.surroundings import RANGE_MAX_M, RANGE_MIN_M, SECTORS, Cylinder, Surroundings

BEAM = pi / SECTORS


def naive(pillar: Cylinder, body: Body, bearing: float) -> float | None:
    """Compute the distance by stepping along many rays of the beam."""
    for step in range(round(RANGE_MAX_M / 0.05)):
        for ray in range(-10, 11):
            angle = bearing + BEAM * ray / 10
            north, east = body.north + step * 0.05 * cos(angle), body.east + step * 0.05 * sin(angle)
            if hypot(north - pillar.north, east - pillar.east) <= pillar.radius:
                return step * 0.05
    return None


@given(st.floats(-30, 30), st.floats(-30, 30), st.floats(0.5, 5), st.floats(-pi, pi))
def test_distance_matches_a_walk_along_the_beam(north: float, east: float, radius: float, yaw: float) -> None:
    pillar, body = Cylinder(north, east, radius, 20.0), Body(yaw=yaw)
    surroundings = Surroundings()
    surroundings.pillars.append(pillar)
    seen, walked = surroundings.ahead(body), naive(pillar, body, yaw)
    if walked is None or seen is None:
        # rounding at the edge of the beam or the range
        edge = Cylinder(north, east, radius * 0.98 - 0.05, 20.0), Cylinder(north, east, radius * 1.02 + 0.05, 20.0)
        assert walked is seen or naive(edge[0], body, yaw) is None or naive(edge[1], body, yaw) is not None
    else:
        assert abs(max(walked, RANGE_MIN_M) - seen) < 0.3


def test_sectors_and_distance_from_above() -> None:
    surroundings = Surroundings()
    surroundings.pillars += [Cylinder(10.0, 0.0, 1.0, 5.0), Cylinder(0.0, 20.0, 1.0, 30.0)]
    around = surroundings.around(Body(yaw=pi / 2))
    assert around[0] == pytest.approx(19.0)
    assert around[54] == pytest.approx(9.0)
    assert sum(seen is not None for seen in around) in range(2, 8)
    assert surroundings.around(Body(yaw=pi / 2, up=6.0))[54] is None
    surroundings.see(3.0)
    assert surroundings.around(Body())[0] == 3.0


def test_nearest_obstacle_in_range_is_reported() -> None:
    surroundings = Surroundings()
    surroundings.pillars += [Cylinder(30.0, 0.0, 1.0, 9.0), Cylinder(15.0, 0.0, 1.0, 9.0)]
    assert surroundings.ahead(Body()) == pytest.approx(14.0)
    assert surroundings.ahead(Body(north=-30.0)) is None
    assert surroundings.ahead(Body(north=14.5)) == RANGE_MIN_M


def test_forward_range_finder_sees_the_obstacle_ahead(pilot: Callable[..., Any], flavour: str) -> None:
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


def test_collision_leaves_the_vehicle_tilted_on_the_ground(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour, faults=(Standing(0, 30_000, 0, 2_000, 30_000),))
    for number in (30, 33, 245):
        p.long(511, number, 50_000)
    p.take_off(20)
    p.go_to(60, 0, 20)
    p.until(lambda: p.truth.crashed, seconds=30)
    p.until(lambda: p.truth.up_mm == 0, seconds=10)
    p.wait(1)
    fall = max(f.message.vz for f in p.seen if f.name == "GLOBAL_POSITION_INT")
    assert fall > 1_000, "it comes down fast"
    assert abs(p.last("ATTITUDE").roll) > 1.2
    assert 27_000 < p.truth.north_mm < 29_000
    # neither detects it at once: still armed, in the air and in its mode
    assert (p.truth.armed, p.truth.in_air, p.last("EXTENDED_SYS_STATE").landed_state) == (True, False, 2)
    p.wait(2)
    if p.px4:  # PX4 never does: its failure detector only warns with the default CBRK_FLIGHTTERM
        assert p.texts()[-1] == "Attitude failure detected\t"
        p.wait(60)
        assert p.last("EXTENDED_SYS_STATE").landed_state == 2
        assert p.truth.armed
        assert p.long(400, 0) == [1]
        assert p.long(400, 0, 21196) == [0]
    else:  # crash_check.cpp: 2 s
        assert "Crash: Disarming: AngErr=80>30, Accel=1.0<3.0" in p.texts()
    p.wait(1)
    assert (p.truth.armed, p.last("EXTENDED_SYS_STATE").landed_state) == (False, 1)
    assert abs(p.last("ATTITUDE").roll) > 1.2
    assert p.arm() == [1 if p.px4 else 4]


def test_flight_above_an_obstacle_is_free(pilot: Callable[..., Any]) -> None:
    p = pilot("px4", faults=(Standing(0, 20_000, 0, 2_000, 10_000), Standing(0, 40_000, 0, 2_000, 50_000, 20_000_000)))
    p.take_off(15)
    p.wait(5)
    p.go_to(60, 0, 15)
    p.wait(25)
    assert p.truth.north_mm > 55_000
    assert not p.truth.crashed
