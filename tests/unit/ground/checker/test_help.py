"""One mistake gives one finding, with a help that the author can follow."""

from pathlib import Path

from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import check_program
from rtshcua.mavlink import dialect
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[4]
IMPORTS = """
import "lib:policies/site.rts"
import "lib:skills/signals.rts"
import "lib:skills/goto.rts"
import "lib:skills/takeoff.rts"
import "lib:skills/hover.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"
"""
POLICY = """
policy p version 1 {
  permit takeoff, goto, hover by role operator through agent, operator
  permit return_home, emergency_land by any
  RULE
  contingency return_home, emergency_land
}
"""
MISSION = """
import "lib:policies/bridge_inspection.rts"
mission m under bridge_inspection@7 on quad {
  proposed by agent openclaw for role operator
  phase departure { takeoff(altitude = 20 m) }
  phase inspection { STEP }
  phase recovery { return_home() }
}
"""
REMAINING = "signal b : ratio = BATTERY_STATUS.remaining stale after 5 s"
FIX = "enum kind = GPS_FIX_TYPE { none = 1, best = 3 }\n"


def check(text: str) -> tuple[Diagnostic, ...]:
    def read(path: str) -> bytes:
        return text.encode() if path == "example.rts" else Path(path).read_bytes()

    return check_program(load(["example.rts"], read, str(CHECKOUT)), dialect.load())


def rule(text: str) -> str:
    return IMPORTS + POLICY.replace("RULE", text)


def step(text: str) -> str:
    return MISSION.replace("STEP", text)


CASES = [
    (REMAINING, "E0402", "did you mean `battery_remaining`?", "battery_remaining"),
    (REMAINING, "E0402", "and 2 more", "battery_remaining"),
    (FIX + "signal f : kind = GPS_RAW_INT.fix_type unknown at x stale after 5 s", "E0408", "`none`, `best`; as", None),
    ("signal f : ratio = BATTERY_STATUS.battery_remaining unknown at x stale after 5 s", "E0408", "-128 to 127", None),
    (step("goto(bridge_a, altitude = 20 m)"), "E0312", "write `bridge_a.entry`", "bridge_a.entry"),
    (step("goto(school, altitude = 20 m)"), "E0312", "add an `entry` to the zone `school`", None),
    (step("goto(3 m, altitude = 20 m)"), "E0312", "write coordinates", None),
    (step("goto(bridge_a.center, altitude = 20 m)"), "E0201", "write `bridge_a.entry`", "bridge_a.entry"),
    (step("goto(bridge_a.entry, altitude = 20,5 m)"), "E0604", "write `20.5 m`", None),
    (rule("degrade any when wind.speed > 8 m / s to return_home"), "E0201", "write `8 m/s`", "8 m/s"),
    (rule("degrade any when wind.speed > 2 * 8 m / s to return_home"), "E0201", "write `8 m/s`", "8 m/s"),
    (rule("degrade any when gps_fix < fix_3d to return_home"), "E0204", "the signal `gps.fix`", "gps.fix"),
    (rule("degrade any when fix_3d > gps_fix to return_home"), "E0204", "the signal `gps.fix`", "gps.fix"),
    (rule("degrade any when phase > departure to return_home"), "E0323", "phase == inspection", None),
    (step("hover(5 s) { maintain position inside grow(city, -7 m) }"), "E0622", "`grow(school, 20 m)`", None),
    (step("hover(5 s) { require phase == inspection }"), "E0622", "they name none", None),
    (step("hover(5 s) { require battery > 1 % for the last 7 s }"), "E0622", "it monitors none", None),
    (step("hover(5 s) { energy at most 110 % }"), "E0614", "a full battery", None),
    ("zone w = corridor(47.3 N, 8.5 E, 47.4 N, 8.5 E, width 0 m)", "E0516", "at least `10 cm`", None),
    ("zone w = corridor(47.3 N, 8.5 E, 47.4 N, 8.5 E, width -1 m)", "E0319", None, None),
    ("enum v = MAV_VTOL_STATES { a = 3 }\nsignal s : v = EXTENDED_SYS_STATE.vtol_state stale after 3 s", "E0411",
     "did you mean `MAV_VTOL_STATE`?", "MAV_VTOL_STATE"),
    ("import <lib:policies/site.rts>\nzone a = circle(nowhere, 3 m)\n" + POLICY, "E0101", None, None),
]  # fmt: skip


@rows(("text", "code", "help", "replacement"), CASES)
def test_one_mistake_gives_one_finding_with_help(
    text: str, code: str, help: str | None, replacement: str | None
) -> None:
    found = check(text)
    assert {each.code.id for each in found} == {code}
    assert code == "E0101" or len(found) == 1
    assert help is None or help in (found[0].help or "")
    if code != "E0101":
        assert [fix.replacement for fix in found[0].fixes] == ([] if replacement is None else [replacement])


def test_duplicate_is_reported_in_the_compiled_file() -> None:
    (found,) = check('import "lib:policies/site.rts"\nzone city = circle(47.39774 N, 8.54559 E, 100 m)\n')
    assert found.code.id == "E0202"
    assert found.span is not None
    assert found.span.file == "example.rts"
    assert [label.span.file for label in found.labels] != ["example.rts"]


OBSERVE = """
skill observe(time: duration in 1 s .. 25 s = 20 s) {
  motion   hold for time
  class    tactical
  deadline 5 s
  valid    for 20 min
  lasts    at most 30 s
  grace    1 s
  require  gps.fix >= fix_3d
  fallback return_home, emergency_land
  energy   at most 4 %
}
policy p version 1 {
  permit takeoff by role operator through agent
  permit observe by role operator through agent when time <= TIME
  permit return_home by any HOME
  permit emergency_land by any
  contingency return_home, emergency_land
}
mission m under p@1 on quad {
  proposed by agent openclaw for role operator
  phase departure { takeoff(altitude = 20 m) observe() return_home() }
}
"""


def test_out_of_scope_finding_shows_the_default() -> None:
    (found,) = check(IMPORTS + OBSERVE.replace("TIME", "10 s").replace("HOME", ""))
    assert found.code.id == "E0703"
    assert found.message.startswith("`time = 20 s` is not permitted")
    assert [label.text for label in found.labels] == [
        "this does not hold",
        "the step uses this default",
    ]


def test_insufficient_permit_of_a_link_is_shown() -> None:
    found = check(IMPORTS + OBSERVE.replace("TIME", "20 s").replace("HOME", "when battery > 10 %"))
    assert {each.code.id for each in found} == {"E0705"}
    assert "this rule permits it, if its condition holds" in [label.text for label in found[0].labels]
