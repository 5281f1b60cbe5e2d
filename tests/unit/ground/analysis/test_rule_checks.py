"""Findings about the rules of a policy and the contracts of skills, beyond the twins of each code."""

from pathlib import Path

import pytest

from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import check_program, compile_program
from rtshcua.mavlink import dialect
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[4]
LIBRARY = str(CHECKOUT / "tests/golden/checker/library")
HEAD = "".join(
    f'import "lib:{path}.rts"\n'
    for path in (
        "policies/site",
        "skills/signals",
        *(f"skills/{each}" for each in ("takeoff", "hover", "goto", "inspect_area", "return_home", "emergency_land")),
    )
)
POLICY = """
zone east_part = circle(47.39779 N, 8.54599 E, 90 m)
zone by_day = circle(47.39779 N, 8.54559 E, 30 m) active 08:00 .. 18:00
role trainee, pilot
policy rules version 1 {{
  permit  hover, return_home, emergency_land by any
  {}
  contingency return_home, emergency_land
}}
"""


def read(text: str) -> tuple[Diagnostic, ...]:
    """Return all findings of a text with the library's skills and site."""
    return check_program(program(text), dialect.load())


def program(text: str):  # type: ignore[no-untyped-def]
    """Load the text."""
    source = (HEAD + text).encode()
    return load(["x.rts"], lambda path: source if path == "x.rts" else Path(path).read_bytes(), LIBRARY)


def found(rules: str) -> list[tuple[str, str]]:
    """Return code and quoted text of each finding about a policy with these rules."""
    text = HEAD + POLICY.format(rules)
    return [(each.code.id, text[each.span.start : each.span.end]) for each in read(POLICY.format(rules)) if each.span]


