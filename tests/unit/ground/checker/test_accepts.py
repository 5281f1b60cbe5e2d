"""Findings on what skills accept of MAVLink: a table by hand, with the messages."""

from reference.sources import IMPORTS, found, policy
from virtual.rows import rows

SKILL = """
skill probe(
  place: position,
  altitude: altitude in 5 m .. 50 m,
  speed: speed in 1 m/s .. 8 m/s = 4 m/s,
  pattern: one of grid, orbit = grid,
  share: ratio in 1 % .. 50 % = 9 %,
) {
  motion   fly to place at altitude speed speed
  class    tactical
  deadline 5 s
  valid    for 10 min
  lasts    at most 1 min
  fallback return_home, emergency_land
  energy   at most 9 %
"""
PLACE = "place = (param5, param6)"
WHOLE = f"MAV_CMD_DO_REPOSITION with {PLACE}, altitude = param7 above home"


def said(*accepts: str) -> list[tuple[str, str]]:
    lines = "".join(f"  accepts {each}\n" for each in accepts)
    return found(f"{IMPORTS}{SKILL}{lines}}}\n{policy()}")


@rows(
    "accepts",
    [
        WHOLE,
        f"{WHOLE}, speed = param1 or default",
        f"MAV_CMD_DO_REPOSITION with {PLACE} or here, altitude = param7 in frame or here",
        "MAV_CMD_DO_REPOSITION with place = here, altitude = param7 above sea or parameter RTL_ALT above home",
        "mode GUIDED on ardupilot with place = here, altitude = parameter RTL_ALT above home",
        f"MAV_CMD_DO_REPOSITION where param2 = MAV_DO_REPOSITION_FLAGS_CHANGE_MODE with {PLACE}, altitude = here",
        f"MAV_CMD_DO_REPOSITION where param3 = unset and param4 = -1 with {PLACE}, altitude = here",
        "message SET_POSITION_TARGET_GLOBAL_INT where type_mask has POSITION_TARGET_TYPEMASK_VX_IGNORE "
        "with place = (lat_int, lon_int), altitude = alt in frame",
        "message HOME_POSITION with place = (latitude, longitude), altitude = altitude above sea",
    ],
)
def test_accepted(accepts: str) -> None:
    assert said(accepts) == []


