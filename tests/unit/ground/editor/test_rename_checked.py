"""A renaming that would change a meaning is refused; equal names with other meanings stay unchanged."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.editor.navigation import targets
from rtshcua.ground.editor.occurrences import NameKind
from rtshcua.ground.editor.rename import Renaming, rename
from rtshcua.ground.editor.workspace import Workspace
from rtshcua.library import root
from rtshcua.mavlink import dialect

DIALECT = dialect.load()
SKILLS = Path(root()) / "skills"
HEAD = """import "lib:policies/site.rts"
import "lib:skills/signals.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"
"""
CONTRACT = """class tactical deadline 5 s valid for 10 min lasts at most 1 min grace 1 s
  require battery > 30 % assume gps.accuracy < 20 m fallback return_home, emergency_land energy at most 4 %
}
"""
OWN = f"""skill up(high: altitude in 5 m .. 60 m, how: one of fast, slow = fast) {{
  motion climb to high {CONTRACT}skill fly(target: position, high: altitude in 5 m .. 60 m) {{
  motion fly to target at high {CONTRACT}"""
POLICY = """role chief
policy p version 1 {
  permit up by role operator when high <= 20 m
  permit fly by role operator when high <= 30 m
  use low(top = 25 m)
  permit return_home, emergency_land by any
  contingency return_home, emergency_land
}
template low(top: altitude in 5 m .. 60 m) { permit up by role chief when high <= top }
"""
TESTS = """import "s.rts"
nominal n { under p on quad by role operator through operator at "2026-06-01T10:00:00Z" phase flight
  given battery = 80 %, gps.fix = fix_3d, position = 47.39774 N, 8.54559 E, height = 10 m, gps.accuracy = 1 m
  given velocity.north = 0 m/s, velocity.east = 0 m/s, velocity.down = 0 m/s }
test "up" { when up(30 m) expect deny at "permit up by role operator   when high <= 20 m" }
test "fly" { when fly(47.39780 N, 8.5456 E, 40 m) expect deny at "permit fly by role operator when high <= ..." }
test "chief" { when up(30 m) by role chief expect deny at "use low(top = 25 m): permit up by role chief when high <= top" }
"""  # fmt: skip  # noqa: E501
S, T = "/w/s.rts", "/w/t.rts"
SITE = {S: HEAD + OWN + POLICY, T: TESTS}
Make = Callable[[dict[str, str]], Workspace]


def asked(desk: Workspace, file: str, around: str, name: str, files: tuple[str, ...]) -> Renaming | Refusal:
    text = desk.text(file) or ""
    before, _, after = around.partition("|")
    at = text.index(before + after) + len(before)
    return rename(desk, files, desk.view(file), file, at, name, DIALECT)


def refused(found: Renaming | Refusal) -> str:
    assert isinstance(found, Refusal)
    return found.text


@pytest.mark.parametrize("name", ["position", "height", "battery", "velocity.north", "velocity.down"])
def test_signal_with_a_fixed_name_is_not_renamed(make: Make, name: str) -> None:
    desk = make({S: (SKILLS / "signals.rts").read_text()})
    assert "is fixed: " in refused(asked(desk, S, f"signal |{name}", "other", (S,)))


def test_signal_is_not_renamed_to_a_fixed_name(make: Make) -> None:
    charge = "signal charge : ratio = BATTERY_STATUS.battery_remaining stale after 2 s\n"
    desk = make({S: charge})
    assert "is fixed: " in refused(asked(desk, S, "signal |charge", "battery", (S,)))


FLOWN = """import "m.rts"
scenario "it" {
  flies one after up gps_loss(for = 4 s) expect flies up expect distance to field >= 3 m expect never fly
}
"""
M = """import "s.rts"
zone field = circle(47.39774 N, 8.54559 E, 40 m)
mission one under p@1 on quad {
  proposed by operator chief for role operator
  phase flight { up(20 m) return_home() }
}
"""


@pytest.mark.parametrize(
    ("file", "around"), [(S, "skill |up("), ("/w/m.rts", "zone |field"), ("/w/m.rts", "mission |one")]
)
def test_names_in_a_scenario_are_renamed(make: Make, file: str, around: str) -> None:
    old = around.split("|")[1].rstrip("(").split()[-1]
    desk = make({S: SITE[S], "/w/m.rts": M, "/w/f.rts": FLOWN})
    made = asked(desk, file, around, "other", ("/w/f.rts", "/w/m.rts", S))
    assert isinstance(made, Renaming)
    assert made.applied("/w/f.rts", FLOWN) == re.sub(rf"\b{old}\b", "other", FLOWN)


def test_renaming_in_a_clause_quoted_by_a_scenario_is_refused(make: Make) -> None:
    flown = FLOWN.replace("expect flies up", 'expect deny at "permit up by role operator ..."')
    desk = make({S: SITE[S], "/w/m.rts": M, "/w/f.rts": flown})
    assert "shorten the quotation" in refused(asked(desk, S, "skill |up(", "other", ("/w/f.rts", "/w/m.rts", S)))


def test_type_of_a_signal_is_not_the_signal_of_that_name(make: Make) -> None:
    desk = make({S: (SKILLS / "signals.rts").read_text()})
    text = desk.text(S) or ""
    declared, typed = text.index("signal position") + 7, text.index(": position") + 2
    assert [each.kind for each in targets(desk.view(S), S, declared)] == [NameKind.DECLARED]
    assert [each.kind for each in targets(desk.view(S), S, typed)] == [NameKind.TYPE]


def test_survey_pattern_is_not_renamed(make: Make) -> None:
    desk = make({S: (SKILLS / "inspect_area.rts").read_text()})
    assert "E0608" in refused(asked(desk, S, "one of |grid", "lanes", (S,)))


def test_policy_with_the_name_of_its_file_is_renamed(make: Make) -> None:
    """The import of a file with the policy's name does not change."""
    desk = make({})
    desk.put("s.rts", SITE[S].replace("policy p ", "policy s "))
    desk.put("t.rts", TESTS.replace("under p ", "under s "))
    made = asked(desk, "s.rts", "policy |s ", "site_rules", ())
    assert isinstance(made, Renaming)
    assert {file: len(spans) for file, spans in made.places.items()} == {"s.rts": 1, "t.rts": 1}


def test_declaration_with_the_name_of_a_message_is_renamed(make: Make) -> None:
    """Fields of messages and members of declarations are independent."""
    own = SITE[S].replace("skill up", "skill HEARTBEAT").replace("permit up", "permit HEARTBEAT")
    desk = make({S: own + "signal mood : count = HEARTBEAT.custom_mode stale after 2 s\n"})
    assert isinstance(asked(desk, S, "skill |HEARTBEAT", "up", (S,)), Renaming)


def test_quotation_of_another_clause_is_unchanged(make: Make) -> None:
    desk = make(SITE)
    made = asked(desk, S, "skill up(|high", "top_height", (S, T))
    assert isinstance(made, Renaming)
    text = made.applied(T, TESTS)
    assert 'at "permit up by role operator   when top_height <= 20 m"' in text
    assert 'at "permit fly by role operator when high <= ..."' in text
    assert 'at "use low(top = 25 m): permit up by role chief when top_height <= top"' in text


def test_quotation_changes_with_the_use_of_a_template(make: Make) -> None:
    made = asked(make(SITE), S, "template low(|top", "limit", (S, T))
    assert isinstance(made, Renaming)
    assert 'at "use low(limit = 25 m): permit up by role chief when high <= limit"' in made.applied(T, TESTS)


def test_quotation_cut_within_the_name_is_unchanged(make: Make) -> None:
    desk = make({**SITE, T: TESTS.replace("operator when high <= ...", "operator when hi...")})
    assert "E1410" in refused(asked(desk, S, "target: position, |high", "height_over", (S, T)))


def test_quotation_in_a_test_with_errors_refuses_the_renaming(make: Make) -> None:
    desk = make({**SITE, T: TESTS.replace("when fly(47.39780 N, 8.5456 E, 40 m)", "when fly(40 m)")})
    assert "correct the errors first" in refused(asked(desk, S, "skill up(|high", "top_height", (S, T)))


def test_renaming_with_a_new_finding_is_refused(make: Make) -> None:
    """A template's parameter may not have the name of a parameter of the skill in its rule."""
    assert "E0203" in refused(asked(make(SITE), S, "template low(|top", "how", (S, T)))
    assert "E0203" in refused(asked(make(SITE), S, "60 m, |how", "top", (S, T)))


def test_renaming_that_breaks_another_program_is_refused(make: Make) -> None:
    """Two programs share a file that uses a zone, and each declares its own zone."""
    zone = "zone yard = circle(47.39774 N, 8.54559 E, 40 m)\n"
    files = {
        "/w/a.rts": f'import "both.rts"\n{zone}', "/w/b.rts": f'import "both.rts"\n{zone}',
        "/w/both.rts": "zone near = union(yard)\n",
    }  # fmt: skip
    why = refused(asked(make(files), "/w/a.rts", "zone |yard", "field", tuple(files)))
    assert "/w/b.rts" in why
    assert isinstance(asked(make(files), "/w/a.rts", "zone |yard", "field", ("/w/a.rts", "/w/both.rts")), Renaming)


def test_earlier_findings_do_not_refuse_a_renaming(make: Make) -> None:
    desk = make({**SITE, S: SITE[S] + "zone bad = union(nothing)\n"})
    assert isinstance(asked(desk, S, "zone |bad", "worse", (S,)), Renaming)
