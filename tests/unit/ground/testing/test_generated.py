"""Generated tests pass, cover both sides of every limit, and fail if a limit moves."""

import re
from pathlib import Path

import pytest

from reference.generated_tests import failures, generated, noticed, play
from rtshcua.diagnostics.span import Source
from rtshcua.ground.format.format import formatted
from rtshcua.ground.testing.boundaries.generation import GeneratedTests
from rtshcua.ground.testing.case_result import run_case

CHECKOUT = Path(__file__).resolve().parents[4]
SHIPPED = CHECKOUT / "policies" / "bridge_inspection.rts"

#: one skill, one rule of each kind, a template, a delegation, a window of the day and a condition over time
SMALL = """import "lib:policies/site.rts"
import "lib:skills/hover.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"

vehicle equipped {
  identity "quad-08"  home 47.39774 N, 8.54559 E within 50 m  speed at most 12 m/s  climb at most 3 m/s
  position error 3 m  energy 100 % = 18 min hover  brakes from 12 m/s in 6 s after 500 ms  return at 30 m  reserve 15 %
  clock utc +02:00
}
skill rise(top: altitude in 5 m .. 50 m) {
  motion   climb to top
  class    tactical  deadline 5 s  valid for 40 min  lasts at most 1 min
  require  (link.quality >= 40 % or gps.accuracy <= 2 m) and wind.speed <= 8 m/s for the last 3 s
  fallback return_home, emergency_land
  energy   at most 5 %  record intent, decision, state, authorization, effect
}
template calm(most: speed in 1 m/s .. 20 m/s, who: role) {
  permit rise by role who through agent, operator when top <= 30 m and wind.speed <= most
}
role trainee, supervisor
policy small version 3 {
  use      calm(6 m/s, who = operator)
  delegate rise by role operator to role trainee through operator when top <= 12 m
  permit   return_home, emergency_land by any
  permit   hover by role operator through agent when local time in 06:00 .. 22:00
  forbid   rise by any when battery in 10 % .. 18 %
  confirm  rise when top < 8 m by role supervisor within 30 s
  degrade  rise when obstacle.distance < 4 m to return_home
  airspace inside city outside school
  contingency return_home, emergency_land
}
"""


@pytest.fixture(scope="module")
def small() -> GeneratedTests:
    return generated(SMALL, "small.rts", "small.rts")


@pytest.fixture(scope="module")
def shipped() -> GeneratedTests:
    text = SHIPPED.read_text(encoding="utf-8")
    return generated(text, "bridge_inspection.rts", "lib:policies/bridge_inspection.rts")


def test_generated_tests_pass_also_after_formatting(small: GeneratedTests) -> None:
    assert small.text is not None
    assert small.without == ()
    assert failures(small, {"small.rts": SMALL}) == []
    text = formatted(Source("tests.rts", small.text)).text
    assert text is not None
    played = play(text, {"small.rts": SMALL})
    assert len(played.cases) == small.cases
    assert all(run_case(case).met for case in played.cases)
    assert played.diagnostics == ()


def test_generated_file_says_that_it_records_present_decisions(small: GeneratedTests) -> None:
    assert small.text is not None
    assert "record the present decisions of the policy `small`" in " ".join(small.text.split())
    assert "review the tests before you keep them" in small.text


def test_every_kind_of_clause_has_limits(small: GeneratedTests) -> None:
    roles = {each.part.role for each in small.limits}
    assert roles == {"permit", "forbid", "confirm", "degrade", "require", "assume", "airspace", "energy"}
    assert any("delegate rise" in each.part.text for each in small.limits)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("written", "moved"),
    [
        ("top <= 30 m", "top <= 30001 mm"),
        ("calm(6 m/s", "calm(6001 mm/s"),
        ("top <= 12 m", "top <= 12001 mm"),
        ("06:00 .. 22:00", "06:00 .. 21:59"),
        ("10 % .. 18 %", "10 % .. 18.01 %"),
        ("top < 8 m", "top < 8001 mm"),
        ("within 30 s", "within 30001 ms"),
        ("distance < 4 m", "distance < 4001 mm"),
        ("quality >= 40 %", "quality >= 40.01 %"),
        ("accuracy <= 2 m", "accuracy <= 1999 mm"),
        ("deadline 5 s", "deadline 5001 ms"),
        ("5 m .. 50 m", "5 m .. 50001 mm"),
        ("energy   at most 5 %", "energy   at most 5.01 %"),
        ("airspace inside city outside school", "airspace inside city"),
    ],
)
def test_limit_moved_by_one_unit_fails_a_generated_test(small: GeneratedTests, written: str, moved: str) -> None:
    assert written in SMALL
    assert noticed(small, {"small.rts": SMALL.replace(written, moved)})


def moved_limits() -> dict[str, str]:
    """The shipped policy with one number moved by one unit, by the place of the number."""
    text = SHIPPED.read_text(encoding="utf-8")
    numbers = re.compile(r"//[^\n]*|(?P<number>\d+) (?P<unit>m|%|s)(?!\w)")
    finer = {"m": "{}001 mm", "%": "{}.01 %", "s": "{}001 ms"}
    return {
        text[text.rindex("\n", 0, found.start()) : found.end()].strip(): text[: found.start()]
        + finer[found["unit"]].format(found["number"])
        + text[found.end() :]
        for found in numbers.finditer(text)
        if found["number"]
    }


LIMITS = moved_limits()
#: the duration of the contingency's hover, on which no decision depends
UNNOTICED = "contingency hover for 10 s"


def test_shipped_policy_has_limits_to_move() -> None:
    assert len(LIMITS) == 8
    assert UNNOTICED in LIMITS


@pytest.mark.slow
@pytest.mark.parametrize(
    "place",
    [
        place if number % 3 == 0 or place == UNNOTICED else pytest.param(place, marks=pytest.mark.soak)
        for number, place in enumerate(LIMITS)
    ],
)
def test_moved_limit_of_the_shipped_policy_fails_a_generated_test(shipped: GeneratedTests, place: str) -> None:
    assert noticed(shipped, {"bridge_inspection.rts": LIMITS[place]}) == (place != UNNOTICED)


def test_tests_are_generated_for_chosen_skills_only(shipped: GeneratedTests) -> None:
    text = SHIPPED.read_text(encoding="utf-8")
    alone = generated(text, "bridge_inspection.rts", "lib:policies/bridge_inspection.rts", ("hover",))
    assert alone.text is not None
    assert set(re.findall(r'test "(\w+):', alone.text)) == {"hover"}
    assert 0 < alone.cases < shipped.cases
