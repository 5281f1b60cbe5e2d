"""Limits in every operand of an `or`, under `not`, and of all kinds of zones are tested, or listed as not reached."""

import re
from pathlib import Path

import pytest

from reference.generated_tests import failures, generated, noticed
from rtshcua.ground.testing.boundaries.generation import GeneratedTests, UnreachedLimit

CHECKOUT = Path(__file__).resolve().parents[4]
HEAD = """import "lib:policies/site.rts"
import "lib:skills/signals.rts"
import "lib:skills/hover.rts"
import "lib:skills/goto.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"
vehicle equipped {
  identity "quad-08"  home 47.39774 N, 8.54559 E within 50 m  speed at most 12 m/s  climb at most 3 m/s
  position error 3 m  energy 100 % = 18 min hover  brakes from 12 m/s in 6 s after 500 ms  return at 30 m  reserve 15 %
  clock utc +02:00
}
"""
#: a ring and a window in one operand, a grown zone in the other; heights for the vehicle; a rule about another role
ARMS = """
zone yard = difference(circle(47.3981 N, 8.5456 E, 70 m), circle(47.3982 N, 8.5462 E, 11 m)) active 21:15 .. 05:45
zone block = circle(47.3981 N, 8.5470 E, 40 m) floor 17 m ceiling 33 m above home
role pilot
policy arms version 3 {
  permit goto by role operator, pilot through operator
         when target inside yard or (target inside grow(bridge_a, 7 m) and wind.speed <= 6 m/s)
  permit return_home, emergency_land, hover by any
  forbid goto by role operator when not (height < 40 m and position outside block)
  forbid goto by role pilot when battery < 55 % and altitude > 13 m
  airspace inside city outside school
  contingency return_home, emergency_land
}
"""
TEXT = HEAD + ARMS


@pytest.fixture(scope="module")
def arms() -> GeneratedTests:
    return generated(TEXT, "arms.rts", "arms.rts", ("goto",))


def test_generated_tests_pass(arms: GeneratedTests) -> None:
    assert failures(arms, {"arms.rts": TEXT}) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("written", "moved"),
    [
        ("E, 70 m)", "E, 70001 mm)"),
        ("E, 11 m)", "E, 11001 mm)"),
        ("21:15", "21:16"),
        ("05:45", "05:46"),
        ("grow(bridge_a, 7 m)", "grow(bridge_a, 7001 mm)"),
        ("<= 6 m/s", "<= 6001 mm/s"),
        ("height < 40 m", "height < 40001 mm"),
        ("floor 17 m", "floor 17001 mm"),
        ("ceiling 33 m", "ceiling 33001 mm"),
        ("battery < 55 %", "battery < 55.01 %"),
        ("altitude > 13 m", "altitude > 13001 mm"),
    ],
)
def test_limit_moved_in_any_operand_fails_a_generated_test(arms: GeneratedTests, written: str, moved: str) -> None:
    assert TEXT.count(written) == 1
    assert noticed(arms, {"arms.rts": TEXT.replace(written, moved)})


def named(of: GeneratedTests) -> set[tuple[str, str]]:
    return {(each.role, each.about) for each in of.unreached}


def test_exactly_the_unreached_limits_are_listed(arms: GeneratedTests) -> None:
    assert named(arms) == {
        ("permit", "the ceiling of `grow(bridge_a, 7 m)`, which a place on the ground ignores"),
        ("airspace", "the ceiling of `city`"),  # a `forbid` decides first, also for the next one
        ("maintain", "`height`"),
        ("assume", "`speed`"),  # there is room for it in every scene: its limit is that of `obstacle.distance`
    }


def test_unreached_limits_are_listed_at_the_head_of_the_file() -> None:
    far = "zone far = circle(47.3981 N, 8.5456 E, 70 m) floor 5 m above home\n"
    text = (
        f"{HEAD}{far}"
        + """role pilot
policy arms version 3 {
  permit goto by role operator through operator when target inside far or wind.speed <= 200000 m/s and height < 80 m
  permit return_home, emergency_land, hover by any
  forbid goto by any when battery < 20 % and battery > 30 %
  forbid goto by role pilot when altitude > 13 m
  airspace inside city outside school
  contingency return_home, emergency_land
}
"""
    )
    made = generated(text, "arms.rts", "arms.rts", ("goto",))
    assert made.text is not None
    found = named(made)
    assert ("forbid", "`battery`") in found
    assert ("forbid", "") in found  # nothing is permitted for this role
    assert ("permit", "the floor of `far`, which a place on the ground ignores") in found
    comment = " ".join(re.sub(r"\n//\s*", " ", made.text).split())
    assert "NOT REACHED" in comment
    for each in made.unreached:
        assert each.words in comment, each
    assert UnreachedLimit("goto", "forbid", "forbid goto by role pilot when altitude > 13 m", "") in made.unreached


def test_limits_of_weekly_hours_in_a_time_zone_are_reached() -> None:
    text = (
        HEAD.replace("clock utc +02:00", 'clock "Europe/Zurich"')
        + """policy arms version 3 {
  permit goto by role operator through operator when local time in 12:30 .. 14:30 on monday .. wednesday
  permit return_home, emergency_land, hover by any
  contingency return_home, emergency_land
}
"""
    )
    made = generated(text, "arms.rts", "arms.rts", ("goto",))
    assert not [about for role, about in named(made) if role == "permit"]
    for written, moved in (("12:30", "12:31"), ("14:30", "14:31")):
        assert noticed(made, {"arms.rts": text.replace(written, moved)})


def test_limits_of_hours_and_dates_of_an_airspace_are_reached() -> None:
    shut = "zone shut = circle(47.3990 N, 8.5470 E, 30 m) active 12:30 .. 14:30\n"
    text = (
        f"{HEAD}{shut}"
        + """role pilot
policy arms version 3 {
  permit goto, return_home, emergency_land, hover by any
  airspace inside city outside school, shut
  contingency return_home, emergency_land
}
"""
    )
    made = generated(text, "arms.rts", "arms.rts", ("hover",))
    assert named(made) <= {("energy", "the charge that is needed")}
    for written, moved in (("12:30", "12:31"), ("14:30", "14:31"), ("30 m)", "30001 mm)")):
        assert noticed(made, {"arms.rts": text.replace(written, moved)})
