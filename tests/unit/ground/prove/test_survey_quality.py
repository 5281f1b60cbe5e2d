"""What pictures show is proved for whole ranges, refused with the nearest value that passes, and told for each step."""

import math

from hypothesis import given
from hypothesis import strategies as st

from reference.mapping import PROGRAM, SCAN, SIDEWAYS, checked, program
from reference.sources import findings
from rtshcua.diagnostics.span import Span
from rtshcua.ground.geometry.cameras import SurveyCamera
from rtshcua.ground.prove.survey_quality import StepPictures, SurveyRange, faults, pictures_text
from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.places import OpticalLength
from rtshcua.model.ir.skills import PicturesDecl
from rtshcua.model.quantity import Dimension
from virtual.rows import rows


def step(*changes: tuple[str, str]) -> StepPictures:
    """The pictures of the mission's survey."""
    found = checked(program(*changes))
    assert found.diagnostics == (), found.diagnostics[0].message
    (one,) = found.pictures["flight"]
    return one


def test_skill_that_is_only_forbidden_needs_no_camera() -> None:
    other = ("by mapper", "by camera2")
    forbidden = ("permit takeoff, look by", "forbid look by any when altitude > 50 m\n  permit takeoff by")
    without = ("    look(field, 50 m)\n", "")
    assert checked(program(other, forbidden, without)).diagnostics == ()
    assert [each.code.id for each in checked(program(other, without)).diagnostics] == ["E1701"]
    assert "E0702" in [each.code.id for each in checked(program(other, forbidden)).diagnostics]