GOTO = "permit goto by role operator"
CASES = {
    # rules that look suspicious but have an effect
    "different roles": (f"{GOTO} when altitude < 20 m\npermit goto by role trainee when altitude < 20 m", []),
    "different sources": (f"{GOTO} when altitude < 20 m\n{GOTO} through agent when altitude < 20 m", []),
    "no single one": (
        f"{GOTO} when altitude < 20 m\n{GOTO} when altitude > 15 m\n{GOTO} when altitude in 10 m .. 30 m",
        [("E0722", f"{GOTO} when altitude in 10 m .. 30 m")],
    ),
    "a gap is left": (
        f"{GOTO} when altitude < 20 m\n{GOTO} when altitude > 20 m\n{GOTO} when altitude in 10 m .. 30 m",
        [],
    ),
    "a signal may be missing": (
        f"{GOTO} when battery < 50 %\n{GOTO} when battery >= 50 %\n{GOTO} when altitude < 20 m",
        [],
    ),
    "a clock is never exact": (
        f"{GOTO} when local time in 08:00 .. 12:00\n{GOTO} when local time in 12:00 .. 16:00\n"
        f"{GOTO} when local time in 09:00 .. 15:00",
        [],
    ),
    "one window holds another": (
        f"{GOTO} when local time in 08:00 .. 16:00\n{GOTO} when local time in 09:00 .. 15:00",
        [("E0722", f"{GOTO} when local time in 09:00 .. 15:00")],
    ),
    "a degrade that always holds": (
        f"{GOTO}\ndegrade goto when battery <= 100 % to hover",
        [("E0721", GOTO)],
    ),
    "a degrade that holds wherever it is permitted": (
        f"{GOTO} when battery < 50 %\ndegrade goto when battery < 60 % to hover",
        [("E0721", f"{GOTO} when battery < 50 %")],
    ),
    "a degrade that mostly holds": (f"{GOTO}\ndegrade goto when battery < 100 % to hover", []),
    "a degrade to the skill itself": ("degrade any when battery <= 100 % to hover", []),
    "a forbid that is true or unknown": (f"{GOTO}\nforbid goto by any when battery >= 0 %", [("E0721", GOTO)]),
    "two that hold together": (
        f"{GOTO}\ndegrade goto when battery < 50 % to hover\ndegrade goto when battery > 40 % to return_home",
        [("E0721", GOTO)],
    ),
    "a confirm that always holds": (
        f"{GOTO}\nconfirm goto when battery <= 100 % by role pilot within 30 s",
        [("E1102", "battery <= 100 %")],
    ),
    "a confirm over all arguments": (
        f"{GOTO}\nconfirm goto when altitude < 900 m by role pilot within 30 s",
        [("E1102", "altitude < 900 m")],
    ),
    "a confirm that mostly holds": (f"{GOTO}\nconfirm goto when battery < 100 % by role pilot within 30 s", []),
    "over midnight": (f"{GOTO} when local time in 22:00 .. 06:00 and local time in 07:00 .. 21:00", ["E0720"]),
    "each because of the other": (
        f"{GOTO} when altitude < 20 m\n{GOTO} when altitude < 20 m",
        [("E0722", f"{GOTO} when altitude < 20 m")],
    ),
    "a forbid may only be unknown": (
        "forbid goto by any when battery < 20 % and battery > 30 %\n" + GOTO,
        [("E0720", "battery > 30 %")],
    ),
    "a confirm may only be unknown": (
        f"confirm goto when battery < 20 % and battery > 30 % by role operator within 30 s\n{GOTO}",
        [("E0720", "battery > 30 %")],
    ),
    "no such fix is reported": ("degrade any when gps.fix < fix_3d to return_home", [("E0720", "gps.fix < fix_3d")]),
    "a confirm asks no more": (
        f"confirm goto when altitude < 20 m by role operator within 30 s\n"
        f"confirm goto when altitude < 10 m by role operator within 40 s\n{GOTO}",
        [("E0722", "confirm goto when altitude < 10 m by role operator within 40 s")],
    ),
    "a confirm asks somebody else": (
        f"confirm goto when altitude < 20 m by role operator within 30 s\n"
        f"confirm goto when altitude < 10 m by role pilot within 40 s\n{GOTO}",
        [],
    ),
    "a confirm waits for less": (
        f"confirm goto when altitude < 20 m by role operator within 30 s\n"
        f"confirm goto when altitude < 10 m by role operator within 20 s\n{GOTO}",
        [],
    ),
    "a degrade does no more": (
        "degrade any when battery < 20 % to return_home\ndegrade any when battery < 10 % to return_home",
        [("E0722", "degrade any when battery < 10 % to return_home")],
    ),
    "a degrade does no more, first": (
        "degrade any when battery < 10 % to return_home\ndegrade any when battery < 20 % to return_home",
        [("E0722", "degrade any when battery < 10 % to return_home")],
    ),
    "a degrade comes before another": (
        "degrade any when battery < 10 % to return_home\ndegrade any when wind.speed > 9 m/s to emergency_land\n"
        "degrade any when battery < 20 % to return_home",
        [],
    ),
    "a degrade of one skill": (
        "degrade goto when battery < 20 % to return_home\ndegrade any when battery < 10 % to return_home",
        [],
    ),
    "a delegation gives nothing": (
        f"{GOTO} when altitude < 30 m\npermit goto by role pilot when altitude < 30 m\n"
        "delegate goto by role operator to role pilot when altitude < 20 m",
        [("E0722", "delegate goto by role operator to role pilot when altitude < 20 m")],
    ),
    "a delegation gives something": (
        f"{GOTO} when altitude < 30 m\npermit goto by role pilot when altitude > 15 m\n"
        "delegate goto by role operator to role pilot when altitude < 20 m",
        [],
    ),
    "a forbid is dead": ("forbid goto by any when altitude < 10 m and altitude > 20 m\n" + GOTO, ["E0720"]),
    "a forbid says a part": (
        f"forbid goto by any when battery < 30 %\nforbid goto by any when battery < 20 %\n{GOTO}",
        [("E0722", "forbid goto by any when battery < 20 %")],
    ),
    "a forbid is unknown more often": (
        f"forbid goto by any when battery < 30 %\n"
        f"forbid goto by any when battery < 20 % and wind.speed < 900 m/s\n{GOTO}",
        [("E0722", "forbid goto by any when battery < 20 % and wind.speed < 900 m/s")],
    ),
    "a forbid is unknown elsewhere": (
        f"forbid goto by any when battery < 30 %\n"
        f"forbid goto by any when battery < 20 % or wind.speed < -1 m/s\n{GOTO}",
        [],
    ),
    "two forbids outweigh": (
        f"{GOTO} when altitude > 10 m\nforbid goto by any when altitude > 30 m\n"
        f"forbid goto by any when altitude <= 30 m",
        [("E0721", f"{GOTO} when altitude > 10 m")],
    ),
    "one skill of two is dead": ("permit goto, takeoff by role operator when altitude < 5 m", []),
    "sums": (f"{GOTO} when height < altitude and altitude + 5 m < height", ["E0720"]),
    "zones apart": (f"{GOTO} when target inside bridge_a and target inside bridge_b", ["E0720"]),
    "heights apart": (f"{GOTO} when position inside bridge_a and height > 60 m", ["E0720"]),
    "a zone at its time": (f"{GOTO} when target inside by_day and local time in 19:00 .. 23:00", ["E0720"]),
    "a zone out of its time": (f"{GOTO} when target inside meadow and local time in 19:00 .. 23:00", []),
    "phases": (f"{GOTO} when phase == inspection and phase == departure", ["E0720"]),
    "windows are free": (
        f"{GOTO} when battery < 20 % for the last 3 s and battery > 30 % within the last 5 s",
        [],
    ),
    "two targets at once": (
        "degrade any when battery < 20 % to return_home\ndegrade any when battery < 20 % to emergency_land",
        [("E0723", "degrade any when battery < 20 % to emergency_land")],
    ),
    "priorities": (
        "degrade any when battery < 20 % to return_home\ndegrade any when wind.speed > 9 m/s to emergency_land",
        [],
    ),
    "never reached": (
        "degrade hover when battery < 20 % to emergency_land\ndegrade hover when battery < 10 % to return_home",
        [("E0721", "degrade hover when battery < 10 % to return_home")],
    ),
}


