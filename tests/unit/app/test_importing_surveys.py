"""Surveys of plans: written as `cover` steps where that keeps their meaning, and as the planner's legs otherwise."""

import json
from decimal import Decimal
from fractions import Fraction
from math import hypot
from pathlib import Path
from typing import Any

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from reference.qgc_plans import CAMERA, HOME, RETURN, at, circle, mapped, near, plan, simple, structure, write
from rtshcua.app.importing import ImportedSource, ImportRequest, import_file
from rtshcua.diagnostics.diagnostic import has_errors
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.ground.exchange.plan_surveys import CoveredSurvey, cover_survey, covered_plan
from rtshcua.ground.exchange.qgc_reading import read_plan_file
from rtshcua.ground.exchange.qgc_surveys import MOST_CORNERS, MOST_SURVEYS, NoSurvey
from rtshcua.ground.exchange.stock_policy import GeoPoint
from rtshcua.ground.exchange.zone_source import SourceNames

UP = at(22, 0, 0, 40)
POLICY = Path(__file__).resolve().parents[3] / "policies/bridge_inspection.rts"


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def imported(value: Any, **request: Any) -> ImportedSource:
    found = import_file(ImportRequest(write(Path(), value), **request))
    assert isinstance(found, ImportedSource), found
    return found


def steps(found: ImportedSource) -> list[str]:
    lines = [each.strip() for each in found.text.partition("\nmission ")[2].splitlines()]
    return [each.partition("(")[0] for each in lines if each.endswith(")") and "(" in each]


def lost(found: ImportedSource) -> dict[str, str]:
    return {each.name: each.what for each in found.losses}


def covered(item: Any, *before: Any, **mission: Any) -> CoveredSurvey:
    """The survey of a plan. Raises `NoSurvey`."""
    read = read_plan_file(json.dumps(plan(UP, *before, item, RETURN, **mission)).encode())
    (survey,) = read.surveys.values()
    if isinstance(survey, str):
        raise NoSurvey(survey)
    assert read.home is not None
    return cover_survey(read, survey, GeoPoint(*read.home), SourceNames())


def test_a_survey_becomes_a_step_with_its_camera_and_pictures() -> None:
    found = imported(plan(UP, mapped(), at(16, 1, 1, 40), RETURN))
    assert (found.code, steps(found)) == (ExitCode.OK, ["takeoff", "goto", "survey", "goto", "return_home"])
    text = " ".join(found.text.split())
    for part in (
        "camera test_20 sensor 13.200 mm by 8.800 mm focal 8.800 mm pixels 5472 by 3648 every at least 1000 ms",
        "altitude: altitude in 40 m .. 40 m", "speed in 1 m/s .. 5 m/s = 5 m/s", "one of grid = grid",
        "pictures by test_20 every 10 m resolution 10.965 mm overlap 75 % forward 70 % side",
        "emits MAV_CMD_IMAGE_START_CAPTURE to camera with param3 = 1 every 10 m",
        "goto(target = 47.3980400 N, 8.5457275 E, altitude = 40 m) survey(over = survey_area)",
    ):  # fmt: skip
        assert part in text, part
    told = lost(found)
    assert told == told | {
        "camera-trigger": "a picture every 10 m", "camera-figures": "the exposure of Test 20",
        "survey-lines": "angle 45 deg", "turnaround": "5 m",
    }  # fmt: skip
    assert not {"survey-parameters", "camera"} & set(told)


def test_a_corridor_scan_becomes_a_step_along_a_corridor() -> None:
    found = imported(plan(UP, mapped("CorridorScan"), RETURN))
    assert (found.code, steps(found)) == (ExitCode.OK, ["takeoff", "goto", "corridor_scan", "return_home"])
    assert "zone corridor_scan_area = corridor(47.3980400 N, 8.5455900 E, 47.3985400 N, 8.5457900 E, width 40 m)" in (
        " ".join(found.text.split())
    )
    assert "one of corridor = corridor" in found.text


