"""Delegation: the resulting permissions against a naive interpretation, and refused delegations."""

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rtshcua.diagnostics.render import render
from rtshcua.diagnostics.span import Source
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.symbols import collect
from rtshcua.ground.elaborate.elaborate import elaborate
from rtshcua.ground.language.parse import parse
from rtshcua.ground.pipeline.program import Checked, Compiled
from rtshcua.mavlink import dialect
from rtshcua.model.flat.policy import RuleKind
from rtshcua.model.ir.expression import Comparison, Condition, Junction, Quantity
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.policies import RuleDecl

Compile = Callable[..., Compiled]
Check = Callable[[str], Checked]

SKILLS, ROLES, SOURCES = ("goto", "hover", "takeoff"), ("a", "b", "c", "d"), ("agent", "operator", "onboard")
HEIGHTS = range(6)


@dataclass(frozen=True)
class Line:
    """A rule or a delegation; no skills or roles: any; no sources: the default; `most` in metres."""

    kind: str
    skills: tuple[str, ...]
    roles: tuple[str, ...]
    through: tuple[str, ...]
    most: int | None
    to: str = ""

    def text(self) -> str:
        skills = ", ".join(self.skills) or "any"
        roles = "role " + ", ".join(self.roles) if self.roles else "any"
        to = f" to role {self.to}" if self.to else ""
        through = f" through {', '.join(self.through)}" if self.through else ""
        when = "" if self.most is None else f" when height <= {self.most} m"
        return f"  {self.kind} {skills} by {roles}{to}{through}{when}\n"


some = st.lists(st.sampled_from(SKILLS), max_size=2, unique=True).map(tuple)
through = st.lists(st.sampled_from(SOURCES), max_size=2, unique=True).map(tuple)
bound = st.none() | st.integers(1, 4)
rule = st.builds(
    Line,
    st.sampled_from(("permit", "permit", "forbid")),
    some,
    st.lists(st.sampled_from(ROLES), max_size=2, unique=True).map(tuple),
    through,
    bound,
)
# from a role to a later one: no circle
hop = st.tuples(st.integers(0, 2), st.integers(1, 3)).filter(lambda pair: pair[0] < pair[1])
delegation = st.builds(
    lambda skills, pair, through, most: Line("delegate", skills, (ROLES[pair[0]],), through, most, ROLES[pair[1]]),
    some,
    hop,
    through,
    bound,
)


def names(line: Line, skill: str) -> bool:
    return not line.skills or skill in line.skills


def passed_on(lines: list[Line], skill: str, role: str, source: str, height: int) -> bool:
    """Whether a permit that names the role holds, or one of a role that delegates to it, as the language says."""
    for line in lines:
        if line.kind == "permit" and role in line.roles and names(line, skill):
            sources = line.through or ("operator",)
            if source in sources and (line.most is None or height <= line.most):
                return True
        if line.kind == "delegate" and line.to == role and names(line, skill):
            narrowed = (not line.through or source in line.through) and (line.most is None or height <= line.most)
            if narrowed and passed_on(lines, skill, line.roles[0], source, height):
                return True
    return False


def forbidden(lines: list[Line], skill: str, role: str, source: str, height: int) -> bool:
    for line in lines:
        about = names(line, skill)
        holds_ = (not line.through or source in line.through) and (line.most is None or height <= line.most)
        if about and line.kind == "forbid" and role in line.roles and holds_:
            return True
        if (
            about
            and line.kind == "delegate"
            and line.to == role
            and forbidden(lines, skill, line.roles[0], source, height)
        ):
            return True
    return False


def holds(when: Condition | None, height: int) -> bool:
    if when is None:
        return True
    if isinstance(when, Junction):
        return all(holds(operand, height) for operand in when.operands)
    assert isinstance(when, Comparison)
    assert isinstance(when.right, Quantity)
    return height * 1000 <= when.right.value


class Said:
    """What an elaborated rule says."""

    def __init__(self, rule: RuleDecl) -> None:
        self.kind, self.roles, self.skills = rule.kind, names_of(rule.roles), names_of(rule.skills) or {*SKILLS}
        self.sources = names_of(rule.through) or ({"operator"} if rule.kind == "permit" else {*SOURCES})
        self.heights = {height for height in HEIGHTS if holds(rule.when, height)}