@pytest.mark.slow
@rows("name", CASES)
def test_rules_with_an_effect_are_not_reported(name: str) -> None:
    rules, expected = CASES[name]
    got = found(rules)
    assert got == expected or [code for code, _ in got] == expected, got


SKILL = """
skill look(top: altitude in 5 m .. 20 m) {{
  motion   hold
  class    tactical
  deadline 5 s
  valid    for 40 min
  lasts    at most 1 min
  {}
  fallback return_home, emergency_land
  energy   at most 9 %
}}
"""


def test_smallest_contradiction_is_reported() -> None:
    clauses = "require height > top + 10 m and battery > 50 %\n  assume wind.speed < 5 m/s\n  maintain height < top"
    diagnostics = read(SKILL.format(clauses) + POLICY.format("permit look by role operator"))
    assert [each.code.id for each in diagnostics] == ["E1101"]
    assert [label.text for label in diagnostics[0].labels] == ["this is required", "the skill"]


def test_skill_that_contradicts_the_airspace_is_reported() -> None:
    policy = POLICY.format("permit look by role operator").replace(
        "contingency", "airspace inside city outside bridge_b\n  contingency"
    )
    diagnostics = read(SKILL.format("maintain position inside bridge_b") + policy)
    assert [each.code.id for each in diagnostics] == ["E1101"]
    assert [label.text for label in diagnostics[0].labels] == ["this is the airspace", "the skill"]
    assert read(SKILL.format("maintain position inside bridge_a") + policy) == ()


def test_step_that_contradicts_itself_with_its_arguments_is_reported() -> None:
    """The skill alone does not contradict itself: other arguments are possible."""
    mission = """
mission m under rules@1 on quad {
  proposed by operator x for role operator
  phase departure { takeoff(altitude = 10 m) look(top = 20 m) return_home() }
}
"""
    skill = SKILL.format("require wind.speed > 5 m/s\n  assume wind.speed < 4 m/s or top < 10 m")
    policy = POLICY.format("permit look, takeoff by role operator")
    assert [each.code.id for each in read(skill + policy + mission)] == ["E1101"]
    assert read(skill + policy + mission.replace("20 m", "8 m")) == ()


@pytest.mark.parametrize(
    ("fields", "codes"),
    [("WIND_COV.wind_x, WIND_COV.wind_y", ["E0720"]), ("WIND_COV.wind_x, WIND_COV.wind_y or WIND.speed", [])],
)
def test_magnitude_of_two_components_is_not_negative(fields: str, codes: list[str]) -> None:
    signal = f"signal gust : speed = {fields} stale after 10 s\n"
    text = signal + POLICY.format("degrade any when gust < 0 m/s to return_home")
    assert [each.code.id for each in read(text)] == codes


HOURS = """
mission m under rules@1 on quad {
  proposed by operator x for role operator
  phase departure { takeoff(altitude = 10 m) return_home() }
}
"""
#: 08:00 where the vehicle's clock is two hours ahead of UTC
EIGHT = 1_800_000_000 * 1_000_000 - 1_800_000_000 * 1_000_000 % 86_400_000_000 + 6 * 3_600_000_000


@pytest.mark.parametrize(("minutes", "codes"), [(0, []), (53, []), (56, ["E0718"]), (59, ["E0718"])])
def test_step_that_may_begin_too_late_in_the_day_is_reported(minutes: int, codes: list[str]) -> None:
    text = POLICY.format("permit takeoff by role operator when local time in 08:00 .. 09:00") + HOURS
    issued = EIGHT + minutes * 60_000_000
    compiled = compile_program(program(text), dialect.load(), mission=None, issued_at_us=issued)
    assert [each.code.id for each in compiled.diagnostics] == codes