@rows(
    ("accepts", "code", "message"),
    [
        ("MAV_CMD_DO_REPOSITON", "E0416", "the dialect has no command `MAV_CMD_DO_REPOSITON`"),
        ("item MAV_CMD_NAV_WAYPOINTS", "E0416", "the dialect has no command `MAV_CMD_NAV_WAYPOINTS`"),
        ("message SET_POSITION", "E0401", "the dialect has no message `SET_POSITION`"),
        ("mode HOLD on ardupilot", "E0417", "`ardupilot` has no mode `HOLD`"),
        ("mode HOLD", "E0417", "each autopilot has modes of its own"),
        ("mode HOLD on betaflight", "E0417", "unknown autopilot `betaflight`"),
        (
            f"MAV_CMD_DO_REPOSITION with {PLACE}, altitude = param8 above home",
            "E0402",
            "`MAV_CMD_DO_REPOSITION` has no field `param8`",
        ),
        (
            f"{WHOLE}, speed = param2",
            "E0403",
            "`param2` of `MAV_CMD_DO_REPOSITION` has no unit, which does not fit a speed",
        ),
        (
            f"{WHOLE}, speed = param3",
            "E0403",
            "`param3` of `MAV_CMD_DO_REPOSITION` is in `m`, which does not fit a speed",
        ),
        (
            "MAV_CMD_DO_REPOSITION with place = (param5, param7), altitude = param7 in frame",
            "E0403",
            "`param7` of `MAV_CMD_DO_REPOSITION` is in `m`, which does not fit a position",
        ),
        (
            "MAV_CMD_DO_REPOSITION with place = param5, altitude = param7 in frame",
            "E0406",
            "`place` is read from a pair of fields, `(latitude, longitude)`",
        ),
        (
            f"MAV_CMD_DO_REPOSITION with {PLACE}, altitude = (param7, param7)",
            "E0406",
            "`altitude` is read from one field",
        ),
        (f"MAV_CMD_DO_REPOSITION with {PLACE}, altitude = param7", "E0404", "the altitude `altitude` needs a datum"),
        (
            f"MAV_CMD_DO_REPOSITION with {PLACE}, altitude = param7 in frame or parameter RTL_ALT",
            "E0404",
            "the altitude `altitude` needs a datum",
        ),
        (
            "message HOME_POSITION with place = (latitude, longitude), altitude = altitude above home",
            "E0404",
            "`altitude` is above sea",
        ),
        (
            "message VFR_HUD with place = here, altitude = alt in frame",
            "E0404",
            "`VFR_HUD` has no field for a frame",
        ),
        (f"{WHOLE}, speed = param1 above home", "E0304", "`speed` is no altitude and has no datum"),
        (f"{WHOLE}, speed = param1 or parameter WPNAV above sea", "E0304", "`speed` is no altitude and has no datum"),
        (f"{WHOLE}, height = param7 above home", "E0601", "`probe` has no parameter `height`"),
        (f"{WHOLE}, {PLACE}", "E0602", "`place` is given twice"),
        (
            f"MAV_CMD_DO_REPOSITION with {PLACE}",
            "E0603",
            "`MAV_CMD_DO_REPOSITION` gives no `altitude`, which `probe` needs",
        ),
        (f"MAV_CMD_DO_REPOSITION with {PLACE}, altitude = param7 in frame or default", "E0603",
         "`altitude` has no default"),
        (f"{WHOLE}, pattern = param2", "E0312", "`pattern` is a value of `pattern`, which no field is"),
        (f"{WHOLE}, speed = param1 or here", "E0312", "`here` is a place or an altitude, `speed` is neither"),
        (
            f"MAV_CMD_DO_REPOSITION with {PLACE} or parameter RTL_ALT, altitude = here",
            "E0312",
            "no parameter of an autopilot is a position",
        ),
    ],
)  # fmt: skip
def test_refused_sources(accepts: str, code: str, message: str) -> None:
    assert said(accepts) == [(code, message)]


@rows(
    ("accepts", "code", "message"),
    [
        (f"MAV_CMD_DO_REPOSITION where param2 = 99999999 with {PLACE}, altitude = here", "E0408",
         "`99999999` is not a value of `param2`"),
        (f"MAV_CMD_DO_REPOSITION where param2 = NO_SUCH with {PLACE}, altitude = here", "E0408",
         "`NO_SUCH` is not a value of `param2`"),
        (f"MAV_CMD_DO_REPOSITION where param2 has unset with {PLACE}, altitude = here", "E0408",
         "`unset` is not a value of `param2`"),
        ("message SET_POSITION_TARGET_GLOBAL_INT where type_mask = unset with place = here, altitude = here", "E0408",
         "`unset` is not a value of `type_mask`"),
        ("message SET_POSITION_TARGET_GLOBAL_INT where type_mask = 65536 with place = here, altitude = here", "E0408",
         "`65536` is not a value of `type_mask`"),
        ("message SET_POSITION_TARGET_GLOBAL_INT where vx has 3 with place = here, altitude = here", "E0407",
         "`vx` has no bits"),
        ("message HOME_POSITION where q = 3 with place = here, altitude = here", "E0407",
         "`q` is an array of 4 numbers"),
        ("message STATUSTEXT where text = 3 with place = here, altitude = here", "E0407", "`text` is text"),
        ("mode GUIDED on ardupilot where param1 = 0 with place = here, altitude = here", "E0402",
         "`GUIDED` has no field `param1`"),
        ("MAV_CMD_NAV_LAND with place = here, altitude = here", "E0419",
         "who sends `MAV_CMD_NAV_LAND` means a landing"),
        ("MAV_CMD_DO_REPOSITION with place = here, altitude = parameter wpnav above home", "E0101",
         "`wpnav` is not a parameter of an autopilot"),
        ("MAV_CMD_DO_REPOSITION with place = here, altitude = a.b above home", "E0101",
         "the name of a field cannot have a dot: `a.b`"),
    ],
)  # fmt: skip
def test_refused_conditions_and_motions(accepts: str, code: str, message: str) -> None:
    assert said(accepts) == [(code, message)]


