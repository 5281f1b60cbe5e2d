"""`import` of plans: steps and zones are those of the plan, each loss is named, and what cannot be kept is refused."""

import json
from pathlib import Path
from typing import Any

import pytest

from reference.qgc_plans import (
    ARDUPILOT,
    HOME,
    PX4,
    RETURN,
    TAKEOFF,
    at,
    circle,
    fence,
    item,
    plan,
    simple,
    survey,
    write,
)
from rtshcua.app import importing
from rtshcua.app.importing import ImportedSource, ImportRequest, import_file
from rtshcua.diagnostics.diagnostic import has_errors
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.exchange.losses import LOSSES
from rtshcua.ground.exchange.plan_source import step_text
from rtshcua.ground.exchange.plan_steps import ImportedSteps, StepTable, plan_steps
from rtshcua.ground.exchange.qgc_reading import read_plan_file
from rtshcua.ground.exchange.zone_source import SourceNames
from rtshcua.ground.format.format_text import format_text
from virtual.rows import rows

POLICY = Path(__file__).resolve().parents[3] / "policies/bridge_inspection.rts"
TO = (at(16, 2, 1, 20), at(16, 3, 1, 25))


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def imported(value: Any, **request: Any) -> ImportedSource:
    found = import_file(ImportRequest(write(Path(), value), **request))
    assert isinstance(found, ImportedSource), found
    return found


def refused(value: Any, **request: Any) -> Refusal:
    found = import_file(ImportRequest(write(Path(), value), **request))
    assert isinstance(found, Refusal), found
    return found


def steps(found: ImportedSource) -> list[str]:
    """The steps in the text of a source."""
    lines = [each.strip() for each in found.text.partition("\nmission ")[2].splitlines()]
    return [each for each in lines if each.endswith(")") and "(" in each]


def lost(found: ImportedSource) -> dict[str, list[str]]:
    """The places of the losses, by name."""
    places: dict[str, list[str]] = {}
    for each in found.losses:
        places.setdefault(each.name, []).append(each.place)
    return places


@rows(
    ("request", "option"),
    [
        ({"terrain": "400..460"}, "--terrain"),
        ({"use": "inside"}, "--as"),
        ({"clock": "+02:00"}, "--clock"),
        ({"width": "20"}, "--width"),
        ({"to": "zones", "legs": True}, "--legs"),
        ({"to": "zones", "proposer": "agent"}, "--proposer"),
        ({"to": "zones", "policy": POLICY}, "--policy"),
    ],
)
def test_an_option_without_a_use_is_refused(request: dict[str, Any], option: str) -> None:
    told = refused(plan(TAKEOFF, *TO, RETURN, polygons=[fence()]), **request)
    assert (told.slug, told.text.split("`")[1], told.help) == ("usage", option, f"leave out `{option}`")


def test_areas_have_no_policy() -> None:
    Path("a.kml").write_text("<kml/>")
    told = import_file(ImportRequest(Path("a.kml"), policy=POLICY))
    assert isinstance(told, Refusal)
    assert told.text == "`--policy` applies to the mission of a plan alone"


def test_a_plan_becomes_a_mission_that_the_checker_accepts() -> None:
    found = imported(plan(TAKEOFF, *TO, RETURN, polygons=[fence()]))
    assert not has_errors(found.diagnostics), found.diagnostics
    assert (found.code, found.steps, found.zones) == (ExitCode.OK, 4, 1)
    assert steps(found) == [
        "takeoff(altitude = 20 m)",
        "goto(target = 47.3979400 N, 8.5456900 E, altitude = 20 m)",
        "goto(target = 47.3980400 N, 8.5456900 E, altitude = 25 m)",
        "return_home()",
    ]
    assert format_text(found.text) == found.text
    assert lost(found) == {"planned-speed": ["/mission/hoverSpeed"]}


