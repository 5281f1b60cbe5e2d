"""Templates: a use equals the written rules, and findings name the use."""

from collections.abc import Callable

import pytest

from rtshcua.ground.pipeline.program import Checked, Compiled
from rtshcua.model.flat.policy import Rule

Compile = Callable[..., Compiled]
Check = Callable[[str], Checked]

TEMPLATE = """
template low(place: zone, top: altitude in 5 m .. 60 m = 30 m, who: role = operator) {
  permit goto by role who through agent, operator when target inside place and altitude <= top
  forbid goto by role who when target inside grow(place, -10 m) and altitude < top - 15 m
  confirm goto when target inside place and altitude < 6 m by role who within 30 s
  degrade goto when height > top to hover(15 s)
}
"""
REST = """
  permit takeoff by role operator through agent
  permit hover, return_home, emergency_land by any
  contingency hover for 10 s, return_home, emergency_land
"""
MISSION = """
mission m under p@1 on quad {
  proposed by agent openclaw for role operator
  phase departure { takeoff(altitude = 10 m)  return_home() }
}
"""


def policy(*parts: str) -> str:
    return "role pilot, zeppelin, trainee policy p version 1 {\n" + "\n".join(parts) + REST + "}\n"


def meaning(rule: Rule) -> tuple[object, ...]:
    """A rule without its spans."""
    code = None if rule.when is None else rule.when.code
    target = None if rule.target is None else (rule.target.skill, rule.target.arguments)
    return rule.kind, rule.skills, rule.roles, rule.sources, code, rule.approver, rule.within_us, target


def rules_of(compiled: Compiled) -> list[Rule]:
    assert compiled.policy is not None, compiled.diagnostics
    return list(compiled.policy.rules)


def written_out(place: str, top: str, who: str) -> str:
    return f"""
  permit goto by role {who} through agent, operator when target inside {place} and altitude <= {top}
  forbid goto by role {who} when target inside grow({place}, -10 m) and altitude < {top} - 15 m
  confirm goto when target inside {place} and altitude < 6 m by role {who} within 30 s
  degrade goto when height > {top} to hover(15 s)
"""


@pytest.mark.parametrize(
    ("use", "place", "top", "who"),
    [
        ("use low(bridge_a)", "bridge_a", "30 m", "operator"),
        ("use low(bridge_b, 20 m, trainee)", "bridge_b", "20 m", "trainee"),
        ("use low(who = trainee, place = bridge_b, top = 2 * 10 m + 5 m)", "bridge_b", "25 m", "trainee"),
    ],
)
def test_use_equals_the_written_rules(
    compile_text: Compile, site: str, use: str, place: str, top: str, who: str
) -> None:
    used = compile_text(site + TEMPLATE + policy(use) + MISSION)
    plain = compile_text(site + policy(written_out(place, top, who)) + MISSION)
    assert list(map(meaning, rules_of(used))) == list(map(meaning, rules_of(plain)))


def test_rules_of_a_use_keep_its_position(compile_text: Compile, site: str) -> None:
    text = policy("  permit goto by role pilot", "use low(bridge_a)", "  permit goto by role zeppelin")
    found = rules_of(compile_text(site + TEMPLATE + text + MISSION))
    assert [rule.text.partition(" ")[0] for rule in found[:6]] == ["permit", "use", "use", "use", "use", "permit"]


def test_rule_of_a_template_is_quoted_with_its_use(compile_text: Compile, site: str) -> None:
    text = site + TEMPLATE + policy("use low(bridge_a, top = 20 m)") + MISSION
    rule = rules_of(compile_text(text))[0]
    assert rule.text.startswith("use low(bridge_a, top = 20 m): permit goto by role who ")
    assert text[rule.start : rule.end].startswith("permit goto by role who")


def found(checked: Checked, text: str) -> list[tuple[str, str, list[str]]]:
    return [
        (
            each.code.id,
            "" if each.span is None else text[each.span.start : each.span.end],
            [text[label.span.start : label.span.end] for label in each.labels if label.text == "used here"],
        )
        for each in checked.diagnostics
    ]


