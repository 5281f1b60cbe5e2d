"""Ignores in comments and configurations: their effect, and findings about unused ignores."""

from pathlib import Path

import pytest

from reference.lint_project import HABITS, MISSION, POLICY, UNUSED, Lint, put
from rtshcua.diagnostics.exits import ExitCode

MISSING = [each for each in HABITS if each != ("E1302", "one.rts")]


@pytest.mark.parametrize(
    "ignore",
    [
        "mission Look under meadow_flight@2 on quad {  // rtshcua: ignore naming because of the register",
        "// rtshcua: ignore E1302 because of the register\nmission Look under meadow_flight@2 on quad {",
        "// rtshcua: ignore E1302 because of the register\n// the look\nmission Look under meadow_flight@2 on quad {",
        "mission Look /* rtshcua: ignore E1302 because of the register */ under meadow_flight@2 on quad {",
    ],
)
def test_comment_ignores_findings_on_a_line(here: Path, lint: Lint, ignore: str) -> None:
    put({"one.rts": MISSION.replace("mission Look under meadow_flight@2 on quad {", ignore)})
    assert lint(".") == (ExitCode.DIAGNOSTICS, MISSING)


def test_comment_ignores_findings_in_a_file(here: Path, lint: Lint) -> None:
    put({"one.rts": f"// rtshcua: ignore-file naming, E1302 because of the register\n{MISSION}"})
    assert lint(".") == (ExitCode.DIAGNOSTICS, MISSING)
    put({"one.rts": f"{MISSION}// rtshcua: ignore-file naming because of the register\n"})
    assert lint("one.rts") == (ExitCode.DIAGNOSTICS, [("E1302", "one.rts"), ("E1309", "one.rts")])


@pytest.mark.parametrize(
    ("comment", "code"),
    [
        ("rtshcua: ignore E1304 because it is so", "E1309"),
        ("rtshcua: ignore E1302", "E1310"),
        ("rtshcua: ignore E1302 because", "E1310"),
        ("rtshcua: ignore E1302 becuase it is so", "E1310"),
        ("rtshcua: ignore namin because it is so", "E1311"),
        ("rtshcua: ignore E0310 because it is so", "E1311"),
        ("rtshcua: ignore unused-ignore because it is so", "E1311"),
        ("rtshcua: ignore because it is so", "E1311"),
        ("rtshcua: disable E1302 because it is so", "E1311"),
    ],
)
def test_unused_ignore_is_reported(here: Path, lint: Lint, comment: str, code: str) -> None:
    put({"one.rts": MISSION.replace("Look", "look").replace("inspection {", f"inspection {{  // {comment}\n")})
    assert lint("one.rts") == (ExitCode.DIAGNOSTICS, [(code, "one.rts")])


def test_errors_cannot_be_ignored_and_hide_unused_ignores(here: Path, lint: Lint) -> None:
    text = MISSION.replace("hover(5 s) }", "hover(5 s) takeoff() }  // rtshcua: ignore E1304 because it is so")
    put({"one.rts": text})
    assert lint("one.rts") == (ExitCode.DIAGNOSTICS, [("E0603", "one.rts")])


def test_string_that_looks_like_a_comment_ignores_nothing(here: Path, lint: Lint) -> None:
    intent = 'mission Look under meadow_flight@2 on quad { intent "// rtshcua: ignore E1302 because it is so"'
    put({"one.rts": MISSION.replace("mission Look under meadow_flight@2 on quad {", intent)})
    assert lint("one.rts") == (ExitCode.DIAGNOSTICS, [("E1302", "one.rts")])


def test_configuration_ignores_findings(here: Path, lint: Lint) -> None:
    put({"rtshcua.toml": '[lint]\nignore = { naming = "the register gives the names" }'})
    assert lint(".") == (ExitCode.DIAGNOSTICS, [("E1305", "policy.rts")])
    put({"rtshcua.toml": '[lint.per-file-ignore]\n"one.rts" = { E1302 = "the register gives the names" }'})
    assert lint(".") == (ExitCode.DIAGNOSTICS, MISSING)


def test_ignores_of_a_partly_linted_project_are_not_unused(here: Path, lint: Lint) -> None:
    put({"pyproject.toml": '[tool.rtshcua.lint.ignore]\nE1302 = "the register gives the names"'})
    assert lint(".") == (ExitCode.DIAGNOSTICS, [("E1305", "policy.rts")])
    put({".git/HEAD": "", "sub/rtshcua.toml": "", "sub/three.rts": MISSION.replace("policy.rts", "../policy.rts")})
    assert lint("sub") == (ExitCode.DIAGNOSTICS, [("E1302", "sub/three.rts")])


def test_unused_ignore_of_a_configuration_is_reported(here: Path, lint: Lint) -> None:
    put({"rtshcua.toml": '[lint.ignore]\nE1304 = "it is so"\nE1302 = "names"\nE1305 = "imports"'})
    assert lint(".") == (ExitCode.DIAGNOSTICS, [("E1309", "rtshcua.toml")])
    assert lint("one.rts") == (ExitCode.OK, [])  # a project linted in part has no unused ignores


def test_report_contains_the_reason_of_an_ignore(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from rtshcua.front.cli.app import main

    put({"policy.rts": POLICY.replace(UNUSED, f"{UNUSED}  // rtshcua: ignore E1305 because of later")})
    main(["lint", "policy.rts", "--json"])
    assert '"reason": "of later"' in capsys.readouterr().out