@rows(
    ("changes", "code", "at", "message", "help"),
    [
        ([("100 m = 60 m", "100 m = 80 m")], "E1702", "highest",
         "at 80 m a pixel may show 21.93 mm, more than 20 mm", "write `sizes look(highest = 72.9 m)`"),
        ([("40 m .. highest", "40 m .. 80 m")], "E1702", "80 m",
         "at 80 m a pixel may show 21.93 mm, more than 20 mm", "nearest accepted: `72.9 m`"),
        ([("40 m .. highest", "40 m .. 70 m"), ("blur 100 %", "blur 100 % relief 5 m")], "E1702", "70 m",
         "at 70 m a pixel may show 20.56 mm, more than 20 mm", "nearest accepted: `67.9 m`"),
        ([("every 8 m", "every 8.1 m")], "E1703", "8.1 m",
         "from 40 m successive pictures may overlap 79.75 %, less than 80 %", "nearest accepted: `8 m`"),
        ([("every 8 m", "every 8 m"), ("blur 100 %", "blur 100 % relief 5 m")], "E1703", "8 m",
         "from 35 m successive pictures may overlap 77.14 %, less than 80 %", "nearest accepted: `7 m`"),
        ([("every 8 m", "every apart"), ("20 m = 8 m", "20 m = 9 m")], "E1703", "apart",
         "from 40 m successive pictures may overlap 77.5 %, less than 80 %", "write `sizes look(apart = 8 m)`"),
        ([("resolution 2 cm", "resolution pixel"), ("10 cm = 2 cm", "10 cm = 16 mm")], "E1702", "highest",
         "at 60 m a pixel may show 16.448 mm, more than 16 mm", "write `sizes look(highest = 58.3 m)`"),
        ([("80 % forward", "share forward"), ("90 % = 80 %", "90 % = 81 %")], "E1703", "8 m",
         "from 40 m successive pictures may overlap 80 %, less than 81 %", "nearest accepted: `7.6 m`"),
        ([("blur 100 %", "blur shar")], "E0201", "shar", "`shar` is not a size of `look`", "did you mean `share`?"),
        ([("every 8 m", "every aprt")], "E0201", "aprt", "`aprt` is not a size of `look`", "did you mean `apart`?"),
        ([("resolution 2 cm", "resolution share")], "E0310", "share", "", ""),
        ([("every 8 m", "every 1.5 s")], "E1703", "1.5 s",
         "from 40 m successive pictures may overlap 70 %, less than 80 %", "nearest accepted: `1 s`"),
        ([("every 8 m", "every 0.5 s")], "E1704", "0.5 s",
         "pictures are due every 500 ms, but the camera needs 700 ms", "nearest accepted: `700 ms`"),
        ([("every 8 m", "every 4 m")], "E1704", "8 m/s",
         "at 8 m/s pictures are due every 500 ms, but the camera needs 700 ms", "nearest accepted: `5.7 m/s`"),
        ([("blur 100 %", "blur 50 %")], "E1705", "8 m/s",
         "at 8 m/s from 40 m a picture may smear by 72.96 % of a pixel, more than 50 %", "nearest accepted: `5.4 m/s`"),
        ([("blur 100 %", "blur 1 %")], "E1705", "8 m/s",
         "at 8 m/s from 40 m a picture may smear by 72.96 % of a pixel, more than 1 %",
         "no speed of the range keeps it: demand less, raise the least height or distance, or declare a camera with"),
        ([("every 8 m", "every 600 mm")], "E1704", "8 m/s",
         "at 8 m/s pictures are due every 75 ms, but the camera needs 700 ms",
         "no speed of the range keeps it: raise the spacing, or declare a camera with a shorter interval"),
        ([("every 8 m", "every apart"), ("1 m .. 20 m = 8 m", "8.5 m .. 20 m = 9 m")], "E1703", "apart",
         "from 40 m successive pictures may overlap 77.5 %, less than 80 %",
         "no spacing of the range keeps it: demand less, or raise the least height or distance"),
        ([("pattern pattern speed speed", "pattern pattern"), ("blur 100 %", "blur 50 %")], "E1705", "50 %",
         "at 12 m/s from 40 m a picture may smear by 109.44 % of a pixel, more than 50 %",
         "the motion sets no speed, so the vehicle's greatest counts: give the motion a `speed` with a range"),
        ([("resolution 2 cm", "resolution 1 cm")], "E1702", "highest",
         "at 60 m a pixel may show 16.448 mm, more than 10 mm",
         "no value of the range keeps it: demand less, or declare a camera with a longer focal length"),
        ([("blur 100 %", "blur 9_000 % relief 40 m"), ("2 cm", "4 cm")], "E1703", "8 m",
         "from 0 m successive pictures may overlap 0 %, less than 80 %",
         "no spacing of the range keeps it: demand less, or raise the least height or distance"),
        ([("by mapper", "by camera2")], "E1701", "camera2", "`quad` has no camera `camera2`",
         "its cameras are `mapper`"),
        ([*SIDEWAYS, ("away:     length in 8 m .. 15 m", "away:     length in 8 m .. 18 m"), ("field, 50", "wall, 50")],
         "E1702", "18 m", "at 18 m a pixel may show 4.935 mm, more than 4 mm", "nearest accepted: `14.5 m`"),
        ([*SIDEWAYS, ("15 m", "14 m"), ("field, 50 m", "barn, 50 m, 14 m, around")], "E1702", "14 m",
         "around `barn` a pixel may show 5.0", "fly nearer to the structure, or divide it into zones that are rounder"),
        ([("field, 50 m", "field, 50 m, pattern = corridor")], "E1707", "look(field, 50 m, pattern = corridor)",
         "`field` is not a `corridor`, so it has no centre line",
         "declare the zone as in `corridor(a, b, c, width 40 m)`, or use a `grid`"),
        ([*SIDEWAYS, ("field, 50 m", "road, 50 m")], "E1707", "look(road, 50 m)",
         "`road` has a bend", "declare the zone"),
        ([*SIDEWAYS, ("15 m", "14 m"), ("field, 50 m", "wall, 50 m, 10 m, around")], "E1707",
         "look(wall, 50 m, 10 m, around)", "`wall` has no single hole", "leave the structure out of the zone"),
        ([*SIDEWAYS, ("15 m", "14 m"), ("8.5467 E, width 60 m", "8.5467 E, width 20 m"), ("field, 50", "wall, 50")],
         "E0509", "look(wall, 50 m)",
         "`wall` is too small or too curved for the pattern `face`", "declare a wider corridor"),
        ([*SIDEWAYS, ("15 m", "14 m"), ("8.5460 E, 40 m", "8.5460 E, 19 m"),
          ("field, 50 m", "tower, 50 m, 14 m, around")], "E0509", "look(tower, 50 m, 14 m, around)",
         "`tower` is too small or too curved for the pattern `around`", "declare a larger zone around the structure"),
    ],
)  # fmt: skip
def test_demand_that_is_not_kept_is_refused_with_the_nearest_value(
    changes: list[tuple[str, str]], code: str, at: str, message: str, help: str
) -> None:
    text = program(*changes)
    found = [each for each in findings(text) if each.code.id == code]
    assert found, [each.message for each in findings(text)]
    first = found[0]
    assert first.span is not None
    assert (text[first.span.start : first.span.end], first.message[: len(message)]) == (at, message)
    assert first.help is not None
    assert first.help.startswith(help)
    for fix in first.fixes:
        mended = text[: fix.span.start] + fix.replacement + text[fix.span.end :]
        assert code not in [each.code.id for each in findings(mended)], fix.replacement