def test_a_structure_scan_becomes_rounds_that_keep_off_the_structure() -> None:
    found = imported(plan(UP, structure(), RETURN))
    assert (found.code, found.not_kept) == (ExitCode.OK, ())
    assert steps(found) == ["takeoff", "goto", "goto", "structure_scan", "goto", "return_home"]
    text = " ".join(found.text.split())
    for part in (
        "airspace inside field outside structure", "return at 40 m", "lowest: altitude in 10 m .. 10 m",
        "highest: altitude in 20 m .. 20 m", "step: length in 10 m .. 10 m", "away: length in 15 m .. 15 m",
        "from lowest to highest every step distance away pattern pattern facing inward",
        "every 6 m resolution 4.675 mm overlap 70 % forward 30 % side",
        "altitude = 45 m) goto(", "altitude = 10 m) structure_scan(over = structure_area) goto(", ") ceiling 35 m",
    ):  # fmt: skip
        assert part in text, part
    assert lost(found)["structure-round"] == "15 m to 17.051 m away, 4.675 mm a pixel"


#: surveys of which the legs are kept, or which are not kept, and words of the reason
LEGS: list[tuple[str, Any]] = [
    ("no figures", mapped(CameraCalc={"CameraName": "Manual (no camera specs)", "DistanceToSurface": 40})),
    ("no figures", mapped(CameraCalc=CAMERA | {"ImageWidth": 0.5})),
    ("`FocalLength`", mapped(CameraCalc=CAMERA | {"FocalLength": 0})),
    ("`SideOverlap`", mapped(CameraCalc={key: each for key, each in CAMERA.items() if key != "SideOverlap"})),
    ("`FrontalOverlap`", mapped(CameraCalc=CAMERA | {"FrontalOverlap": 100})),
    ("follows terrain", mapped(FollowTerrain=True)),
    ("second time", mapped(Refly90Degrees=True)),
    ("takes no pictures", mapped(trigger=0)),
    ("not the distance", mapped(height=45)),
    ("not above home", mapped(Items=[at(16, 3, east, 448, frame=0, mode=2) for east in (0, 11)])),
    ("other commands", mapped(Items=[at(16, 3, 0, 40), simple(206, 9), simple(205, -45), at(16, 3, 11, 40)])),
    ("not in the file", mapped(Items=[])),
    ("not in its area", mapped(more={"polygon": near(((12, 1), (12, 10), (18, 10), (18, 1)))})),
    ("crosses", mapped(more={"polygon": near(((2, 1), (8, 10), (8, 1), (2, 10)))})),
    ("not in the file", mapped(more={"polygon": near(((2, 1), (8, 10)))})),
    ("not on the globe", mapped(more={"polygon": [[91, 1], [2, 3], [3, 3]]})),
    ("corners", mapped(more={"polygon": near((each, each * each) for each in range(MOST_CORNERS + 1))})),
    ("too small", mapped("CorridorScan", more={"CorridorWidth": 5})),
    ("version", structure(version=2)),
    ("no skill", {"type": "ComplexItem", "complexItemType": "fwLandingPattern"}),
    ("up to 40", structure(((5, 5), (5, 12), (5.3, 12), (5.3, 5)))),
    ("not above home", structure(StartFromTop=True, Layers=9)),
    ("do not overlap", structure(camera={"FrontalOverlap": 0})),
]


def test_a_survey_that_would_lose_its_meaning_says_why() -> None:
    wrong = []
    for words, item in LEGS:
        try:
            wrong.append((words, covered(item)))
        except NoSurvey as error:
            if words not in str(error):
                wrong.append((words, str(error)))  # type: ignore[arg-type]
    assert not wrong


def test_legs_are_kept_with_the_reason() -> None:
    found = imported(plan(UP, mapped(FollowTerrain=True), RETURN))
    assert steps(found) == ["takeoff", *["goto"] * 4, "return_home"]
    assert lost(found)["survey-parameters"] == "survey: it follows terrain"
    asked = imported(plan(UP, mapped(), RETURN), legs=True)
    assert steps(asked) == steps(found)
    assert lost(asked)["survey-parameters"] == "survey: as requested by `--legs`"
    given = imported(plan(UP, mapped(), RETURN), policy=POLICY)
    assert lost(given)["survey-parameters"] == "survey: the given policy has no skill for it"
    (unkept,) = imported(plan(UP, structure(version=2), RETURN)).not_kept
    assert unkept.why == "no skill flies it: its version is not 3"