@rows(
    ("window", "codes"),
    [("08:00 .. 09:00", []), ("23:57 .. 00:08", []), ("08:00 .. 08:03", ["E0718"]), ("08:00 .. 08:04", ["E0718"])],
)
@rows("permits", [1, 2])
def test_one_time_of_issue_must_suit_all_steps(window: str, codes: list[str], permits: int) -> None:
    permit = "permit takeoff by role operator when "
    rules = [f"{permit}local time in {window}", f"{permit}altitude > 20 m or local time in 12:00 .. 12:02"][:permits]
    text = POLICY.format("\n".join(rules)) + HOURS
    assert [each.code.id for each in read(text)] == codes


def test_refused_value_between_permitted_values_is_reported() -> None:
    mission = HOURS.replace("mission m", "mission m(height: altitude in 5 m .. 40 m = 5 m)").replace("10 m", "height")
    rules = "permit takeoff by role operator when altitude < 15 m or altitude > 25 m"
    assert [each.code.id for each in read(POLICY.format(rules) + mission)] == ["E0703"]
    assert [each.code.id for each in read(POLICY.format(rules.replace("25", "14")) + mission)] == []


RANGE = HOURS.replace("mission m", "mission m(height: altitude in 5 m .. 40 m = 5 m)").replace("10 m", "height")
DAY_SHIFT, NIGHT_SHIFT = "local time in 07:00 .. 19:00", "local time in 19:00 .. 07:00"


@rows(
    ("rules", "codes"),
    [
        # the window does not depend on the parameter, nor the parameter on the window
        (f"permit takeoff by role operator when {DAY_SHIFT}", []),
        (f"permit takeoff by role operator when altitude <= 40 m and {DAY_SHIFT}", []),
        (f"permit takeoff by role operator\nforbid takeoff by any when {NIGHT_SHIFT}", []),
        # each altitude has a suitable time, but no time suits all
        (
            "permit takeoff by role operator "
            f"when altitude < 20 m and {DAY_SHIFT} or altitude >= 20 m and {NIGHT_SHIFT}",
            [],
        ),
        # some altitudes between the ends are never permitted, or not for long enough to start
        (f"permit takeoff by role operator when {DAY_SHIFT} and (altitude < 15 m or altitude > 25 m)", ["E0703"]),
        (
            f"permit takeoff by role operator\nforbid takeoff by any when altitude in 15 m .. 25 m or {NIGHT_SHIFT}",
            ["E0704"],
        ),
        (
            "permit takeoff by role operator when altitude < 15 m or altitude > 25 m or local time in 12:00 .. 12:02",
            ["E0718"],
        ),
        (
            "permit takeoff by role operator\n"
            "forbid takeoff by any when altitude in 15 m .. 25 m and local time in 00:03 .. 23:59",
            ["E0718"],
        ),
    ],
)
def test_time_windows_and_parameter_range_are_proved_together(rules: str, codes: list[str]) -> None:
    assert [each.code.id for each in read(POLICY.format(rules) + RANGE)] == codes


def test_zone_times_and_parameter_range_are_proved_together() -> None:
    leg = "goto(47.39779 N, 8.54559 E, altitude = height)"
    mission = RANGE.replace("takeoff(altitude = height)", f"takeoff(altitude = 10 m) {leg}")
    permit = "permit takeoff by role operator permit goto by role operator"
    rules = (
        f"{permit}\nforbid goto by any when target inside by_day",
        f"{permit} when target inside by_day and altitude < 60 m",
    )
    for each in rules:
        assert [found.code.id for found in read(POLICY.format(each) + mission)] == []
    refused = f"{permit} when target inside by_day and (altitude < 15 m or altitude > 25 m)"
    assert [found.code.id for found in read(POLICY.format(refused) + mission)] == ["E0703"]


def test_value_without_any_time_of_issue_is_named() -> None:
    rules = "permit takeoff by role operator when altitude < 15 m or altitude > 25 m or local time in 12:00 .. 12:02"
    (finding,) = read(POLICY.format(rules) + RANGE)
    assert "with `altitude = 15" in finding.message, finding.message


def test_value_refused_at_the_known_time_of_issue_is_named() -> None:
    other = """
mission n under rules@1 on quad {
  proposed by operator x for role operator
  phase departure { takeoff(altitude = 10 m) return_home() }
}
"""
    rules = "permit takeoff by role operator when altitude < 15 m or altitude > 25 m or local time in 08:00 .. 09:00"
    text = program(POLICY.format(rules) + RANGE + other)
    for minutes, codes in ((0, []), (56, ["E0718"])):
        compiled = compile_program(text, dialect.load(), mission="n", issued_at_us=EIGHT + minutes * 60_000_000)
        assert [each.code.id for each in compiled.diagnostics] == codes
