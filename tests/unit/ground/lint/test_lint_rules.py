"""Lint rules about sources: their findings, and cases without a finding."""

from pathlib import Path

import pytest

from reference.linted import CHECKOUT, HEAD, POLICY, RISE, found, program
from rtshcua.diagnostics.render import render
from rtshcua.ground.language.load import load
from rtshcua.ground.lint.filter import Linted, agreed
from rtshcua.ground.lint.linter import lint
from virtual.rows import rows

SHIPPED = sorted(
    path.relative_to(CHECKOUT)
    for name in ("skills", "policies", "missions", "evaluation")
    for path in (CHECKOUT / name).glob("*.rts")
)


#: the findings that pyproject.toml ignores, with reasons: a shipped policy changes only with its version
KNOWN = {"policies/bridge_inspection.rts": ["E1312"], "policies/training_field.rts": ["E1312"]}


@pytest.mark.parametrize("path", SHIPPED, ids=str)
def test_shipped_sources_have_only_the_expected_findings(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(CHECKOUT)
    one = load([str(path)], lambda file: Path(file).read_bytes(), str(CHECKOUT))
    left = lint(one)
    assert [each.code.id for each in left] == KNOWN.get(str(path), []), render(left, one.sources)


def test_program_with_an_error_is_not_linted() -> None:
    assert found("zone Broken = circle(") == []
    assert found('import "lib:nowhere.rts"\nzone Loud = circle(47 N, 8 E, 10 m)') == []


# ---------------------------------------------------------------------------------------------------- E1301


@pytest.mark.parametrize(
    "declaration",
    [
        "enum mode = GPS_FIX_TYPE { none = 0 }",
        "signal rate : speed = VFR_HUD.climb stale after 2 s",
        "template low(top: altitude) { permit return_home by any when height <= top }",
    ],
)
def test_unused_declarations_of_a_policy_file_are_reported(declaration: str) -> None:
    name = declaration.split("(")[0].split()[1]
    assert found(f"{HEAD}{declaration}\n{POLICY}") == [("E1301", name)]


def test_skill_without_a_rule_is_reported() -> None:
    skill = RISE.replace(", tag: one of a, b = a", "")
    assert found(HEAD + skill + POLICY) == [("E1301", "rise")]
    assert found(HEAD + skill + POLICY.replace("permit ret", "permit rise by role operator permit ret")) == []
    degraded = POLICY.replace("emergency_land }", "emergency_land degrade return_home when battery < 20 % to rise }")
    assert found(HEAD + skill + degraded) == []
    assert [
        code for code, _ in found(HEAD + skill + POLICY.replace("permit ret", "permit any by role a permit ret"))
    ] == ["E1303"]


def test_declarations_of_an_importable_file_are_not_reported() -> None:
    assert found("zone a = circle(47 N, 8 E, 10 m)\nenum mode = GPS_FIX_TYPE { none = 0 }") == []
    assert found(HEAD + RISE) == []


def test_zones_and_vehicles_of_a_policy_file_are_not_reported() -> None:
    zone = "zone yard = circle(47.3977 N, 8.5456 E, 10 m)\n"
    mission = "mission m under p@1 on quad { proposed by agent x for role operator phase a { return_home() } }"
    assert found(HEAD + zone + POLICY) == []
    assert found(HEAD + zone + POLICY + mission) == [("E1301", "yard")]
    anywhere = mission.replace("mission m", "mission m(where: zone = yard)")
    assert found(HEAD + zone + "zone pad = circle(47.3977 N, 8.5456 E, 10 m)" + POLICY + anywhere) == [
        ("E1301", "where")
    ]


def test_unused_parameters_are_reported() -> None:
    rise = "permit rise by role operator"
    assert found(HEAD + RISE + POLICY.replace("permit ret", f"{rise} permit ret")) == [("E1301", "tag")]
    assert found(HEAD + RISE + POLICY.replace("permit ret", f"{rise} when tag == b permit ret")) == []
    template = (
        "template low(top: altitude, who: role, altitude: altitude) { permit rise by role who when top <= height }"
    )
    used = POLICY.replace("permit ret", "use low(20 m, operator, 3 m) permit ret")
    assert found(HEAD + RISE.replace(", tag: one of a, b = a", "") + template + used) == [("E1301", "altitude")]


def test_only_requested_files_are_linted() -> None:
    other = HEAD + "enum mode = GPS_FIX_TYPE { none = 0 }\nzone Loud = circle(47 N, 8 E, 1 m)\n" + POLICY
    steps = "{ proposed by agent x for role operator phase a { return_home() } }"
    mission = f'import "policy.rts"\nmission m under p@1 on quad {steps}'
    assert found(mission, policy=other) == []
    one = program({"main.rts": mission, "policy.rts": other})
    both = lint(one, [unit.file for unit in one.units])
    assert {each.code.id for each in both} == {"E1301", "E1302"}


def test_finding_needs_the_agreement_of_all_programs_with_the_file() -> None:
    policy = HEAD + "template low(top: altitude) { permit return_home by any when height <= top }\n" + POLICY
    user = (
        'import "policy.rts"\n'
        + HEAD
        + POLICY.replace("policy p", "policy q").replace("permit ret", "use low(9 m) permit ret")
    )
    files = {"main.rts": policy, "user.rts": user, "policy.rts": policy}
    alone, used = program(files, "policy.rts"), program(files, "user.rts")
    results = [
        Linted(frozenset(unit.file for unit in each.units), lint(each, ["policy.rts"])) for each in (alone, used)
    ]
    assert [len(each.found) for each in results] == [1, 0]
    assert agreed(results) == ()
    assert agreed(results[:1]) == results[0].found


# ---------------------------------------------------------------------------------------------------- E1302


@rows(
    ("name", "better"),
    [
        ("BridgeA", "bridge_a"),
        ("bridge_", "bridge"),
        ("_a", "a"),
        ("NORTH", "north"),
        ("GPSZone", "gps_zone"),
        ("a__b", "a_b"),
    ],
)
def test_misnamed_declarations_are_reported(name: str, better: str) -> None:
    one = program({"main.rts": f"zone {name} = circle(47 N, 8 E, 10 m)"})
    (finding,) = lint(one)
    assert (finding.code.id, finding.help) == ("E1302", f"write it as `{better}`")
    assert lint(program({"main.rts": f"zone {better} = circle(47 N, 8 E, 10 m)"})) == ()


def test_each_part_of_a_signal_name_is_checked() -> None:
    assert found("signal gps.Fix : count = GPS_RAW_INT.fix_type stale after 2 s") == [("E1302", "gps.Fix")]
    assert found("signal gps.fix_type : count = GPS_RAW_INT.fix_type stale after 2 s") == []


def test_names_of_roles_and_mavlink_members_are_not_reported() -> None:
    assert found("enum fix = GPS_FIX_TYPE { NO_GPS = 0, NoFix = 1 }") == [("E1302", "NoFix")]
    mission = "mission m under p@1 on quad { proposed by agent OpenClaw for role Chief phase a { return_home() } }"
    assert found(HEAD + POLICY.replace("permit ret", "permit return_home by role Chief permit ret") + mission) == []


# ---------------------------------------------------------------------------------------------------- E1303


def test_broad_permits_are_reported() -> None:
    skill = RISE.replace(", tag: one of a, b = a", "")

    def permitted(rule: str) -> list[tuple[str, str]]:
        return found(HEAD + skill + POLICY.replace("permit ret", f"{rule} permit ret"))

    assert permitted("permit rise by any") == [("E1303", "rise")]
    assert permitted("permit rise by any through operator") == [("E1303", "rise")]
    assert permitted("permit any by role operator") == [("E1303", "permit any by role operator")]
    for rule in (
        "permit rise by role a",
        "permit rise by any when top <= 9 m",
        "forbid rise by any",
    ):
        assert permitted(rule) == [], rule


def test_permits_of_links_are_not_broad() -> None:
    skill = RISE.replace("top: altitude in 5 m .. 50 m, tag: one of a, b = a", "top: altitude in 5 m .. 50 m = 9 m")
    rule = POLICY.replace("permit ret", "permit rise by any permit ret")
    assert found(HEAD + skill + rule) == [("E1303", "rise")]
    assert found(HEAD + skill + rule.replace("contingency", "contingency rise for 20 s,")) == []
    assert (
        found(HEAD + skill + rule.replace("contingency", "degrade return_home when battery < 20 % to rise contingency"))
        == []
    )


# ---------------------------------------------------------------------------------------------------- E1304


def test_repeated_numbers_are_reported() -> None:
    def when(*conditions: str) -> list[tuple[str, str]]:
        rules = " ".join(f"forbid return_home by any when {each}" for each in conditions)
        return found(HEAD + 'import "lib:skills/signals.rts"\n' + POLICY.replace("permit ret", f"{rules} permit ret"))

    three = ("battery < 25 %", "25 % >= battery and height > 3 m", "battery in 10 % .. 25 %")
    assert when(*three) == [("E1304", "25 %")]
    assert when(*three[:2]) == []
    assert when(*three[:2], "battery < 25 % or battery > 25 %") == [("E1304", "25 %")]
    assert when(*three[:2], "battery < 26 %") == []
    assert when("height < 12 m", "wind.speed < 12 m/s", "obstacle.distance < 12 m") == []
    assert when("height > 0 m", "height >= 0 m", "not height == 0 m") == []
    assert when(*(f"position inside grow(school, 20 m) and battery < {n} %" for n in (10, 20, 30))) == [
        ("E1304", "20 m")
    ]
    assert when("height < 12 m", "height < 1200 cm", "height > 12 m") == [("E1304", "12 m")]


def test_help_for_repeated_numbers_suggests_a_parameter() -> None:
    skill = RISE.replace(
        "fallback", "require battery > 30 % and height < 9 m assume battery > 30 % maintain battery > 30 % fallback"
    )
    skill = skill.replace("top: altitude in 5 m .. 50 m, tag: one of a, b = a", "top: altitude in 5 m .. 50 m")
    one = program({"main.rts": HEAD + skill})
    assert [each.help for each in lint(one)] == [
        "write the number once: give the skill a parameter with `30 %` as its default"
    ]