def emits(*commands: str) -> tuple[str, str]:
    """The change by which the survey emits commands."""
    given = "".join(f"\n  emits MAV_CMD_{each}" for each in commands)
    return "energy   at most 35 %", f"energy at most 35 %{given}"


SHOT, AUTO, SERIES = (
    "IMAGE_START_CAPTURE to camera with param3 = 1",
    "DO_SET_CAM_TRIGG_DIST to camera with param1 =",
    "IMAGE_START_CAPTURE to camera with param3 = 0, param2 =",
)
BY_TIME = ("every 8 m resolution 2 cm overlap 80 % forward", "every 1 s resolution 2 cm overlap 80 % forward")


@rows(
    ("changes", "code", "at", "message", "help"),
    [
        ([emits(f"{SHOT} every 8 m")], "", "", "", ""),
        ([emits(f"{SHOT} every 8.1 m")], "E1708", "8.1 m",
         "pictures are taken every 8.1 m, which is more rarely than every 8 m", "nearest accepted: `8 m`"),
        ([emits(f"{SHOT} every 8.1 m", f"{SHOT} every 8 m")], "", "", "", ""),
        ([emits(f"{SHOT} every 1 s")], "", "", "", ""),
        ([emits(f"{SHOT} every 1.1 s")], "E1708", "1.1 s",
         "pictures are taken every 1.1 s, which at 8 m/s is more rarely than every 8 m", "nearest accepted: `1 s`"),
        ([BY_TIME, emits(f"{SHOT} every 8 m")], "", "", "", ""),
        ([BY_TIME, emits(f"{SHOT} every 9 m")], "E1708", "9 m",
         "pictures are taken every 9 m, which at 8 m/s is more rarely than every 1 s", "nearest accepted: `8 m`"),
        ([emits(f"{SHOT} every 5 m")], "E1704", "5 m",
         "at 8 m/s pictures are taken every 625 ms, but the camera needs 700 ms", "nearest accepted: `5.6 m`"),
        ([emits(f"{SHOT} every 0.5 s")], "E1704", "0.5 s",
         "at 8 m/s pictures are taken every 500 ms, but the camera needs 700 ms", "nearest accepted: `700 ms`"),
        ([emits(f"{AUTO} 8 m at begin")], "", "", "", ""),
        ([emits(f"{AUTO} 12 m at begin")], "E1708", "12 m",
         "pictures are taken every 12 m, which is more rarely than every 8 m", "nearest accepted: `8 m`"),
        ([emits(f"{AUTO} away at begin")], "E1708", "away",
         "pictures are taken every 15 m, which is more rarely than every 8 m", "nearest accepted: `8 m`"),
        ([emits(f"{SERIES} 2 s at begin")], "E1708", "2 s",
         "pictures are taken every 2 s, which at 8 m/s is more rarely than every 8 m", "nearest accepted: `1 s`"),
        ([emits(f"{SERIES} 1 s at begin")], "", "", "", ""),
        ([emits(f"{SHOT} at each waypoint")], "E1708", "emits MAV_CMD_",
         "pictures are taken at single moments, and not every 8 m", "write `every 8 m` for the moment"),
        ([emits("DO_TRIGGER_CONTROL to camera with param1 = 1 at begin")], "", "", "", ""),
        ([emits("SET_CAMERA_ZOOM to camera with param1 = 1, param2 = 1 at begin")], "", "", "", ""),
    ],
)  # fmt: skip
def test_commands_take_the_pictures_that_are_stated(
    changes: list[tuple[str, str]], code: str, at: str, message: str, help: str
) -> None:
    text = program(*changes)
    found = findings(text)
    assert [each.code.id for each in found] == [code] * bool(code), [each.message for each in found]
    for each in found:
        assert each.span is not None
        assert text[each.span.start : each.span.end].startswith(at)
        assert each.message == message
        assert (each.help or "").startswith(help)
        for fix in each.fixes:
            mended = text[: fix.span.start] + fix.replacement + text[fix.span.end :]
            assert findings(mended) == ()


