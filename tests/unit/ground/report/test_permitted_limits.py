"""The limits on the first page are the widest that the rules permit, not those of the skill."""

from pathlib import Path

import pytest

from rtshcua.diagnostics.diagnostic import has_errors
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import examine_program
from rtshcua.ground.report.permissions import permitted_limits
from rtshcua.ground.report.report_model import PermittedLimit
from rtshcua.ground.report.reported_policy import ReportedPolicy
from rtshcua.mavlink import dialect

SOURCE = """
vehicle scout {
  identity "scout"  home 47.39774 N, 8.54559 E within 50 m  speed at most 12 m/s  climb at most 3 m/s
  position error 3 m  energy 100 % = 18 min hover  reserve 15 %
}
signal position : position = GLOBAL_POSITION_INT.lat, GLOBAL_POSITION_INT.lon stale after 2 s
signal height : altitude = GLOBAL_POSITION_INT.relative_alt stale after 2 s
signal battery : ratio = BATTERY_STATUS.battery_remaining unknown at -1 stale after 5 s
zone yard = circle(47.39774 N, 8.54559 E, 100 m)
zone pond = circle(47.39774 N, 8.54559 E, 10 m)
skill go(target: position, altitude: altitude in 5 m .. 60 m, speed: speed in 1 m/s .. 8 m/s) {
  motion fly to target at altitude speed speed
  class tactical  deadline 5 s  valid for 9 min  lasts at most 2 min  energy at most 12 %
  fallback down  require REQUIRE  record intent, decision, state, authorization, effect
}
skill down() { motion land  class tactical  deadline 5 s  valid for 9 min  lasts at most 2 min  energy at most 12 %
  record intent, decision, state, authorization, effect }
policy p version 1 {
  permit down by any
  RULES
  contingency down
}
role pilot, trainee
"""


def limits(rules: str, require: str = "battery > 20 %") -> dict[str, PermittedLimit]:
    text = SOURCE.replace("RULES", rules).replace("REQUIRE", require).encode()
    program = load(["p.rts"], lambda _: text, str(Path.cwd()))
    checked = examine_program(program, dialect.load())
    assert not has_errors(checked.diagnostics), [each.message for each in checked.diagnostics]
    (lowered,) = checked.policies
    return {each.parameter: each for each in permitted_limits(ReportedPolicy(program, lowered))}


@pytest.mark.parametrize(
    ("rules", "altitude", "conditions"),
    [
        ("permit go by role pilot", "between 5 m and 60 m above home", False),
        ("permit go by role pilot when altitude <= 30 m", "between 5 m and 30 m above home", False),
        ("permit go by role pilot when altitude <= 30 m and battery > 50 %", "between 5 m and 30 m above home", True),
        ("permit go by role pilot when altitude <= 20 m or (altitude <= 30 m and battery > 50 %)",
         "between 5 m and 30 m above home", True),
        ("permit go by role pilot  forbid go by any when altitude > 25 m", "between 5 m and 25 m above home", False),
        ("permit go by role pilot  forbid go by role trainee when altitude > 25 m", "between 5 m and 60 m above home",
         False),
        ("permit go by role pilot when altitude <= 20 m  permit go by role trainee when altitude <= 10 m",
         "between 5 m and 20 m above home", False),
        ("permit go by role pilot, trainee when altitude <= 20 m  forbid go by role pilot",
         "between 5 m and 20 m above home", False),
        ("permit go by role pilot when altitude <= 30 m or battery > 50 %", "between 5 m and 60 m above home", True),
        ("permit go by role pilot when altitude == 30 m", "exactly 30 m above home", False),
    ],
)  # fmt: skip
def test_height_limit_is_the_widest_of_the_permits(rules: str, altitude: str, conditions: bool) -> None:
    told = limits(rules)["altitude"]
    assert (told.limits, told.conditions) == (altitude, conditions)


def test_require_of_a_skill_limits_its_arguments_too() -> None:
    told = limits("permit go by role pilot", "battery > 20 % and altitude <= 35 m")
    assert told["altitude"].limits == "between 5 m and 35 m above home"


def test_speeds_and_places_have_limits_too() -> None:
    told = limits("permit go by role pilot when target inside yard and speed <= 3 m/s  "
                  "forbid go by any when target inside pond")  # fmt: skip
    assert (told["speed"].limits, told["speed"].conditions) == ("between 1 m/s and 3 m/s", True)
    assert told["target"].limits == (
        "if the `target` asked for is inside `yard` (on the ground, at whatever height) and it is not so that "
        "(the `target` asked for is inside `pond` (on the ground, at whatever height))"
    )
    assert told["target"].conditions, "the speed is one"
    assert not limits("permit go by role pilot when target inside yard")["target"].conditions
    assert limits("permit go by role pilot")["target"].limits == "wherever the airspace allows it"


def test_skill_without_a_permit_has_no_limits() -> None:
    assert limits("permit go by role pilot  forbid go by any") == {}
    assert limits("") == {}
