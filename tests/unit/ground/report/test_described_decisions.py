"""Decisions on the page: short answers of rights, unknown signals, and tests under their policy."""

import re
from dataclasses import replace
from html import unescape
from pathlib import Path

from rtshcua.diagnostics.diagnostic import has_errors
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import examine_program
from rtshcua.ground.pipeline.suite import suite
from rtshcua.ground.report.html_page import page
from rtshcua.ground.report.policy_report import DecidedCases, ReportPart, policy_report
from rtshcua.ground.report.report_model import Chapter, PolicyReport
from rtshcua.ground.testing.case_result import run_case
from rtshcua.mavlink import dialect
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[4]
BEFORE = "".join(
    f'import "lib:{each}.rts"\n'
    for each in ("policies/site", "skills/hover", "skills/goto", "skills/return_home", "skills/emergency_land")
)
AFTER = "\npermit hover, return_home, emergency_land by any\ncontingency return_home, emergency_land }\n"
NOMINAL = """
nominal NAME { under POLICY on quad by role operator through agent at "2026-06-01T10:00:00Z" phase flight
  given battery = 80 %, gps.fix = fix_3d, position = 47.39774 N, 8.54559 E, height = 10 m, wind.speed = 1 m/s
  given velocity.north = 0 m/s, velocity.east = 0 m/s, velocity.down = 0 m/s }
"""


def book(**files: str) -> PolicyReport:
    """The policy report of the first file, with its tests decided."""

    def read(path: str) -> bytes:
        return files[path[:-4]].encode() if path[:-4] in files else Path(path).read_bytes()

    program = load([f"{next(iter(files))}.rts"], read, str(CHECKOUT))
    checked = examine_program(program, dialect.load())
    assert not has_errors(checked.diagnostics), checked.diagnostics
    tried = DecidedCases(program, tuple(run_case(case) for case in suite(program, dialect.load()).cases))
    return policy_report([ReportPart(program, checked.policies, (), (), (tried,))], made_at_us=0, made_by="x")


def chapter(rules: str) -> Chapter:
    (found,) = book(p=f"{BEFORE}role chief policy p version 1 {{\n{rules}{AFTER}").chapters
    return found


@rows(
    ("rules", "answer"),
    [
        ("permit goto by role operator", "yes"),
        ("permit goto by role operator when battery > 50 %", "on conditions"),
        ("permit goto by role operator through agent\nforbid goto by any", "no"),
        ("permit goto by role operator through agent\nforbid goto by role operator through agent", "no"),
        (
            "permit goto by role operator through agent\nforbid goto by any through agent, operator, onboard, reflex",
            "no",
        ),
        ("permit goto by role operator through agent\nforbid goto by role operator through operator", "yes"),
        ("permit goto by role operator through agent, operator\nforbid goto by any through agent", "yes"),
        ("permit goto by role operator through agent\nforbid goto by any when battery < 30 %", "on conditions"),
        ("permit goto by role operator\nconfirm goto by role chief within 9 s", "after approval"),
        (
            "permit goto by role operator when battery > 50 %\nconfirm goto by role chief within 9 s",
            "after approval, on conditions",
        ),
        ("permit goto by role operator\nconfirm goto when battery < 50 % by role chief within 9 s", "on conditions"),
        ("permit goto by role operator\ndegrade goto to return_home", "something else"),
    ],
)
def test_short_answer_of_a_right_follows_from_the_rules(rules: str, answer: str) -> None:
    (operator,) = [each for each in chapter(rules).rights if each.role == "operator"]
    assert [right.answer for right in operator.rights if right.skill == "goto"] == [answer]


def test_rule_signed_as_several_is_listed_once_for_each_skill() -> None:
    """`altitude` is in different argument cells of the two skills."""
    found = book(
        p='import "lib:skills/takeoff.rts"\n' + BEFORE + "role chief policy p version 1 {\n"
        "permit goto, takeoff by role operator\n"
        "confirm goto, takeoff when altitude < 10 m by role chief within 30 s" + AFTER
    ).chapters[0]
    told = [rule.told for rule in found.rules if rule.kind == "confirm"]
    assert len(told) == 2
    assert sorted(each.split("`")[1] for each in told) == ["goto", "takeoff"]
    for right in (right for each in found.rights for right in each.rights):
        assert len(right.confirmations) == (right.skill in ("goto", "takeoff"))


