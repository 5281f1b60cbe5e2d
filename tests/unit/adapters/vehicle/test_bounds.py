"""The reach of a mission and an airspace, and the autopilot's own bounds that are narrower."""

import pytest
from msgspec.structs import replace

from rtshcua.adapters.vehicle.ardupilot import ARDUPILOT
from rtshcua.adapters.vehicle.bounds import FlightReach, airspace_reach, narrower, reach_of, unknown
from rtshcua.adapters.vehicle.px4 import PX4
from rtshcua.model.flat.policy import Airspace
from rtshcua.model.flat.zone import AREA, CIRCLE, HIGHEST, LOWEST, POLYGON, Zone
from virtual import case
from virtual.policy import POLICY

M = 1_000
SQUARE = (-100 * M, -100 * M, 100 * M, -100 * M, 100 * M, 100 * M, -100 * M, 100 * M)
COPTER = {"FENCE_TYPE": 7.0, "FENCE_ENABLE": 0.0, "FENCE_RADIUS": 100.0, "FENCE_ALT_MAX": 50.0, "FENCE_ALT_MIN": 5.0,
          "FENCE_MARGIN": 2.0}  # fmt: skip


def test_mission_reach_is_measured_from_the_start() -> None:
    steps = case.mission(case.short_steps()).invocations
    here = reach_of(steps, case.policy(), (0, 0))
    points = [point for step in steps for point in zip(step.plan.path[::2], step.plan.path[1::2], strict=True)]
    assert here.farthest == max(round((x * x + y * y) ** 0.5) for x, y in points)
    assert here.highest >= max(step.plan.altitude for step in steps)
    aside = reach_of(steps, case.policy(), (-100 * M, 0))
    assert aside.farthest > here.farthest or all(x < 0 for x, _ in points)
    assert reach_of((), case.policy(), (0, 0)) == FlightReach()


@pytest.mark.parametrize(("shape", "data"), [
    (POLYGON, SQUARE), (AREA, (1, 4, *SQUARE)), (CIRCLE, (30 * M, 40 * M, (91_421 * 1) ** 2)),
])  # fmt: skip
def test_an_airspace_reaches_as_far_as_its_narrowest_zone(shape: int, data: tuple[int, ...]) -> None:
    wide = Zone("wide", CIRCLE, LOWEST, HIGHEST, (0, 0, (900 * M) ** 2))
    zone = Zone("zone", shape, LOWEST, 60 * M, data)
    policy = replace(POLICY, zones=(wide, zone), declared=2, airspace=Airspace((0, 1), (), "", 0, 0, 0))
    reach = airspace_reach(policy)
    assert abs(reach.farthest - 141_421) <= 1
    assert reach.highest == 60 * M
    assert airspace_reach(POLICY) == FlightReach()


@pytest.mark.parametrize(("changed", "armed", "reach", "found"), [
    ({}, True, FlightReach(97 * M, 47 * M, 10 * M), []),
    ({}, True, FlightReach(98 * M, 47 * M, 10 * M), [("FENCE_RADIUS", 101)]),
    ({}, True, FlightReach(97 * M, 48 * M, 10 * M), [("FENCE_ALT_MAX", 51)]),
    ({"FENCE_MARGIN": 5.0}, True, FlightReach(97 * M, 40 * M, 20 * M), [("FENCE_RADIUS", 102)]),
    ({"FENCE_TYPE": 4.0}, True, FlightReach(900 * M, 900 * M, 0), []),
    ({"FENCE_TYPE": 15.0}, True, FlightReach(9 * M, 9 * M, 7 * M), [("FENCE_ALT_MIN", 4)]),
    ({}, False, FlightReach(900 * M, 900 * M, 0), []),
    ({"FENCE_ENABLE": 1.0}, False, FlightReach(900 * M, 9 * M, 0), [("FENCE_RADIUS", 903)]),
    ({"FENCE_TYPE": float("nan")}, True, FlightReach(900 * M, 900 * M, 0), []),
])  # fmt: skip
def test_narrow_armed_bounds_are_found(
    changed: dict[str, float], armed: bool, reach: FlightReach, found: list[tuple[str, int]]
) -> None:
    bounds = narrower(ARDUPILOT.own_fence, COPTER | changed, reach, 3 * M, armed=armed)
    assert [(each.parameter, each.needed) for each in bounds] == found


def test_px4s_bounds_are_off_at_zero() -> None:
    far = FlightReach(900 * M, 900 * M)
    assert not list(narrower(PX4.own_fence, {"GF_MAX_HOR_DIST": 0.0, "GF_MAX_VER_DIST": 0.0}, far, 0, armed=False))
    found = list(narrower(PX4.own_fence, {"GF_MAX_HOR_DIST": 10.0, "GF_MAX_VER_DIST": 0.0}, far, 0, armed=False))
    assert [each.parameter for each in found] == ["GF_MAX_HOR_DIST"]


def test_a_bound_that_is_armed_has_to_be_known() -> None:
    own = ARDUPILOT.own_fence
    assert unknown(own, {}, armed=True) == "FENCE_TYPE"
    assert unknown(own, {"FENCE_TYPE": 2.0}, armed=True) == "FENCE_RADIUS"
    assert unknown(own, {"FENCE_TYPE": 4.0}, armed=True) is None
    assert unknown(own, {"FENCE_TYPE": 2.0}, armed=False) is None
    assert unknown(PX4.own_fence, {}, armed=True) is None, "it has none of them, or they are off"