#: items after a take-off, the steps that follow, and the names of the losses
MEANINGS: list[tuple[str, list[dict[str, Any]], list[str], set[str]]] = [
    ("a wait at a waypoint", [at(16, 2, 1, 20, 7.5)], ["goto", "hover(time = 7.5 s)"], set()),
    ("a loiter at a place", [at(19, 2, 1, 20, 12)], ["goto", "hover(time = 12 s)"], set()),
    ("a loiter without a place", [item(19, 12, 0, 0, None, None, None, 20)], ["hover(time = 12 s)"], set()),
    ("a delay", [simple(93, 9, -1, -1, -1)], ["hover(time = 9 s)"], set()),
    ("a delay of nothing", [simple(93, 0, -1, -1, -1)], [], set()),
    ("a speed", [simple(178, 1, 3, -1), TO[0]], ["speed = 3 m/s"], {"-planned-speed"}),
    ("a speed of climb", [simple(178, 2, 3, -1), TO[0]], ["goto"], {"vertical-speed", "-planned-speed"}),
    ("a landing elsewhere", [at(21, 2, 1, 0)], ["goto", "emergency_land()"], set()),
    ("a landing there", [TO[0], at(21, 2, 1, 0)], ["goto", "emergency_land()"], set()),
    ("a landing with options", [at(21, 2, 1, 0, 10, 1)], ["goto", "emergency_land()"], {"landing-options"}),
    ("the same place again", [TO[0], TO[0]], ["goto"], set()),
    ("the heading", [at(16, 2, 1, 20, 0, 0, 0, 90)], ["goto"], {"yaw"}),
    ("a radius", [at(16, 2, 1, 20, 0, 5)], ["goto"], {"acceptance-radius"}),
    ("photos", [simple(206, 25, 0, 1), simple(2000, 0, 1, 1), simple(530, 0, 2)], [], {"camera"}),
    ("a gimbal", [simple(205, -45)], [], {"gimbal"}),
    ("a region of interest", [at(195, 2, 1, 0)], [], {"region-of-interest"}),
    ("a gripper", [simple(211, 1, 0)], [], {"payload"}),
    ("a mark", [simple(189)], [], {"marker"}),
    ("a fence switch", [simple(207, 0)], [], {"fence-switch"}),
    ("a transition", [simple(3000, 4)], [], {"vtol"}),
    ("a take-off and a landing of a VTOL", [at(84, 0, 0, 22), at(85, 0, 0, 0)], ["takeoff", "emergency"], {"vtol"}),
    ("a height above sea", [at(16, 2, 1, 430, frame=0, mode=2)], ["altitude = 22 m"], {"height-datum"}),
    (
        "a height above terrain, computed by the planner",
        [at(16, 2, 1, 431.5, frame=0, mode=3)], ["altitude = 23.5 m"], {"height-datum", "height-above-terrain"},
    ),
    ("a survey", [survey(TO[0], simple(206, 20), TO[1])], ["goto", "goto"], {"survey-parameters", "camera"}),
    ("a corridor scan", [survey(*TO, kind="CorridorScan")], ["goto", "goto"], {"survey-parameters"}),
]  # fmt: skip


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> StepTable:
    """What items mean under a policy that was made for a plan."""
    request = ImportRequest(write(tmp_path_factory.mktemp("table"), plan(TAKEOFF, RETURN, polygons=[fence()])))
    policy = importing._drafted(request, read_plan_file(request.file.read_bytes()), SourceNames())
    assert not isinstance(policy, Refusal)
    return policy.table


def translated(table: StepTable, *items: dict[str, Any], without: tuple[str, ...] = ()) -> ImportedSteps:
    """The steps of items between a take-off and a return, without these two."""
    read = read_plan_file(json.dumps(plan(TAKEOFF, *items, RETURN)).encode())
    found = plan_steps(read, table, (*without, *(each.place for each in read.not_kept)))
    assert [each.step.skill for each in (found.steps[0], found.steps[-1])] == ["takeoff", "return_home"]
    losses = (*read.losses, *found.losses)
    return ImportedSteps(found.steps[1:-1], losses, (*read.not_kept, *found.not_kept))


def test_each_item_has_its_meaning(table: StepTable) -> None:
    wrong = []
    for name, items, expected, losses in MEANINGS:
        found = translated(table, *items)
        got = [step_text(each) for each in found.steps]
        more = {each for each in losses if not each.startswith("-")}
        wanted = ({"planned-speed"} | more) - {each[1:] for each in losses}
        told = {each.name for each in found.losses}
        if len(got) != len(expected) or not all(map(str.__contains__, got, expected)) or told != wanted:
            wrong.append((name, got, told ^ wanted))
    assert not wrong