TWICE = "`{}` is accepted twice, and nothing tells which of both is meant"
HERE = "place = here, altitude = here"


@rows(
    ("one", "other", "alike"),
    [
        ("MAV_CMD_DO_ORBIT", "MAV_CMD_DO_ORBIT", True),
        ("MAV_CMD_DO_ORBIT on px4", "MAV_CMD_DO_ORBIT", True),
        ("MAV_CMD_DO_ORBIT on px4", "MAV_CMD_DO_ORBIT on ardupilot", False),
        ("MAV_CMD_DO_ORBIT", "item MAV_CMD_DO_ORBIT", False),
        ("MAV_CMD_DO_ORBIT where param1 = 1", "MAV_CMD_DO_ORBIT where param1 = 2", False),
        ("MAV_CMD_DO_ORBIT where param1 = 1", "MAV_CMD_DO_ORBIT where param2 = 2", True),
        ("MAV_CMD_DO_ORBIT where param1 = 1", "MAV_CMD_DO_ORBIT where param1 = unset", False),
        ("MAV_CMD_DO_ORBIT where param1 = unset", "MAV_CMD_DO_ORBIT where param1 = unset", True),
        ("message HEARTBEAT where type = 1", "message HEARTBEAT where type = 3", False),
        ("message HEARTBEAT where base_mode has 3", "message HEARTBEAT where base_mode lacks 1", False),
        ("message HEARTBEAT where base_mode has 2", "message HEARTBEAT where base_mode lacks 1", True),
        ("message HEARTBEAT where base_mode = 5", "message HEARTBEAT where base_mode lacks 4", False),
        ("message HEARTBEAT where base_mode = 5", "message HEARTBEAT where base_mode lacks 2", True),
    ],
)
def test_accepted_by_two_skills(one: str, other: str, alike: bool) -> None:
    second = SKILL.replace("skill probe", "skill other")
    text = f"{IMPORTS}{SKILL}  accepts {one} with {HERE}\n}}\n{second}  accepts {other} with {HERE}\n}}\n{policy()}"
    names = [word for word in other.split() if word.isupper()]
    assert found(text) == ([("E0418", TWICE.format(names[0]))] if alike else [])


@rows(
    ("place", "alike"),
    [("(param5, param6)", False), ("(param5, param6) or here", True), ("here", True)],
)
def test_field_that_is_read_is_set_unless_there_is_a_substitute(place: str, alike: bool) -> None:
    second = SKILL.replace("skill probe", "skill other")
    text = (
        f"{IMPORTS}{SKILL}  accepts MAV_CMD_DO_ORBIT where param5 = unset with {HERE}\n}}\n"
        f"{second}  accepts MAV_CMD_DO_ORBIT with place = {place}, altitude = here\n}}\n{policy()}"
    )
    assert found(text) == ([("E0418", TWICE.format("MAV_CMD_DO_ORBIT"))] if alike else [])


def test_one_skill_may_accept_one_command_in_several_ways() -> None:
    here = "MAV_CMD_DO_ORBIT with place = here, altitude = here"
    assert said(f"MAV_CMD_DO_ORBIT with {PLACE}, altitude = here", here) == []
    assert said(here, here) == [("E0418", TWICE.format("MAV_CMD_DO_ORBIT"))]
