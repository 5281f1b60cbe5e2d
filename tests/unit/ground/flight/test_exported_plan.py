"""The plan for QGroundControl, loaded as that program loads it."""

import json
from typing import Any

import msgspec
import pytest

from reference.exported_flight import export_of, moved, run_in
from reference.qgc_loader import load
from rtshcua.app.flights import flight_export as service
from rtshcua.ground.flight.export.exported import FlightExport
from rtshcua.ground.flight.export.qgc_plan import qgc_plan
from rtshcua.mavlink import enums
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import ALONG, Plan
from virtual import case


@pytest.fixture(scope="module")
def export(tmp_path_factory: pytest.TempPathFactory) -> FlightExport:
    return export_of(run_in(tmp_path_factory.mktemp("plan") / "run"))


def made(export: FlightExport) -> tuple[dict[str, Any], list[str]]:
    found = service._plan(export)
    plan: dict[str, Any] = json.loads(found.data)
    assert len(load(plan)) == found.points
    return plan, list(found.warnings)


def with_steps(export: FlightExport, *plans: Plan) -> FlightExport:
    """The flight with steps of these plans."""
    step = case.short_steps()[0]
    steps = tuple(msgspec.structs.replace(step, plan=each, step=number) for number, each in enumerate(plans))
    mission = msgspec.structs.replace(export.flight.mission, invocations=steps)
    return export._replace(flight=export.flight._replace(mission=mission))


def test_the_planned_mission(export: FlightExport) -> None:
    plan, _ = made(export)
    steps = export.flight.mission.invocations
    items = plan["mission"]["items"]
    assert items[0]["command"] == enums.MAV_CMD_NAV_TAKEOFF
    assert items[0]["Altitude"] == steps[0].plan.altitude / 1_000
    assert items[-1]["command"] == enums.MAV_CMD_NAV_RETURN_TO_LAUNCH
    corners = sum(len(each.plan.path) // 2 for each in steps if each.plan.kind in (MotionKind.FLY, MotionKind.COVER))
    assert sum(each["command"] == 16 for each in items) == corners
    assert plan["mission"]["plannedHomePosition"] == [47.39774, 8.54559, 488.0]
    assert all(each["frame"] == 3 for each in items if "Altitude" in each)


@pytest.mark.parametrize(("north", "east"), [(0, 1_714_542_000), (-800_000_000, -1_500_000_000)])
def test_a_plan_anywhere_loads(export: FlightExport, north: int, east: int) -> None:
    made(moved(export, north, east))


def test_every_kind_of_motion(export: FlightExport) -> None:
    plans = (
        Plan(MotionKind.CLIMB, (), 10_000, 0), Plan(MotionKind.FLY, (1_000, 2_000), 12_000, 3_000),
        Plan(MotionKind.CLIMB, (), 20_000, 0), Plan(MotionKind.COVER, (0, 0, 5_000, 0, 5_000, 5_000), 20_000, 3_000),
        Plan(MotionKind.HOLD, (), 0, 0), Plan(MotionKind.LAND, (), 0, 0),
    )  # fmt: skip
    plan, _ = made(with_steps(export, *plans))
    items = plan["mission"]["items"]
    assert [each["command"] for each in items] == [22, 178, 16, 16, 16, 16, 16, 19, 21]
    assert [each["Altitude"] for each in items if "Altitude" in each] == [10, 12, 20, 20, 20, 20, 20, 0]
    assert items[1]["params"] == [1, 3.0, -1, 0, 0, 0, 0]
    last = items[-1]["params"][4:6]
    assert last == items[-2]["params"][4:6] == items[-3]["params"][4:6]


def test_each_point_has_its_own_height_and_yaw(export: FlightExport) -> None:
    path = (0, 0, 5_000, 0, 5_000, 5_000)
    cover = Plan(MotionKind.COVER, path, 20_000, 0, (12_000, 12_000, 20_000), (9_000, 17_950, ALONG))
    plan, _ = made(with_steps(export, Plan(MotionKind.CLIMB, (), 10_000, 0), cover, Plan(MotionKind.LAND, (), 0, 0)))
    items = [each for each in plan["mission"]["items"] if each["command"] == 16]
    assert [each["Altitude"] for each in items] == [12, 12, 20]
    assert [each["params"][3] for each in items] == [90, 179.5, None]


def test_the_airspace_is_the_fence(export: FlightExport) -> None:
    policy = export.flight.policy
    assert policy.airspace is not None
    plan, warnings = made(export)
    fence = plan["geoFence"]
    inclusions = [each["inclusion"] for each in (*fence["polygons"], *fence["circles"])]
    left_out = sum("it may be flown over or under" in each for each in warnings)
    assert inclusions.count(True) == len(policy.airspace.inside)
    assert inclusions.count(False) == len(policy.airspace.outside) - left_out


def test_without_telemetry_home_is_the_declared_one(export: FlightExport) -> None:
    blind = export._replace(flight=export.flight._replace(telemetry=None))
    plan, warnings = made(blind)
    assert plan["mission"]["plannedHomePosition"] == [47.39774, 8.54559, 0]
    assert "home's height above the sea is not known; the plan says 0 m" in warnings


def test_the_description_is_where_the_program_ignores_it(export: FlightExport) -> None:
    data, _ = qgc_plan(export, ())
    plan = json.loads(data)
    assert "log: not verified: a test" in "\n".join(plan["rtshcua"]["description"])
    load({name: each for name, each in plan.items() if name != "rtshcua"})