#: items that are not kept, and words of the reason
NOT_KEPT: list[tuple[str, dict[str, Any], str]] = [
    ("NAV_WAYPOINT", at(16, 2, 1, 20, frame=10, mode=4), "above terrain"),
    ("NAV_WAYPOINT", at(16, 2, 1, 20, frame=11, mode=None), "above terrain"),
    ("NAV_WAYPOINT", at(16, 2, 1, 20, frame=3, mode=4), "above terrain"),
    ("NAV_WAYPOINT", at(16, 2, 1, 430, frame=0, mode=1), "contradicts"),
    ("NAV_WAYPOINT", at(16, 2, 1, 20, frame=1, mode=None), "frame"),
    ("NAV_WAYPOINT", at(16, 2, 1, None), "no height"),
    ("NAV_WAYPOINT", at(16, 2, 1, 20, autoContinue=False), "stop"),
    ("NAV_LOITER_UNLIM", at(17, 2, 1, 20), "without an end"),
    ("NAV_LOITER_TURNS", at(18, 2, 1, 20, 3), "circles"),
    ("NAV_LOITER_TO_ALT", at(31, 2, 1, 20), "circles"),
    ("NAV_SPLINE_WAYPOINT", at(82, 2, 1, 20), "curves"),
    ("DO_JUMP", simple(177, 1, 3), "repeat"),
    ("DO_SET_HOME", at(179, 2, 1, 0), "home"),
    ("12345", simple(12345), "no mapping"),
    ("survey", survey(), "not in the file"),
    ("StructureScan", survey(TO[0], kind="StructureScan"), "no skill"),
    ("fwLandingPattern", {"type": "ComplexItem", "complexItemType": "fwLandingPattern"}, "no skill"),
]


def test_what_would_change_the_flight_is_not_kept(table: StepTable) -> None:
    wrong = []
    for name, each, words in NOT_KEPT:
        found = translated(table, each)
        (unkept,) = found.not_kept
        told = (unkept.name, unkept.place, words in unkept.why, found.steps)
        if told != (name, "/mission/items/1", True, ()):
            wrong.append((name, told, unkept.why))
    assert not wrong


@pytest.mark.parametrize("skip", ["NAV_LOITER_UNLIM", "/mission/items/1", "all"])
def test_nothing_is_written_until_a_person_leaves_the_part_out(skip: str) -> None:
    value = plan(TAKEOFF, at(17, 2, 1, 20), RETURN, polygons=[fence()])
    found = imported(value, output=Path("out.rts"))
    assert (found.code, found.text, len(found.not_kept)) == (ExitCode.DIAGNOSTICS, "", 1)
    assert not Path("out.rts").exists()
    left = imported(value, output=Path("out.rts"), skip=(skip,))
    assert steps(left) == ["takeoff(altitude = 20 m)", "return_home()"]
    assert [one.name for one in left.left_out] == ["NAV_LOITER_UNLIM"]
    assert Path("out.rts").exists()


def test_skip_must_name_what_is_refused() -> None:
    value = plan(TAKEOFF, at(17, 2, 1, 20), RETURN)
    told = refused(value, skip=("NAV_LOITER_UNLIMITED",))
    assert (told.slug, told.help) == ("usage", "did you mean `NAV_LOITER_UNLIM`?")
    assert "no item of its mission flies" in refused(plan(at(17, 2, 1, 20)), skip=("all",)).text


def test_an_unset_parameter_is_a_default_on_px4_and_zero_on_ardupilot() -> None:
    unset = [item(19, 5, 0, 0, None, None, None, None), at(22, 0, 0, None)]
    px4 = imported(plan(TAKEOFF, *unset, RETURN, firmware=PX4))
    assert [each.name for each in px4.not_kept] == ["NAV_LOITER_TIME", "NAV_TAKEOFF"]
    ardupilot = imported(plan(TAKEOFF, *unset[:1], RETURN, firmware=ARDUPILOT))
    assert steps(ardupilot)[1] == "hover(time = 5 s)"
    low = imported(plan(unset[1], RETURN, firmware=ARDUPILOT))
    assert steps(low)[0] == "takeoff(altitude = 0 m)"
    assert low.code is ExitCode.DIAGNOSTICS, "0 m is no altitude to take off to"


def test_a_jump_back_repeats_the_items_before_it_as_often_as_it_says() -> None:
    a, b = at(16, 2, 1, 20, doJumpId=2), at(16, 3, 1, 25, doJumpId=3)
    found = imported(plan(TAKEOFF, a, b, simple(177, 2, 2, doJumpId=4), RETURN, firmware=ARDUPILOT))
    assert found.code is ExitCode.OK
    places = [each.partition(",")[0].removeprefix("goto(target = ") for each in steps(found)[1:-1]]
    assert places == ["47.3979400 N", "47.3980400 N"] * 3


