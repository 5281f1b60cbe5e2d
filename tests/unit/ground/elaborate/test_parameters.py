"""Missions with parameters: compiled with the given values, checked with all possible ones."""

from collections.abc import Callable, Mapping

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.diagnostics.render import render
from rtshcua.ground.checker.context import Instance
from rtshcua.ground.elaborate import parameters
from rtshcua.ground.elaborate.parameters import MAX_INSTANCES, MOST_STEPS, _combinations, _instance, parse_settings
from rtshcua.ground.pipeline.program import Checked, Compiled
from rtshcua.model.ir.expression import Value
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.wire.bundle import policy_payload

Compile = Callable[..., Compiled]
Check = Callable[[str], Checked]

POLICY = """
policy p version 1 {
  permit takeoff by role operator through agent when altitude <= 40 m
  permit goto by role operator through agent when altitude <= 25 m
  permit inspect_area by role operator through agent when area inside bridge_a or area inside bridge_b
  permit hover, return_home, emergency_land by any
  contingency hover for 10 s, return_home, emergency_land
}
"""
HEAD = "mission m({}) under p@1 on quad {{\n  proposed by agent openclaw for role operator\n"
BODY = """
  phase departure { takeoff(altitude = high) }
  phase inspection { goto(where.entry, altitude = high + 2 m)  hover() }
  phase recovery { return_home() }
}
"""


def mission(parameters: str, body: str = BODY) -> str:
    return POLICY + HEAD.format(parameters) + body


TWO = "where: zone = bridge_a, high: altitude in 10 m .. 20 m = 15 m"


def arguments(compiled: Compiled) -> list[tuple[int, ...]]:
    assert compiled.mission is not None, render(compiled.diagnostics, compiled.sources)
    return [step.arguments for step in compiled.mission.invocations]


@pytest.mark.parametrize(
    ("values", "zone", "high"),
    [
        ((), "bridge_a", "15 m"),
        (("high=12 m",), "bridge_a", "12 m"),
        (("high = 12 m above home", "where=bridge_b"), "bridge_b", "12 m"),
        (("high=2 * 5 m + 1 m",), "bridge_a", "11 m"),
    ],
)
def test_mission_with_values_equals_the_written_one(
    compile_text: Compile, site: str, values: tuple[str, ...], zone: str, high: str
) -> None:
    given = compile_text(site + mission(TWO), values)
    body = BODY.replace("where", zone).replace("= high", f"= {high}")
    written = compile_text(site + mission(TWO, body))
    assert given.diagnostics == ()
    assert arguments(given) == arguments(written)
    assert given.policy is not None
    assert written.policy is not None


def test_policy_does_not_depend_on_mission_values(compile_text: Compile, site: str) -> None:
    payloads = set()
    for values in ((), ("high=12 m",), ("where=bridge_b",)):
        compiled = compile_text(site + mission(TWO), values)
        assert compiled.policy is not None
        payloads.add(policy_payload(compiled.policy))
    assert len(payloads) == 1


@pytest.mark.parametrize(
    ("values", "code", "under"),
    [
        (("high=9 m",), "E0605", "9 m"),
        (("high=9 s",), "E0310", "9 s"),
        (("high=9 parsecs",), "E0301", "9 parsecs"),
        (("high=bridge_a",), "E0312", "bridge_a"),
        (("where=bridge_c",), "E0201", "bridge_c"),
        (("where=12 m",), "E0312", "12 m"),
        (("where=school",), "E0205", None),
        (("hihg=12 m",), "E0601", "hihg"),
        (("high=12 m", "high=13 m"), "E0602", "high"),
        (("high",), "E0101", "high"),
        (("high=",), "E0101", "high="),
        (("=12 m",), "E0101", "=12 m"),
        (("high=12 m, where = bridge_b",), "E0902", "12 m, where = bridge_b"),
        (("high=12 m) } }",), "E0101", None),
    ],
)
def test_invalid_value_is_underlined_in_the_option(
    compile_text: Compile, site: str, values: tuple[str, ...], code: str, under: str | None
) -> None:
    compiled = compile_text(site + mission(TWO), values)
    assert compiled.mission is None
    found = compiled.diagnostics
    assert [each.code.id for each in found] == [code], render(found, compiled.sources)
    span = found[0].span
    assert span is not None
    if under is not None:
        assert span.file == "--set"
        assert compiled.sources["--set"].slice(span).strip() == under


def test_mission_without_a_value_is_checked_but_not_compiled(
    compile_text: Compile, check_text: Check, site: str
) -> None:
    text = site + mission("where: zone = bridge_a, high: altitude in 10 m .. 20 m")
    assert check_text(text).diagnostics == ()
    compiled = compile_text(text)
    assert [each.code.id for each in compiled.diagnostics] == ["E0603"]
    assert "--set high=" in (compiled.diagnostics[0].help or "")
    assert arguments(compile_text(text, ("high=11 m",)))[0] == (11_000,)


