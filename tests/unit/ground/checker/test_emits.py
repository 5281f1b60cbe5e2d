"""Findings on the commands to payload that skills emit, and what the others are lowered to: tables by hand."""

import pytest

from reference.sources import IMPORTS, found, policy
from virtual.rows import rows

SKILL = """
skill probe(
  area: zone,
  place: position,
  altitude: altitude in 5 m .. 50 m,
  pitch: angle in -90 deg .. 0 deg = -90 deg,
  many: count in 1 .. 20_000_000 = 3,
  pause: duration in 100 ms .. 9 s = 1 s,
  pattern: one of grid, orbit = grid,
) {
  motion   cover area at altitude pattern pattern
  class    tactical
  deadline 5 s
  valid    for 10 min
  lasts    at most 1 min
  fallback return_home, emergency_land
  energy   at most 9 %
"""
START = "MAV_CMD_IMAGE_START_CAPTURE to camera with param3 = 1"
POINT = "MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW to gimbal with param1 = pitch"
ROI = "MAV_CMD_DO_SET_ROI_LOCATION to gimbal with (param5, param6) = place"


def said(*emits: str) -> list[tuple[str, str]]:
    lines = "".join(f"  emits {each}\n" for each in emits)
    return found(f"{IMPORTS}{SKILL}{lines}}}\n{policy()}")


def test_interval_is_a_size_that_a_project_sets() -> None:
    def said_of(every: str, given: str = "") -> list[tuple[str, str]]:
        declared = SKILL.replace(") {", ") sizes (spacing: length in 1 m .. 50 m = 8 m) {", 1)
        return found(f"{IMPORTS}{declared}  emits {START} every {every}\n}}\n{given}\n{policy()}")

    assert said_of("spacing") == []
    assert said_of("spacing", "sizes probe(spacing = 1 m)") == [("E0431", "payload is commanded too often")]
    assert said_of("spacnig") == [("E0201", "`spacnig` is not a size of `probe`")]
    assert said_of("pause") == [("E0201", "`pause` is not a size of `probe`")]


@rows(
    "emits",
    [
        f"{START} at begin",
        f"{START} every 10 m succeeds with image within 3 s required",
        f"{START} every 10 m succeeds with all_images within 20 s required",
        f"{START}, param2 = pause every 200 ms succeeds with acknowledgement within 60 s",
        f"{START} at each turn",
        f"{START} at each waypoint",
        f"{POINT}, param2 = unset at begin succeeds with attitude within 2 deg within 3 s",
        f"{POINT}, param5 = GIMBAL_MANAGER_FLAGS_YAW_LOCK at end",
        f"{ROI}, param7 = altitude at begin",
        f"{ROI}, param7 = 30 m above home at begin",
        f"{ROI}, param7 = 30 m at begin",
        "MAV_CMD_DO_SET_ROI_NONE to vehicle at end",
        "MAV_CMD_DO_MOUNT_CONTROL to gimbal with param1 = pitch, param7 = MAV_MOUNT_MODE_MAVLINK_TARGETING at begin",
        "MAV_CMD_DO_WINCH to vehicle with param2 = WINCH_RELATIVE_LENGTH_CONTROL, param3 = -2.5 m at end",
        "MAV_CMD_DO_SET_CAM_TRIGG_DIST to vehicle with param1 = 12.5 m at begin",
    ],
)
def test_emitted(emits: str) -> None:
    assert said(emits) == []