def test_legs_are_kept_where_the_checker_refuses_the_step() -> None:
    """The step's path crosses an exclusion in the middle of the area, which the planner's legs avoid."""
    found = imported(plan(UP, mapped(), RETURN, circles=[circle(4.6, 5, 6)]))
    assert "survey" not in steps(found)
    assert "the checker refuses it as a step" in lost(found)["survey-parameters"]
    assert "no_fly" in lost(found)["survey-parameters"]


def test_a_survey_that_takes_more_than_a_charge_stays_a_step() -> None:
    area = near(((2, 1), (2, 40), (30, 40), (30, 1)))
    found = imported(plan(UP, mapped(more={"polygon": area}), RETURN))
    assert "survey" in steps(found)
    assert found.code is ExitCode.DIAGNOSTICS
    assert {each.code.id for each in found.diagnostics if has_errors([each])} <= {"E0614", "E0620", "E0812"}


def test_options_of_a_survey_are_named_losses() -> None:
    def names(item: Any) -> set[str]:
        return {each.name for each in covered(item).losses}

    always = {"camera-trigger", "camera-figures", "survey-lines"}
    assert names(mapped(TurnAroundDistance=0)) == always
    assert names(mapped(HoverAndCapture=True)) == always | {"turnaround", "hover-and-capture"}
    assert names(mapped("CorridorScan")) == always | {"turnaround"}
    rounds = {"camera-trigger", "camera-figures", "structure-round"}
    assert names(structure()) == rounds
    assert names(structure(StartFromTop=True, GimbalPitch=-20)) == rounds | {"survey-lines", "gimbal"}
    unstated = covered(mapped(CameraCalc=CAMERA | {"MinTriggerInterval": 0}))
    assert "the exposure and the shortest interval of Test 20" in [each.what for each in unstated.losses]
    assert "every at least 100 ms" in unstated.camera


def test_the_speed_is_that_of_the_plan_before_the_survey() -> None:
    def speed(*before: Any, **mission: Any) -> str:
        return covered(mapped(), *before, **mission).skill.partition("speed: speed in ")[2].partition(",")[0]

    assert speed() == "1 m/s .. 5 m/s = 5 m/s"
    assert speed(hoverSpeed=4) == "1 m/s .. 4 m/s = 4 m/s"
    assert speed(simple(178, 1, 3), simple(178, 2, 1)) == "1 m/s .. 3 m/s = 3 m/s", "not that of climbs"
    assert speed(simple(178, 1, 3), simple(178, 1, -1)) == "1 m/s .. 3 m/s = 3 m/s"
    assert speed(simple(178, 1, 99)) == "1 m/s .. 12 m/s = 12 m/s"


def test_a_portrait_camera_and_layers_from_the_top() -> None:
    turned = covered(mapped(CameraCalc=CAMERA | {"Landscape": False}))
    assert turned.camera.endswith("exposure at most 1 ms portrait")
    top = covered(structure(StartFromTop=True))
    assert "lowest: altitude in 20 m .. 20 m" in top.skill
    assert "highest: altitude in 30 m .. 30 m" in top.skill
    one = covered(structure(Layers=1))
    assert "cover over at altitude distance away" in one.skill


def test_ways_take_the_place_of_legs_in_the_order_of_the_plan() -> None:
    items = UP, at(16, 1, 1, 40), structure(), at(16, 2, 2, 40), mapped(), at(16, 3, 3, 40), RETURN
    read = read_plan_file(json.dumps(plan(*items)).encode())
    surveys, names = [], SourceNames()
    for each in read.surveys.values():
        assert not isinstance(each, str)
        surveys.append(cover_survey(read, each, GeoPoint(*read.home or (0, 0)), names))
    whole = covered_plan(read, surveys)
    assert [each.place.removeprefix("/mission/items/") for each in whole.items] == [
        "0", "1", "2/to", "2", "2/from", "3", "4", "5", "6"
    ]  # fmt: skip
    assert (whole.losses, whole.not_kept) == ((), ())