def names_of(nodes: Iterable[Name]) -> set[str]:
    return {node.text for node in nodes}


def matches(rules: list[Said], kind: str, skill: str, role: str, source: str, height: int) -> bool:
    """Whether an elaborated rule that names the role matches."""
    return any(
        each.kind == kind
        and role in each.roles
        and source in each.sources
        and skill in each.skills
        and height in each.heights
        for each in rules
    )


@settings(max_examples=settings().max_examples * 2, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(rule, min_size=1, max_size=5), st.lists(delegation, min_size=1, max_size=4))
def test_grantee_has_the_permissions_of_the_grantor_only(rules: list[Line], delegations: list[Line]) -> None:
    lines = [*rules, *delegations]
    skills = "".join(f"skill {name}() {{ motion hold }}\n" for name in SKILLS)
    text = skills + "policy p version 1 {\n" + "".join(line.text() for line in lines) + "}\n"
    source = Source("x.rts", text)
    parsed = parse(source)
    assert parsed.diagnostics == (), render(parsed.diagnostics, {"x.rts": source})
    report = Report({"x.rts": source})
    context = CheckContext(collect([parsed.unit]), report, dialect.load())
    plain = elaborate(context, [parsed.unit], lambda file: frozenset({file})).units[0].policies[0].rules
    said = [Said(rule) for rule in plain]
    assert {found.code.id for found in report.found} <= {"E0714"}
    for skill in SKILLS:
        for role in ROLES:
            for one in SOURCES:
                for height in HEIGHTS:
                    asked = (skill, role, one, height)
                    assert matches(said, "permit", *asked) == passed_on(lines, *asked), asked
                    assert matches(said, "forbid", *asked) == forbidden(lines, *asked), asked


REST = """
  permit takeoff by role operator through agent
  permit hover, return_home, emergency_land by any
  contingency hover for 10 s, return_home, emergency_land
}
"""


def policy(*lines: str) -> str:
    """A policy with these lines, and a declaration of every role that they name."""
    named = [names.split(", ") for line in lines for names in re.findall(r"\brole (\w+(?:, \w+)*)", line)]
    roles = dict.fromkeys(name for names in named for name in names)
    return "policy p version 1 {\n" + "\n".join(lines) + REST + f"role {', '.join(roles)}\n"


def test_delegated_rule_is_quoted_with_its_delegations(compile_text: Compile, site: str) -> None:
    permit = "permit goto by role operator through agent, operator when altitude <= 30 m or speed <= 2 m/s"
    one = "delegate goto by role operator to role trainee through agent when altitude <= 20 m"
    two = "delegate goto by role trainee to role guest when speed <= 3 m/s"
    mission = """
mission m under p@1 on quad {
  proposed by agent openclaw for role guest
  phase departure { takeoff(altitude = 10 m)  return_home() }
}
"""
    text = site + policy(permit, two, one, "permit takeoff by role guest through agent") + mission
    compiled = compile_text(text)
    assert compiled.policy is not None, render(compiled.diagnostics, compiled.sources)
    rule = next(each for each in compiled.policy.rules if each.text.startswith(two))
    assert rule.text == f"{two}: {one}: {permit}"
    assert rule.when is not None
    assert rule.when.text == "(altitude <= 30 m or speed <= 2 m/s) and altitude <= 20 m and speed <= 3 m/s"
    assert text[rule.start : rule.end] == permit
    assert text[rule.when.start : rule.when.end] == "speed <= 3 m/s"
    assert rule.kind == RuleKind.PERMIT


def test_step_outside_the_delegation_is_refused(compile_text: Compile, site: str) -> None:
    lines = (
        "permit goto by role operator through agent when altitude <= 30 m",
        "permit takeoff by role trainee through agent",
        "delegate goto by role operator to role trainee when altitude <= 10 m",
    )
    for height, codes in ((10, []), (11, ["E0703"])):
        mission = f"""
mission m under p@1 on quad {{
  proposed by agent openclaw for role trainee
  phase departure {{ takeoff(altitude = 10 m) }}
  phase inspection {{ goto(bridge_a.entry, altitude = {height} m)  return_home() }}
}}
"""
        found = compile_text(site + policy(*lines) + mission)
        assert [each.code.id for each in found.diagnostics] == codes, render(found.diagnostics, found.sources)


