"""Fixes and help of E0722: a fix deletes copies with their line; otherwise the help names the wider rule."""

from pathlib import Path

import pytest

from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.removal import whole_line
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import check_program
from rtshcua.mavlink import dialect
from unit.ground.analysis.test_rule_checks import HEAD, LIBRARY, POLICY

GOTO = "permit goto by role operator"


def redundant(rules: str) -> list[Diagnostic]:
    """Return the E0722 findings of a policy with these rules."""
    source = (HEAD + POLICY.format(rules)).encode()

    def read(path: str) -> bytes:
        return source if path == "x.rts" else Path(path).read_bytes()

    return [each for each in check_program(load(["x.rts"], read, LIBRARY), dialect.load()) if each.code.id == "E0722"]


def test_wider_rule_is_named_and_no_fix_deletes_the_narrower() -> None:
    wide = "permit goto by any"
    narrow = [f"{GOTO} when altitude < 20 m", "permit goto by role trainee when altitude < 10 m", GOTO]
    found = redundant("\n  ".join([wide, *narrow]))
    assert len(found) == 3
    assert {each.help for each in found} == {
        f"check `{wide}` first: if it permits too much, narrow it; otherwise delete this rule"
    }
    assert [each.fixes for each in found] == [(), (), ()]


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (GOTO, "permit goto, hover by role operator"),
        (f"{GOTO} through agent when altitude < 9 m", f"{GOTO} when altitude < 9 m"),
        ("forbid goto by role a when battery < 9 %", "forbid goto by any when battery < 9 %"),
        ("confirm goto by role a within 40 s", "confirm goto by role a within 30 s"),
    ],
)
def test_equal_condition_alone_makes_no_copy(one: str, other: str) -> None:
    assert all(not each.fixes for each in redundant(f"{other}\n  {one}"))


@pytest.mark.parametrize("when", ["", " when altitude < 20 m", "\n          when altitude < 20 m"])
def test_fix_deletes_a_copy_with_its_line(when: str) -> None:
    rules = f"// of the first\n  {GOTO}{when}\n  // of the last\n  {GOTO}{when}  // its own\n  // of what follows"
    (found,) = redundant(rules)
    (fix,) = found.fixes
    text = HEAD + POLICY.format(rules)
    after = text[: fix.span.start] + fix.replacement + text[fix.span.end :]
    assert after == HEAD + POLICY.format(f"// of the first\n  {GOTO}{when}\n  // of the last\n  // of what follows")


@pytest.mark.parametrize(
    ("before", "part", "behind", "left"),
    [
        ("a\n  ", "b", "\r\nc", "a\nc"),
        ("a  ", "b", "  // of a\n", "a  // of a\n"),
        ("a\n  ", "b", "  c\n", "a\n  c\n"),
        ("", "b", "", ""),
    ],
)
def test_fix_keeps_other_text_on_the_line(before: str, part: str, behind: str, left: str) -> None:
    text = before + part + behind
    gone = whole_line(text, Span("x", len(before), len(before) + len(part)))
    assert text[: gone.start] + text[gone.end :] == left