@pytest.mark.parametrize(
    ("parameters", "codes", "label"),
    [
        (TWO, [], None),
        # 30 m + 2 m is above what the policy permits, though the default is not
        ("where: zone = bridge_a, high: altitude in 10 m .. 30 m = 15 m", ["E0703"], "with `high = 30 m`"),
        ("where: zone = bridge_a, high: altitude in 1 m .. 20 m = 15 m", ["E0605", "E0605"], "with `high = 1 m`"),
        ("where: zone = city, high: altitude in 10 m .. 20 m", ["E0205"], "with `where = city`"),
        ("where: zone, high: altitude in 10 m .. 20 m, height: speed in 1 m/s .. 2 m/s", [], None),
        ("where: one of bridge_a, bridge_b, high: altitude in 10 m .. 20 m", [], None),
        ("where: one of bridge_a, city = bridge_a, high: altitude in 10 m .. 20 m", ["E0205"], "with `where = city`"),
        ("where: zone, high: altitude", ["E0607"], None),
        ("where: zone, high: altitude in 20 m .. 10 m", ["E0316"], None),
        ("where: zone, high: nothing", ["E0607"], None),
        ("where: zone, where: zone, high: altitude in 10 m .. 20 m", ["E0202"], None),
        ("where: zone, city: zone, high: altitude in 10 m .. 20 m", ["E0203"], None),
        ("where: zone, high: altitude in 10 m .. 20 m = 9 m", ["E0605"], None),
    ],
)
def test_mission_is_checked_for_all_zones_choices_and_range_ends(
    check_text: Check, site: str, parameters: str, codes: list[str], label: str | None
) -> None:
    found = [each for each in check_text(site + mission(parameters)).diagnostics if each.code.id < "E13"]
    assert [each.code.id for each in found] == codes
    if label is not None:
        assert label in {each.text for each in found[0].labels}


def test_finding_for_every_value_names_no_values(check_text: Check, site: str) -> None:
    text = site + mission(TWO, BODY.replace("hover()", "hover(time = 3 m)"))
    found = check_text(text).diagnostics
    assert [each.code.id for each in found] == ["E0310"]
    assert not any(label.text.startswith("with ") for label in found[0].labels)


def test_findings_for_several_values_are_merged_to_the_worst(check_text: Check, site: str) -> None:
    body = BODY.replace("goto(where.entry, altitude = high + 2 m)", "goto(where.entry, altitude = 20 m, speed = pace)")
    pace = "pace: speed in 1 m/s .. 2 m/s = 2 m/s"
    text = mission(f"where: zone = bridge_a, high: altitude in 10 m .. 20 m = 15 m, {pace}")
    found = [each for each in check_text(site + text.replace(BODY, body)).diagnostics if each.code.id == "E0804"]
    assert len({each.span for each in found}) == len(found) > 0
    for each in found:
        assert "with `pace = 1 m/s`" in {label.text for label in each.labels}
        assert each.help is not None
        assert each.help.endswith("; it also fails for other values of the mission's parameters")


def test_position_without_a_default_leaves_the_mission_unchecked(check_text: Check, site: str) -> None:
    body = BODY.replace("where.entry", "where")
    found = check_text(site + mission("where: position, high: altitude in 10 m .. 20 m", body)).diagnostics
    assert [(each.code.id, each.severity.value) for each in found] == [("E1103", "note")]
    place = "where: position = 47.398 N, 8.546 E, high: altitude in 10 m .. 20 m"
    assert check_text(site + mission(place, body)).diagnostics == ()


def test_ambiguous_name_in_a_clause_is_refused(check_text: Check, site: str) -> None:
    for name, reads in (("height", "height"), ("time", "time")):
        kind = "altitude in 10 m .. 20 m" if name == "height" else "duration in 1 s .. 2 s"
        limit = "30 m" if name == "height" else "30 s"
        body = f"""
  phase departure {{ takeoff(altitude = 10 m) }}
  phase inspection {{ hover(5 s) {{ maintain {reads} <= {limit} }} }}
  phase recovery {{ return_home() }}
}}
"""
        found = check_text(site + mission(f"{name}: {kind}", body)).diagnostics
        assert [each.code.id for each in found if each.code.id < "E13"] == ["E0203"]


@given(st.lists(st.integers(1, 5), max_size=5))
def test_combinations_start_with_the_defaults(sizes: list[int]) -> None:
    ranges = [[None] * size for size in sizes]
    found = list(_combinations(ranges))  # type: ignore[arg-type]
    assert found[0] == (0,) * len(sizes)
    alone = sum(size - 1 for size in sizes)
    assert all(sum(1 for number in each if number) == 1 for each in found[1 : 1 + alone])
    total = 1
    for size in sizes:
        total *= size
    assert len(found) == total
    assert MAX_INSTANCES >= 5 * 5


def test_number_of_checked_instances_is_bounded(check_text: Check, site: str) -> None:
    many = ", ".join(f"x{number}: altitude in 10 m .. 20 m = 15 m" for number in range(20))
    assert check_text(site + mission(f"{TWO}, {many}")).bounds["m"].invocations == 4


def test_each_setting_is_a_line() -> None:
    settings = parse_settings(["a=1 m", " b =  2   s "])
    assert settings.diagnostics == ()
    assert settings.source.text == "a=1 m\nb = 2 s"
    assert [(name.text, settings.source.slice(value.span)) for name, value in settings.values] == [
        ("a", "1 m"),
        ("b", "2 s"),
    ]


def test_long_mission_is_checked_with_fewer_values() -> None:
    """Each instance is proved step by step, which could take minutes."""
    assert MAX_INSTANCES * 64 <= MOST_STEPS <= 1 << 13


def test_steps_of_all_instances_are_bounded(check_text: Check, site: str, monkeypatch: pytest.MonkeyPatch) -> None:
    many = ", ".join(f"x{number}: altitude in 10 m .. 20 m = 15 m" for number in range(20))
    made: list[Instance] = []

    def counted(mission: MissionDecl, values: Mapping[str, Value]) -> Instance:
        made.append(_instance(mission, values))
        return made[-1]

    monkeypatch.setattr(parameters, "_instance", counted)
    monkeypatch.setattr(parameters, "MOST_STEPS", 12)
    check_text(site + mission(f"{TWO}, {many}"))
    assert len(made) == 3  # of four steps each