#: jumps that are not written out: forward, unknown, without an end, of a part, to nothing, over a take-off, too often
@pytest.mark.parametrize("jump", [(4, 1), (9, 1), (2, -1), (2, 0), (2, 1.5), (None, 1), (2, None), (1, 1), (2, 255)])
def test_other_jumps_are_not_kept(jump: tuple[float | None, float | None]) -> None:
    items = at(22, 0, 0, 20, doJumpId=1), at(16, 2, 1, 20, doJumpId=2), simple(177, *jump, doJumpId=3)
    found = imported(plan(*items, at(16, 3, 1, 25, doJumpId=4), RETURN))
    assert [each.name for each in found.not_kept] == ["DO_JUMP"]


def test_a_jump_over_another_jump_is_not_kept() -> None:
    items = at(16, 2, 1, 20, doJumpId=2), at(16, 3, 1, 25, doJumpId=3), simple(177, 3, 1), at(16, 4, 1, 25, doJumpId=5)
    found = imported(plan(TAKEOFF, *items, simple(177, 2, 1), RETURN))
    assert [each.place for each in found.not_kept] == ["/mission/items/5"]


def test_a_heading_is_a_loss_only_where_the_autopilot_reads_it() -> None:
    turned = at(16, 2, 1, 20, 0, 0, 0, 90)
    assert "yaw" in lost(imported(plan(TAKEOFF, turned, RETURN, firmware=PX4)))
    assert "yaw" not in lost(imported(plan(TAKEOFF, turned, RETURN, firmware=ARDUPILOT)))


def test_a_plan_that_begins_with_a_flight_gets_a_climb() -> None:
    found = imported(plan(*TO, RETURN))
    assert steps(found)[0] == "takeoff(altitude = 20 m)"
    assert lost(found)["added-takeoff"] == ["/mission/items/0"]


def test_after_a_takeoff_elsewhere_px4_flies_there_and_arducopter_does_not() -> None:
    away = at(22, 5, 5, 20)
    px4 = imported(plan(away, RETURN, firmware=PX4))
    assert steps(px4)[:2] == ["takeoff(altitude = 20 m)", "goto(target = 47.3982400 N, 8.5460900 E, altitude = 20 m)"]
    ardupilot = imported(plan(away, RETURN, firmware=ARDUPILOT))
    assert steps(ardupilot) == ["takeoff(altitude = 20 m)", "return_home()"]
    assert lost(ardupilot)["takeoff-place"] == ["/mission/items/0"]


def test_other_losses_of_a_plan_are_named() -> None:
    value = plan(TAKEOFF, *TO, RETURN, vehicleType=1, rally=[[47.3, 8.5, 30]])
    value["geoFence"]["breachReturn"] = [47.3, 8.5]
    found = imported(value)
    names = {"vehicle-type", "rally-points", "no-fence", "breach-return", "planned-speed"}
    assert set(lost(found)) == names
    assert {each["name"] for each in found.as_object()["losses"]} == names  # type: ignore[attr-defined]
    assert names <= set(LOSSES)


def test_several_areas_are_any_of_them_on_px4_and_all_of_them_on_ardupilot() -> None:
    value = [fence(), fence(), circle(0, 0, 150, inclusion=True), circle(9, 9, 20)]
    polygons, circles = value[:2], value[2:]
    px4 = imported(plan(TAKEOFF, RETURN, polygons=polygons, circles=circles))
    assert "airspace inside fence_areas outside no_fly" in " ".join(px4.text.split())
    assert "zone fence_areas = union(fence, fence_2, fence_3)" in px4.text
    ardupilot = imported(plan(TAKEOFF, RETURN, polygons=polygons, circles=circles, firmware=ARDUPILOT))
    assert "airspace inside fence, fence_2, fence_3 outside no_fly" in " ".join(ardupilot.text.split())
    assert not has_errors(px4.diagnostics)
    assert not has_errors(ardupilot.diagnostics)