@pytest.mark.parametrize(
    ("lines", "found"),
    [
        (["delegate goto by role operator to role operator"], [("E0713", "itself")]),
        (
            [
                "delegate goto by role a to role b",
                "delegate goto by role b to role c",
                "delegate goto by role c to role a",
            ],
            [("E0713", "`a`")],
        ),
        # outside of the circle, and after it
        (
            [
                "delegate goto by role a to role b",
                "delegate goto by role b to role a",
                "delegate goto by role b to role c",
            ],
            [("E0713", "`a`")],
        ),
        (["delegate inspect_area by role operator to role trainee"], [("E0714", "`inspect_area`")]),
        (["delegate goto, inspect_area by role operator to role trainee"], [("E0714", "`inspect_area`")]),
        (["delegate any by role nobody to role trainee"], [("E0714", "any skill")]),
        (["delegate goto by role operator to role trainee through onboard"], [("E0714", "through `onboard`")]),
        (["delegate goto by role operator to role trainee through agnt"], [("E0709", "agnt")]),
        (["delegate got by role operator to role trainee"], [("E0201", "got")]),
        # nothing is said of what only follows from that
        (
            [
                "delegate got by role operator to role trainee",
                "delegate goto by role trainee to role guest",
                "delegate goto by role guest to role other",
            ],
            [("E0201", "got")],
        ),
        (
            ["delegate inspect_area by role operator to role a", "delegate inspect_area by role a to role b"],
            [("E0714", "`operator` is not permitted `inspect_area`")],
        ),
        (["delegate goto by role operator to role trainee when altitude >= 35 m"], [("E0715", "35 m")]),
        (["delegate goto by role operator to role trainee when altitude >= 25 m"], []),
        (["delegate goto, takeoff by role operator to role trainee when altitude >= 35 m"], []),
        # takeoff has no speed: the rule cannot be about it
        (["delegate goto, takeoff by role operator to role trainee when speed <= 2 m/s"], [("E0710", "speed")]),
        (["delegate goto by role operator to role trainee when altitude <= 3 s"], [("E0310", "3 s")]),
        (["delegate return_home by role operator to role trainee"], []),
        (["use nothing()", "delegate inspect_area by role operator to role trainee"], [("E0201", "nothing")]),
    ],
)
def test_invalid_delegation_is_refused(
    check_text: Check, site: str, lines: list[str], found: list[tuple[str, str]]
) -> None:
    text = site + policy("permit goto by role operator through agent when altitude <= 30 m", *lines)
    errors = [each for each in check_text(text).diagnostics if each.code.severity.value == "error"]
    assert [each.code.id for each in errors] == [code for code, _ in found]
    assert all(words in each.message for each, (_, words) in zip(errors, found, strict=True))


def test_exponential_delegations_are_refused_early(check_text: Check, site: str) -> None:
    ways = [
        f"delegate goto by role a{level}{one} to role a{level + 1}{other}"
        for level in range(20)
        for one in "xy"
        for other in "xy"
    ]
    text = site + policy("permit goto by role a0x, a0y", *ways)
    assert "E1001" in [each.code.id for each in check_text(text).diagnostics]


@pytest.mark.parametrize(
    "ways",
    [
        [f"delegate goto by role r{number} to role r{number + 1}" for number in range(200)],
        [f"delegate goto by role r{number} to role r{(number + 1) % 2_000}" for number in range(2_000)],
        ["delegate goto by role a to role b"] * 4_200,
    ],
)
def test_too_many_delegations_are_refused_before_ordering(check_text: Check, site: str, ways: list[str]) -> None:
    text = site + policy("permit goto by role r0 through agent when altitude <= 30 m", *ways)
    found = [each for each in check_text(text).diagnostics if each.code.severity.value == "error"]
    assert [each.code.id for each in found] == ["E1001"]
    assert "the policy has more than" in found[0].message