def test_program_of_these_tests_is_accepted() -> None:
    assert findings(PROGRAM) == ()


def test_step_of_a_refused_contract_is_not_reported_again() -> None:
    far = [*SIDEWAYS, ("15 m", "18 m"), ("field, 50 m", "barn, 50 m, 18 m, around")]
    assert [each.message[:7] for each in findings(program(*far)) if each.code.id == "E1702"] == ["at 18 m"]


def test_lines_that_do_not_fit_on_a_path_are_refused() -> None:
    low = [("40 m .. highest", "7 m .. highest"), ("every 8 m", "every 1 m"), ("70 % side", "80 % side"),
           ("8 m/s = 5", "1.4 m/s = 1"), ("field, 50 m", "wide, 7 m")]  # fmt: skip
    (found,) = [each for each in findings(program(*low)) if each.code.id == "E1703"]
    assert found.message.startswith("the lines over `wide` are 2.2")
    assert found.message.endswith("less than 80 %")
    assert [each.code.id for each in findings(program(*low[:-1], ("field, 50 m", "field, 7 m")))].count("E1703") == 0


def test_numbers_of_a_grid_are_those_of_geometry() -> None:
    one = step()
    assert one.pattern == "grid"
    assert math.isclose(one.pixel_um, 50e6 * 13.2 / 8.8 / 5472, rel_tol=0.0002)
    assert (one.across, one.along) == (75_000, 50_000)
    assert one.forward == 8_400
    assert one.lines_apart is not None
    assert one.side == math.floor(10_000 * (1 - one.lines_apart / 75_000))
    assert 7_000 <= one.side < 8_500
    assert one.interval_us == 1_600_000
    assert math.isclose(one.blur / 10_000, 5_000 * 0.001 / (50_000 / 3648), rel_tol=0.001)
    assert one.pictures is not None
    assert 8_000 * (one.pictures - 1) <= 1.2 * 150_000 * 120_000 / one.lines_apart + 200_000
    assert pictures_text(one).startswith("mapper, grid: 13.707 mm per pixel, pictures of 75 m by 50 m, overlap 84 %")


def test_pictures_by_time_and_without_lines_are_told() -> None:
    one = step(("every 8 m", "every 1 s"), ("field, 50 m", "field, 50 m, pattern = perimeter"))
    assert (one.forward, one.side, one.lines_apart, one.interval_us) == (9_000, None, None, 1_000_000)
    bare = step(("every 8 m resolution 2 cm overlap 80 % forward 70 % side blur 100 %", ""))
    assert (bare.forward, bare.interval_us, bare.pictures) == (None, None, None)
    assert bare.lines_apart is not None
    assert bare.lines_apart > 22_500, "without an overlap the height gives the spacing"
    assert pictures_text(bare).endswith(" by 50 m, overlap 51.47 % side, blur 36.48 % of a pixel")


def test_camera_that_looks_sideways_has_its_width_along_the_flight() -> None:
    wall = step(*SIDEWAYS, ("15 m", "14 m"), ("field, 50", "wall, 50"))
    assert (wall.pattern, wall.along, wall.across) == ("face", 15_000, 10_000)
    tower = step(*SIDEWAYS, ("15 m", "14 m"), ("field, 50 m", "tower, 50 m, pattern = around"))
    assert (tower.along, tower.across) == (15_000, 10_000)
    assert wall.pixel_um < tower.pixel_um < 1.05 * wall.pixel_um, "the corners of its round are further away"
    portrait = step(*SIDEWAYS, ("15 m", "14 m"), ("field, 50", "wall, 50"), ("most 1 ms", "most 1 ms portrait"))
    assert (portrait.along, portrait.across) == (10_000, 15_000)


@rows(
    ("call", "most"),
    [("wall, 10 m, 24 m", 4_000), ("wall, 10 m, 24 m, 14 m", 5_600), ("tower, 10 m, 24 m, pattern = around", 4_000)],
)
def test_heights_of_a_scan_are_as_far_apart_as_its_pictures_overlap(call: str, most: int) -> None:
    one = step(*SCAN, ("field, 50 m", call))
    assert one.lines_apart is not None
    assert one.side is not None
    assert most * 0.8 < one.lines_apart <= most
    assert one.side >= 6_000