def test_degrade_is_described_without_its_own_target() -> None:
    told = [rule.told for rule in chapter("permit hover by any\ndegrade any when battery < 25 % to hover").rules]
    assert "`hover` is flown instead of any other skill, if `battery` is below 25 %." in told


def test_degrade_keeps_the_brackets_of_its_condition(everything: PolicyReport) -> None:
    rule = "degrade goto when (battery < 40 % or gps.accuracy > 5 m) and height > 50 m to return_home"
    made = chapter(f"permit goto by role operator\n{rule}")
    text = page(replace(everything, chapters=(made,)))
    section = unescape(text[text.index('id="p1-denied"') : text.index('id="p1-skills"')]).replace("\u00a0", " ")
    words = "instead of goto, if (battery is below 40 % or gps.accuracy is above 5 m) and height is above 50 m."
    assert words in re.sub("<[^>]*>", "", section)


def test_page_describes_the_effect_of_unknown_signals(everything: PolicyReport) -> None:
    """As in `decide`: a permit does not hold, a prohibition waits, an approval is required, a `degrade` waits."""
    text = page(everything)
    for words in (
        "a permission (“only if”) counts only if its condition is true",
        "a prohibition (“never if”) denies if its condition is true; if that is not known, the step waits",
        "an approval must be given if its condition is true, and also if that is not known",
        "something else is flown if the condition for that is true; if it is not known, the step waits",
    ):
        assert words in text


def test_requested_place_is_described_without_height() -> None:
    zone = "zone tall = circle(47.3990 N, 8.5470 E, 30 m) floor 10 m ceiling 40 m above home\n"
    rules = (
        "permit goto by role operator when target inside tall\npermit hover by role operator when position inside tall"
    )
    first, second, *_ = book(p=f"{BEFORE}{zone}role chief policy p version 1 {{\n{rules}{AFTER}").chapters[0].rules
    assert first.told.endswith("the `target` asked for is inside `tall` (on the ground, at whatever height).")
    assert second.told.endswith("`position` is inside `tall`.")


IMPORTED = (
    f"{BEFORE}policy strict version 1 {{\npermit hover by role operator through agent when battery > 90 %{AFTER}"
    f"{NOMINAL.replace('NAME', 'm').replace('POLICY', 'strict')}"
    'test "in the imported file" { when hover(10 s) expect allow }\n'
)
ASKED = (
    f'import "a.rts"\npolicy lax version 1 {{\npermit hover by role operator through agent{AFTER}'
    f"{NOMINAL.replace('NAME', 'n').replace('POLICY', 'lax')}"
)


def test_test_is_listed_under_its_policy_and_imported_tests_are_not() -> None:
    chapters = book(b=f'{ASKED}test "hover" {{ when hover(10 s) expect allow }}\n', a=IMPORTED).chapters
    assert {each.name: [case.name for case in each.cases] for each in chapters} == {"lax": ["hover"], "strict": []}
    assert {each.name: [start.name for start in each.starts] for each in chapters} == {"lax": ["n"], "strict": []}


def test_case_shows_its_decision_and_whether_it_was_expected() -> None:
    tests = 'test "t" { when hover(10 s) table battery { 80 % expect allow\n 60 % expect deny } }\n'
    made = book(b=ASKED + tests, a=IMPORTED)
    (lax,) = [each for each in made.chapters if each.name == "lax"]
    assert [case.met for case in lax.cases] == [True, False]
    assert lax.cases[0].given[0] == "as in `n`"
    assert lax.cases[1].decided == "it is allowed, because `admitted`"
    assert "not all came out as they must" in page(made)
    assert page(made).count("not as it must:") == 1