def test_finding_in_a_template_names_up_to_three_uses(check_text: Check, site: str) -> None:
    wrong = "template t(top: altitude in 5 m .. 60 m) { permit goto by role operator when altitude <= tpo }\n"
    uses = [f"use t({height} m)" for height in (10, 20, 30, 40, 50)]
    text = site + wrong + policy(*uses)
    assert found(check_text(text), text) == [("E0201", "tpo", uses[:3])]


def test_finding_on_an_argument_names_its_use(check_text: Check, site: str) -> None:
    shrunk = (
        "template t(place: zone, by_: length in -500 m .. 0 m) "
        "{ permit goto by role operator when target inside grow(place, by_) }\n"
    )
    good, bad = "use t(city, -5 m)", "use t(bridge_a, -400 m)"
    text = site + shrunk + policy(good, bad)
    assert found(check_text(text), text) == [("E0505", "grow(place, by_)", [bad])]


@pytest.mark.parametrize(
    ("template", "codes"),
    [
        ("template t(x: altitude in 1 m .. 2 m) { permit gto by any }", ["E0201"]),
        ("template t(x: altitude in 1 m .. 2 m) { permit goto by any when altitude <= y }", ["E0201"]),
        ("template t(x: speed in 1 m/s .. 2 m/s) { permit goto by any when altitude <= x }", ["E0310"]),
        ("template t(z: zone) { permit goto by any when target inside z }", []),
        ("template t(z: zone) { permit goto by any when altitude <= z }", ["E0314"]),
        ("template t(r: role) { permit goto by role r when altitude <= 3 s }", ["E0310"]),
        ("template t(q: position) { permit gto by any }", ["E0607", "E0201"]),
        ("template t(q: nothing) { permit goto by any }", ["E0607"]),
        ("template t(q: speed) { permit goto by any }", ["E0607"]),
        ("template t(q: one of a, b) { permit goto by any }", ["E0607"]),
        ("template t(r: role, r: role) { permit goto by role r }", ["E0202"]),
        ("template t(city: zone) { permit goto by any when target inside city }", ["E0203"]),
        ("template t(altitude: altitude in 1 m .. 2 m) { permit goto by any when altitude <= 3 m }", ["E0203"]),
        ("template t(x: altitude in 1 m .. 2 m = 3 m) { permit goto by any when altitude <= x }", ["E0605"]),
        ("template city(x: zone) { permit goto by any }", ["E0202"]),
    ],
)
def test_unused_template_is_checked(check_text: Check, site: str, template: str, codes: list[str]) -> None:
    checked = check_text(site + template + "\n" + policy("  permit goto by role operator"))
    assert [each.code.id for each in checked.diagnostics if each.code.id < "E13"] == codes


@pytest.mark.parametrize(
    ("use", "code", "under"),
    [
        ("use lowe(bridge_a)", "E0201", "lowe"),
        ("use goto(bridge_a)", "E0204", "goto"),
        ("use low()", "E0603", "use low()"),
        ("use low(bridge_a, tpo = 3 m)", "E0601", "tpo"),
        ("use low(bridge_a, place = bridge_b)", "E0602", "place = bridge_b"),
        ("use low(bridge_a, 20 m, operator, 3)", "E0604", "3"),
        ("use low(bridge_a, 70 m)", "E0605", "70 m"),
        ("use low(bridge_a, 70 s)", "E0310", "70 s"),
        ("use low(30 m)", "E0312", "30 m"),
        ("use low(bridge_c)", "E0201", "bridge_c"),
        ("use low(bridge_a, who = 3 m)", "E0312", "3 m"),
        ("use low(bridge_a, who = city)", "E0312", "city"),
        ("use low(bridge_a, top = height)", "E0318", "height"),
    ],
)
def test_invalid_argument_of_a_use_is_underlined(check_text: Check, site: str, use: str, code: str, under: str) -> None:
    text = site + TEMPLATE + policy(use)
    one = [each for each in found(check_text(text), text) if each[0] < "E13"]
    assert [(one[0][0], one[0][1])] == [(code, under)]
    assert len(one) == 1


def test_template_file_belongs_to_the_policy(check_text: Check) -> None:
    text = (
        'import "lib:policies/training_field.rts"\n'
        "template t(x: altitude in 1 m .. 2 m) { permit goto by any when altitude <= x }\n"
    )
    assert check_text(text).diagnostics == ()