@rows(("every", "most"), [("3 m", 3_000), ("4 m", 4_000)])
def test_heights_of_a_scan_are_no_further_apart_than_stated(every: str, most: int) -> None:
    one = step(*SCAN, *STEPS, ("field, 50 m", f"wall, 10 m, 24 m, rise = {every}"))
    assert one.lines_apart is not None
    assert one.lines_apart <= most


STEPS = (
    ("away:     ", "rise:     length in 1 m .. 10 m = 3 m,\n  away:     "),
    ("to altitude dist", "to altitude every rise dist"),
)


def test_heights_whose_pictures_overlap_too_little_are_refused() -> None:
    text = program(*SCAN, *STEPS, ("field, 50 m", "wall, 10 m, 24 m, rise = 5 m"))
    (found,) = [each for each in findings(text) if each.code.id == "E1703"]
    assert found.message == "its heights are 4.667 m apart, and neighbouring pictures overlap 53.33 %, less than 60 %"
    assert found.help == "fly at heights that are at most 4 m apart"
    assert found.span is not None
    assert text[found.span.start : found.span.end] == "5 m"


def test_pixels_of_a_survey_at_several_heights_count_from_the_highest_and_overlaps_from_the_lowest() -> None:
    at_levels = (
        ("  altitude: altitude in 40 m", "  lowest:   altitude in 40 m .. 50 m,\n  altitude: altitude in 40 m"),
        ("area at altitude", "area from lowest to altitude"),
    )
    one = step(*at_levels, ("field, 50 m", "field, 40 m, 50 m"))
    assert math.isclose(one.pixel_um, 50e6 * 13.2 / 8.8 / 5472, rel_tol=0.0002)
    assert (one.across, one.along) == (60_000, 40_000)
    low = [
        *at_levels,
        ("lowest:   altitude in 40 m", "lowest:   altitude in 30 m"),
        ("field, 50 m", "field, 40 m, 50 m"),
    ]
    assert "from 30 m successive pictures may overlap 73.33 %, less than 80 %" in [
        each.message for each in findings(program(*low))
    ]


NOWHERE = Span("", 0, 0)


def quantity(value: int, dimension: Dimension) -> Quantity:
    return Quantity(span=NOWHERE, value=value, dimension=dimension)


DEMANDS = st.builds(
    lambda every, timed, resolution, forward, blur: PicturesDecl(
        span=NOWHERE,
        camera=Name(span=NOWHERE, text="mapper"),
        every=quantity(every * 1_000 if timed else every, Dimension.DURATION if timed else Dimension.LENGTH),
        resolution=OpticalLength(span=NOWHERE, value=resolution),
        forward=quantity(forward, Dimension.RATIO),
        side=None,
        blur=quantity(blur, Dimension.RATIO),
        relief=None,
    ),
    st.integers(100, 30_000),
    st.booleans(),
    st.integers(1_000, 60_000),
    st.integers(0, 9_500),
    st.integers(100, 30_000),
)
CAMERAS = st.builds(
    SurveyCamera,
    st.integers(4_000, 24_000),
    st.integers(6_000, 36_000),
    st.integers(1_000, 9_000),
    st.integers(1_000, 9_000),
    st.integers(4_000, 90_000),
    st.integers(1_000, 2_000_000),
    st.integers(100, 5_000),
)


@given(CAMERAS, DEMANDS, st.integers(1, 80_000), st.integers(0, 80_000), st.integers(1, 15_000), st.data())
def test_every_flight_within_proved_ranges_keeps_its_demands(
    camera: SurveyCamera, demands: PicturesDecl, near: int, more: int, fastest: int, data: st.DataObject
) -> None:
    found = list(faults(SurveyRange(camera, near, near + more, fastest), demands))
    away, speed = data.draw(st.integers(near, near + more)), data.draw(st.integers(1, fastest))
    of_flight = {fault.code.id for fault in faults(SurveyRange(camera, away, away, speed), demands)}
    assert of_flight <= {fault.code.id for fault in found}
    for fault in found:
        value = None if fault.accepted is None else fault.accepted.value
        if value is None:
            continue
        flown = SurveyRange(camera, near, near + more, fastest)
        if fault.change == "distance":
            flown = flown._replace(near=min(near, value), far=value)
        elif fault.change == "speed":
            flown = flown._replace(speed=value)
        asked = demands
        if fault.change == "every":
            assert demands.every is not None
            asked = demands.copied(every=demands.every.copied(value=value))
        assert (fault.code, fault.part) not in [(each.code, each.part) for each in faults(flown, asked)]
