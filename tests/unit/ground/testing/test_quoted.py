"""A quotation after `at` is one clause, identified by its full text and its role."""

import pytest

from reference.deciding import IMPORT, NOMINAL, WHEN, found, made, ran
from rtshcua.ground.testing.case_result import run_case
from rtshcua.ground.testing.clause_quotes import quotes
from rtshcua.ground.testing.coverage_goals import universe_of
from rtshcua.model.flat.limits import MAX_TEXT

SITE = """import "lib:policies/site.rts"
import "lib:skills/hover.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"
"""
START = """
nominal noon {
  under long on quad by role operator through agent at "2026-06-01T10:00:00Z" phase flight
  given battery = 80 %, gps.fix = fix_3d, position = 47.39774 N, 8.54559 E, height = 10 m
}
"""
#: the beginning of several clauses, longer than the text on board
LONG = "/* " + "x" * MAX_TEXT + " */"


def policy(*rules: str) -> str:
    lines = "\n  ".join(("permit any by any", *rules, "contingency return_home, emergency_land"))
    return f"{SITE}policy long version 1 {{\n  {lines}\n}}\n{START}"


def findings(clause: str, because: str = "", before: str = IMPORT + NOMINAL, when: str = WHEN) -> list[str]:
    return [each[1] for each in found(f'test "it" {{ {when} expect deny {because} at "{clause}" }}', before)]


@pytest.mark.parametrize("clause", ["...", " ... ", "", "  "])
def test_empty_quotation_is_refused(clause: str) -> None:
    (message,) = findings(clause)
    assert message == "the quotation is empty"
    assert not quotes(clause, "forbid any")


def test_quotation_of_a_common_beginning_is_refused() -> None:
    rules = ("forbid hover by any when battery < 20 %", "forbid hover by any when battery < 30 %")
    (told,) = found('test "it" { when hover(5 s) expect deny at "forbid hover ..." }', policy(*rules))
    assert told == (
        "E1410",
        "`forbid hover ...` quotes the beginning of several clauses that can decide here",
        f"quote more of one: `{rules[0]}`, `{rules[1]}`",
    )
    for quoted in (rules[0], "forbid hover by any when battery < 2..."):
        assert findings(quoted, before=policy(*rules), when="when hover(5 s)") == []


def test_quotation_of_the_other_clause_with_this_beginning_is_not_met() -> None:
    rules = ("forbid hover by any when battery < 20 %", "forbid hover by any when battery < 90 %")
    text = 'test "{0}" {{ when hover(5 s) expect deny at "{0}" }}'
    met = [each.met for each in ran("".join(text.format(rule) for rule in rules), policy(*rules))]
    assert met == [False, True]


def test_clauses_that_differ_after_the_text_on_board_are_two() -> None:
    rules = [f"forbid hover by any {LONG} when battery > {more} %" for more in (45, 95)]
    assert len(rules[0]) > MAX_TEXT
    text = 'test "{0}" {{ when hover(5 s) expect deny at "{1}" }}'
    cases = made("".join(text.format(number, rule) for number, rule in enumerate(rules)), policy(*rules))
    assert [each.code.id for each in cases.diagnostics] == []
    assert [run_case(case).met for case in cases.cases] == [True, False]
    assert findings(rules[0][: MAX_TEXT - 3] + "...", before=policy(*rules), when="when hover(5 s)") != []


def test_template_uses_that_differ_after_the_text_on_board_are_two() -> None:
    template = "template narrow(most: ratio in 0 % .. 100 %) { forbid hover by any when battery > most }\n"
    uses = [f"use narrow({LONG} {most} %)" for most in (45, 95)]
    source = policy(*uses).replace("policy long", f"{template}policy long")
    (case,) = made('test "it" { when hover(5 s) expect deny }', source).cases
    items = universe_of(case.policy.prepared).items
    assert sum(item.role == "forbid" for item in items) == 2


def test_quotation_of_a_clause_in_two_lists_needs_the_reason() -> None:
    skill = """skill rest(time: duration in 1 s .. 9 s) {
  motion   hold for time  class tactical  deadline 5 s  valid for 30 min  lasts at most 1 min
  require battery > 20 %  maintain battery > 20 %
  fallback return_home, emergency_land  energy at most 5 %  record intent, decision, state, authorization, effect
}
"""
    before = policy().replace("policy long", f"{skill}policy long")
    text = 'test "it" {{ given battery = 10 % when rest(5 s) expect fallback {} at "battery > 20 %" }}'
    (told,) = found(text.format(""), before)
    assert told[1:] == (
        "`battery > 20 %` quotes more than one clause that can decide here",
        "add the reason with `because`: the clause is in `require`, `maintain`",
    )
    assert found(text.format("because state/violated"), before) == []
