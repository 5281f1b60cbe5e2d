"""A "did you mean" comes with a fix if the name is in the text, and the fix works."""

from pathlib import Path

import pytest

from reference.deciding import IMPORT, NOMINAL, WHEN, made
from rtshcua.diagnostics.diagnostic import Applicability, Diagnostic, has_errors
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.symbols import correction
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import check_program
from rtshcua.mavlink import dialect
from unit.ground.analysis.test_rule_checks import HEAD, LIBRARY, POLICY


def fixed(found: tuple[Diagnostic, ...], text: str) -> str:
    """A text after the fix of its only finding."""
    (one,) = found
    (fix,) = one.fixes
    assert fix.applicability is Applicability.SUGGESTED
    assert one.help is not None
    assert f"did you mean `{fix.replacement}`?" in one.help
    return text[: fix.span.start] + fix.replacement + text[fix.span.end :]


def checked(text: str) -> tuple[Diagnostic, ...]:
    """The errors of a source."""

    def read(path: str) -> bytes:
        return text.encode() if path == "x.rts" else Path(path).read_bytes()

    return tuple(each for each in check_program(load(["x.rts"], read, LIBRARY), dialect.load()) if has_errors([each]))


@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        ("permit goto by any when batery > 20 %", "permit goto by any when battery > 20 %"),
        ("permit gotto by any", "permit goto by any"),
        ("permit goto by any when target inside citty", "permit goto by any when target inside city"),
        ("permit goto by any when gps.fix >= fix_33d", "permit goto by any when gps.fix >= fix_3d"),
        ("degrade goto when battery < 9 % to hovver", "degrade goto when battery < 9 % to hover"),
    ],
)
def test_corrections_in_a_policy(wrong: str, right: str) -> None:
    text = HEAD + POLICY.format(wrong)
    assert fixed(checked(text), text) == HEAD + POLICY.format(right)


@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        (f"given batery = 20 % {WHEN}", f"given battery = 20 % {WHEN}"),
        ("when inspect_area(bridge_a, altitud = 20 m)", "when inspect_area(bridge_a, altitude = 20 m)"),
        (f"phase inspektion {WHEN}", f"phase inspection {WHEN}"),
    ],
)
def test_corrections_in_a_test(wrong: str, right: str) -> None:
    before = IMPORT + NOMINAL
    text = f'{before}test "it" {{ {wrong} expect allow }}'
    errors = tuple(each for each in made(text, "").diagnostics if has_errors([each]))
    first = tuple(each for each in errors if each.fixes)
    assert fixed(first, text) == f'{before}test "it" {{ {right} expect allow }}'


def test_correction_requires_the_word_in_the_text() -> None:
    report = Report({"x": Source("x", 'goto "gotto" gotto')})
    assert correction(report, Span("x", 5, 12), "gotto", ["goto"]) == (Span("x", 5, 12), '"goto"', "write `goto`")
    assert correction(report, Span("x", 13, 18), "gotto", ["goto"]) == (Span("x", 13, 18), "goto", "write `goto`")
    assert correction(report, Span("x", 0, 4), "gotto", ["goto"]) is None
    assert correction(report, Span("x", 13, 18), "gotto", ["pond"]) is None