@rows(
    ("emits", "code", "message"),
    [
        ("MAV_CMD_IMAGE_STRAT_CAPTURE to camera at end", "E0416",
         "the dialect has no command `MAV_CMD_IMAGE_STRAT_CAPTURE`"),
        ("MAV_CMD_NAV_LAND to vehicle at end", "E0430", "no skill may emit `MAV_CMD_NAV_LAND`"),
        ("MAV_CMD_COMPONENT_ARM_DISARM to vehicle at end", "E0430", "no skill may emit `MAV_CMD_COMPONENT_ARM_DISARM`"),
        ("MAV_CMD_DO_MOTOR_TEST to camera at end", "E0430", "no skill may emit `MAV_CMD_DO_MOTOR_TEST`"),
        ("MAV_CMD_IMAGE_STOP_CAPTURE to lens at end", "E0431", "unknown addressee `lens`"),
        ("MAV_CMD_IMAGE_STOP_CAPTURE to gimbal at end", "E0431", "`MAV_CMD_IMAGE_STOP_CAPTURE` is not for a gimbal"),
        (f"{START} at start", "E0431", "unknown moment `start`"),
        (f"{START} at each step", "E0431", "unknown moment `step`"),
        (f"{START} every 99 ms", "E0431", "payload is commanded too often"),
        (f"{START} every 5 m/s", "E0310", "a command is repeated by distance or by time"),
        (f"{START} every 0 s", "E0319", "`0 s` must be above zero"),
        (f"{START} at end succeeds with attitude within 2 deg within 3 s", "E0431",
         "no attitude follows `MAV_CMD_IMAGE_START_CAPTURE`"),
        (f"{POINT} at end succeeds with all_images within 9 s", "E0431",
         "no all_images follows `MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW`"),
        (f"{START} at end succeeds with luck within 3 s", "E0431", "unknown success `luck`"),
        (f"{START} at end succeeds with image within 2 deg within 3 s", "E0431", "`2 deg` limits nothing here"),
        (f"{START} at end succeeds with image within 61 s", "E1003", "`61 s` is out of range"),
        (f"{POINT} at end succeeds with attitude within 3 s", "E0431", "the success has no limit that is an angle"),
        ("MAV_CMD_IMAGE_START_CAPTURE to camera at end", "E0603",
         "`MAV_CMD_IMAGE_START_CAPTURE` needs `param3`, Total Images"),
        (f"{START}, param3 = 2 at end", "E0602", "`param3` is given twice"),
        (f"{START}, param7 = 1 at end", "E0402",
         "`MAV_CMD_IMAGE_START_CAPTURE` has no parameter `param7`, or reserves it"),
        (f"{START}, param2 = 2 m at end", "E0403",
         "`param2` of `MAV_CMD_IMAGE_START_CAPTURE` is in `s`, which does not fit a length"),
        (f"{START}, param1 = pitch at end", "E0403",
         "`param1` of `MAV_CMD_IMAGE_START_CAPTURE` has no unit, which does not fit an angle"),
        (f"{START}, param1 = pattern at end", "E0312", "`pattern` is a value of `pattern`"),
        (f"{START}, param1 = many at end", "E0432", "20000000 is too large to be sent precisely"),
        (f"{START}, param1 = CAMERA at end", "E0601", "`CAMERA` is no parameter of `probe`, and no value of `param1`"),
        ("MAV_CMD_DO_SET_ROI_LOCATION to gimbal with param5 = place, param6 = place, param7 = 9 m at end", "E0406",
         "a place is latitude and longitude"),
        (f"{ROI}, param7 = 430 m above sea at end", "E0404", "a height is converted from one above home"),
        (f"{ROI}, param7 = pause at end", "E0403",
         "`param7` of `MAV_CMD_DO_SET_ROI_LOCATION` is in `m`, which does not fit a duration"),
        ("MAV_CMD_DO_SET_SERVO to vehicle with param1 = 9, param2 = 1500 us at end", "E0433",
         "`probe` sets a servo output that `quad` does not declare free"),
    ],
)  # fmt: skip
def test_finding(emits: str, code: str, message: str) -> None:
    assert (code, message) in said(emits)


def test_number_of_commands_is_limited() -> None:
    assert said(*[f"{START} at begin"] * 8) == []
    assert said(*[f"{START} at begin"] * 9) == [("E0431", "`probe` emits too many")]


@pytest.mark.parametrize(
    ("motion", "moment", "has"),
    [("hold", "waypoint", 0), ("hold", "turn", 0), ("fly", "turn", 0), ("fly", "waypoint", 1)],
)
def test_points_of_a_path_need_a_path(motion: str, moment: str, has: int) -> None:
    words = {"hold": "hold", "fly": "fly to place at altitude"}[motion]
    skill = SKILL.replace("cover area at altitude pattern pattern", words)
    made = found(f"{IMPORTS}{skill}  emits {START} at each {moment}\n}}\n{policy()}")
    assert made == ([] if has else [("E0431", f"`probe` has no {moment}s")])


def test_distance_is_not_flown_in_less_than_the_shortest_interval() -> None:
    assert said(f"{START} every 1.2 m") == []
    assert said(f"{START} every 1.1 m") == [("E0431", "payload is commanded too often")]