def test_the_number_of_surveys_is_bounded() -> None:
    read = read_plan_file(json.dumps(plan(*[mapped()] * (MOST_SURVEYS + 1))).encode())
    assert [each for each in read.surveys.values() if isinstance(each, str)] == ["the plan has more than 16 surveys"]


share = st.integers(20, 90)


@st.composite
def surveys(draw: st.DrawFn) -> dict[str, Any]:
    """Surveys with the distances that the planner computes from the camera."""
    height = draw(st.integers(20, 80))
    wide, high, focal = (draw(st.decimals(4, 36, places=1)) for _ in range(3))
    frontal, side = draw(share), draw(share)
    pixels = draw(st.sampled_from(((4000, 3000), (5472, 3648), (640, 512))))
    landscape = draw(st.booleans())
    shown = [float(wide) * height / float(focal), float(wide) * height / float(focal) * pixels[1] / pixels[0]]
    across, along = shown if landscape else shown[::-1]
    camera = CAMERA | {
        "SensorWidth": float(wide), "SensorHeight": float(high), "FocalLength": float(focal), "ImageWidth": pixels[0],
        "ImageHeight": pixels[1], "Landscape": landscape, "FrontalOverlap": frontal, "SideOverlap": side,
        "DistanceToSurface": height, "AdjustedFootprintSide": across * (100 - side) / 100,
        "AdjustedFootprintFrontal": along * (100 - frontal) / 100, "MinTriggerInterval": 0,
    }  # fmt: skip
    north, east = draw(st.integers(7, 20)), draw(st.integers(5, 9))
    corners = ((2, 1), (2, 1 + east), (north, 1 + east), (north, 1))
    return mapped(height=height, CameraCalc=camera, more={"polygon": near(corners)})  # type: ignore[no-any-return]


@given(surveys(), st.integers(1, 9))
@settings(max_examples=30, deadline=None)
def test_a_step_demands_no_less_than_the_survey(item: dict[str, Any], speed: int) -> None:
    """By hand: the pinhole model in fractions, and the legs of the path."""
    camera = item["TransectStyleComplexItem"]["CameraCalc"]
    found = covered(item, hoverSpeed=speed)
    words = found.skill.split()

    def after(word: str) -> Fraction:
        return Fraction(Decimal(words[words.index(word) + 1]))

    metre = {"m": 1, "cm": Fraction(1, 100), "mm": Fraction(1, 1000)}
    every = after("every") * metre[words[words.index("every") + 2]]
    pixel = after("resolution") * metre[words[words.index("resolution") + 2]]
    scale = Fraction(camera["DistanceToSurface"]) / Fraction(str(camera["FocalLength"]))
    wide, high = (Fraction(str(camera[each])) for each in ("SensorWidth", "SensorHeight"))
    along = (high if camera["Landscape"] else wide) * scale
    assert 1 - every / along >= Fraction(camera["FrontalOverlap"], 100) == after("overlap") / 100
    assert Fraction(str(camera["AdjustedFootprintFrontal"])) >= every > 0
    finest = max(wide / camera["ImageWidth"], high / camera["ImageHeight"]) * scale
    assert 0 <= pixel - finest <= Fraction(1, 1_000_000)
    assert f"forward {camera['SideOverlap']} % side" in found.skill
    (there,) = found.way
    (south, west), _, (north, east), _ = item["polygon"]
    latitude, longitude, height = (float(each or 0) for each in there.params[4:])
    assert south < latitude < north
    assert west < longitude < east
    assert height == camera["DistanceToSurface"]
    assert found.seconds > 0
    reached = [hypot((a - HOME[0]) * 111_000, (b - HOME[1]) * 75_000) for a, b in item["polygon"]]
    assert min(reached) <= found.farthest / 1000 <= max(reached) + 5


@pytest.mark.slow
@given(surveys())
@settings(max_examples=12, deadline=None, phases=[Phase.generate])
def test_the_checker_accepts_what_is_written(item: dict[str, Any]) -> None:
    """A survey is refused for its charge or its interval of pictures alone."""
    found = imported(plan(UP, item, RETURN, hoverSpeed=1))
    assert "survey" in steps(found) or "pictures are due" in lost(found)["survey-parameters"]