def test_the_fence_alone_becomes_zones() -> None:
    found = imported(
        plan(TAKEOFF, polygons=[fence(), fence(inclusion=False)], circles=[circle(1, 1, 12.5)]), to="zones"
    )
    assert (found.zones, found.steps, found.code) == (3, 0, ExitCode.OK)
    assert "// For a policy: airspace inside fence outside no_fly, no_fly_2" in found.text
    assert "circle(47.3978400 N, 8.5456900 E, 12.5 m)" in found.text
    old = plan()
    old["geoFence"] = {"version": 1, "polygon": [[47.39, 8.54], [47.39, 8.55], [47.40, 8.55]]}
    assert imported(old).zones == 1, "a plan without items is its fence"
    assert "has no fence" in refused(plan(TAKEOFF), to="zones").text


def test_a_fence_without_an_area_is_refused_in_words_of_the_plan() -> None:
    (unkept,) = imported(plan(TAKEOFF, polygons=[fence(corners=((47.39, 8.54), (47.40, 8.55)))])).not_kept
    assert (unkept.name, unkept.place) == ("fence", "/geoFence/polygons/0/polygon")
    assert unkept.why == "it has 2 of at least 3 corners"
    assert unkept.help == "draw it again in QGroundControl, with three corners or more"


def test_a_crossed_fence_is_refused_by_its_place() -> None:
    crossed = fence(corners=((47.39, 8.54), (47.40, 8.55), (47.40, 8.54), (47.39, 8.55)))
    (unkept,) = imported(plan(TAKEOFF, RETURN, polygons=[crossed])).not_kept
    assert (unkept.name, unkept.place) == ("fence", "/geoFence/polygons/0/polygon")
    assert "crosses or touches itself" in unkept.why


def test_a_leg_through_an_exclusion_is_refused_by_the_checker() -> None:
    """QGroundControl accepts a leg that crosses an exclusion between two waypoints outside of it."""
    across = plan(TAKEOFF, at(16, 10, 0, 20), RETURN, polygons=[fence()], circles=[circle(5, 0, 20)])
    found = imported(across)
    assert found.code is ExitCode.DIAGNOSTICS
    errors = [each for each in found.diagnostics if each.severity.value == "error"]
    assert any("no_fly" in each.message for each in errors), errors
    shown = {found.text[each.span.start : each.span.end] for each in errors if each.span is not None}
    assert any("47.3987400 N" in each for each in shown), "the finding is at the step of the leg"
    around = plan(TAKEOFF, at(16, 10, 0, 20), RETURN, polygons=[fence()], circles=[circle(5, 12, 20)])
    assert imported(around).code is ExitCode.OK


def test_a_mission_under_a_given_policy() -> None:
    value = plan(TAKEOFF, at(16, 3, 2, 20), RETURN, polygons=[fence()])
    Path("missions").mkdir()
    found = imported(value, policy=POLICY, output=Path("missions/site.rts"), proposer="agent")
    assert Path("missions/site.rts").read_text(encoding="utf-8") == found.text
    assert "under bridge_inspection@7 on quad" in found.text
    assert "proposed by agent import for role operator" in found.text
    assert {"fence"} <= set(lost(found))
    assert not [each for each in found.diagnostics if each.code.id.startswith("E01")], "the import resolves"
    again = import_file(ImportRequest(Path("site.plan"), output=Path("missions/site.rts")))
    assert isinstance(again, Refusal)
    assert "exists" in again.text


def test_heights_above_sea_need_the_elevation_of_home() -> None:
    above_sea = at(16, 2, 1, 430, frame=0, mode=2)
    (unkept,) = imported(plan(TAKEOFF, above_sea, RETURN, plannedHomePosition=[*HOME[:2], None])).not_kept
    assert "height of home" in unkept.why


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        ({"to": "missions"}, "`missions` is not accepted by `--to`"),
        ({"proposer": "nobody"}, "`nobody` is not accepted by `--proposer`"),
        ({"output": Path("out.txt")}, "does not end in `.rts`"),
        ({"output": Path("none/out.rts")}, "no folder"),
        ({"policy": Path("none.rts")}, "none.rts"),
    ],
)
def test_wrong_requests(request_: dict[str, Any], words: str) -> None:
    assert words in refused(plan(TAKEOFF, RETURN), **request_).text


def test_the_page_lists_all_losses() -> None:
    page = (POLICY.parents[1] / "docs/import.md").read_text(encoding="utf-8")
    assert all(f"| `{name}` | {consequence} |" in page for name, consequence in LOSSES.items())
