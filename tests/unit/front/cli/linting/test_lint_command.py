"""`rtshcua lint`: findings, report formats and exit codes."""

import json
import os
from pathlib import Path
from xml.etree import ElementTree

import pytest

from reference.lint_project import HABITS, MISSION, POLICY, UNUSED, Lint, put
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main


def test_only_requested_files_are_linted(here: Path, lint: Lint) -> None:
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)
    assert lint("one.rts") == (ExitCode.DIAGNOSTICS, [("E1302", "one.rts")])
    assert lint("one.rts", "policy.rts") == (ExitCode.DIAGNOSTICS, [("E1302", "one.rts"), ("E1305", "policy.rts")])


def test_findings_of_check_are_reported_and_errors_hide_habits(here: Path, lint: Lint) -> None:
    put({"one.rts": MISSION.replace("hover(5 s)", "hover(5 s) takeoff()")})
    code, found = lint("one.rts")
    assert (code, {each for each, _ in found}) == (ExitCode.DIAGNOSTICS, {"E0603"})


def test_rule_about_decisions_of_a_policy_is_run(here: Path, lint: Lint) -> None:
    put({"policy.rts": POLICY.replace("inside meadow", "inside meadow outside airfield").replace(
        "\npolicy", "\nzone airfield = circle(46.3978 N, 8.5456 E, 1 km)\npolicy")})  # fmt: skip
    assert ("E1307", "policy.rts") in lint(".")[1]


@pytest.mark.parametrize(
    ("level", "code"), [("error", 0), ("warning", 1), ("note", 1), ("never", 0)]
)  # fmt: skip
def test_fail_on_sets_the_level_that_fails(here: Path, lint: Lint, level: str, code: int) -> None:
    assert lint(".", "--fail-on", level) == (code, HABITS)
    put({"rtshcua.toml": f'lint.fail-on = "{level}"'})
    assert lint(".") == (code, HABITS)
    assert lint(".", "--fail-on", "error")[0] == ExitCode.OK


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["--format", "sariff"], ExitCode.USAGE, "did you mean `sarif`?"),
        (["--fail-on", "x"], ExitCode.USAGE, "accepted: `error`, `warning`"),
        (["--config", "nowhere.toml"], ExitCode.INPUT, "nowhere.toml: cannot be read"),
        (["--config", "policy.rts"], ExitCode.INPUT, "policy.rts:1: not valid toml"),
        (["--isolated", "--config", "x.toml"], ExitCode.USAGE, "cannot be combined"),
        (["nowhere.rts"], ExitCode.INPUT, "cannot read `nowhere.rts`"),
        (["--bogus"], ExitCode.USAGE, "no such option"),
        (["--output", "nowhere/x.json", "--format", "json"], ExitCode.INPUT, "no such file or directory"),
    ],
)
def test_invalid_command_line_is_refused(
    here: Path, capsys: pytest.CaptureFixture[str], words: list[str], code: ExitCode, said: str
) -> None:
    assert main(["lint", ".", *words]) == code
    assert said in capsys.readouterr().err.lower().replace("no such option:", "no such option")


def test_malformed_configuration_is_refused(here: Path, lint: Lint) -> None:
    put({"rtshcua.toml": "[lint]\nexlude = []"})
    code, found = lint(".")
    assert (code, found[0][0]) == (ExitCode.INPUT, "configuration")
    assert "rtshcua.toml:2: unknown key `exlude`" in found[0][1]
    assert lint(".", "--isolated") == (ExitCode.DIAGNOSTICS, HABITS)


def test_excluded_files_are_not_linted(here: Path, lint: Lint, capsys: pytest.CaptureFixture[str]) -> None:
    put({"rtshcua.toml": 'lint.exclude = ["t*.rts"]'})
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS[:2])
    assert lint("two.rts") == (ExitCode.OK, [])
    assert main(["lint", "two.rts"]) == ExitCode.OK
    assert "1 file left out" in capsys.readouterr().out


def test_further_sources_of_a_configuration_are_read(here: Path, lint: Lint) -> None:
    put({"one.rts": MISSION.replace('import "policy.rts"\n', "").replace("Look", "look")})
    assert lint("one.rts")[0] == ExitCode.DIAGNOSTICS
    put({"rtshcua.toml": 'lint.with = ["policy.rts"]'})
    assert lint("one.rts") == (ExitCode.OK, [])


def test_human_report(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["lint", ".", "--statistics"]) == ExitCode.DIAGNOSTICS
    said = capsys.readouterr()
    assert "warning[E1302]: `Look` violates the naming convention" in said.err
    assert "3 warnings; run `rtshcua explain E1302` for details" in said.err
    assert said.out == "    2  E1302 naming\n    1  E1305 unused-import\n"
    put({"one.rts": MISSION.replace("Look", "look"), "two.rts": MISSION.replace("Look", "look")})
    put({"policy.rts": POLICY.replace(UNUSED, f"{UNUSED}  // rtshcua: ignore unused-import because of later")})
    assert main(["lint", "."]) == ExitCode.OK
    said = capsys.readouterr()
    assert (said.out, said.err) == ("nothing found in 3 files, 1 ignored\n", "")


def test_machine_readable_reports(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["lint", ".", "--format", "github"]) == ExitCode.DIAGNOSTICS
    said = capsys.readouterr()
    assert [line.split("title=")[1][:5] for line in said.out.splitlines()] == [code for code, _ in HABITS]
    assert said.err == ""
    assert main(["lint", ".", "--format", "sarif"]) == ExitCode.DIAGNOSTICS
    run = json.loads(capsys.readouterr().out)["runs"][0]
    assert [each["ruleId"] for each in run["results"]] == [code for code, _ in HABITS]
    assert main(["lint", ".", "--format", "junit", "--output", "report.xml"]) == ExitCode.DIAGNOSTICS
    root = ElementTree.parse("report.xml").getroot()
    assert {suite.get("name") for suite in root.iter("testsuite")} == {"one.rts", "policy.rts", "two.rts"}
    assert "warning[E1305]" in capsys.readouterr().err  # in the log of the CI run
    assert main(["lint", "--output", "report.txt"]) == ExitCode.DIAGNOSTICS
    assert Path("report.txt").read_text().startswith("warning[E1302]")
    assert main(["lint", ".", "--format", "github", "--output", "/dev/null"]) == ExitCode.DIAGNOSTICS
    capsys.readouterr()
    assert main(["lint", ".", "--json"]) == ExitCode.DIAGNOSTICS
    told = json.loads(capsys.readouterr().out)
    assert (told["files"], told["exit"], told["ignored"]) == (3, "diagnostics", [])


def test_specification_is_linted_with_its_policy(checkout: Path, here: Path, lint: Lint) -> None:
    proposal = (checkout / "missions" / "proposal.json").read_text(encoding="utf-8")
    put({"proposal.json": proposal})
    assert lint("proposal.json") == (ExitCode.OK, [])


def test_report_is_written_through_a_symbolic_link(here: Path) -> None:
    (here / "reports").mkdir()
    Path("report.txt").symlink_to("reports/real.txt")
    for _ in range(2):
        assert main(["lint", ".", "--output", "report.txt"]) == ExitCode.DIAGNOSTICS
        assert Path("report.txt").is_symlink()
        assert Path("reports/real.txt").read_text().startswith("warning[E1302]")


@pytest.mark.parametrize(
    ("further", "said"),
    [(".", "is a folder"), ("/dev/zero", "lies outside"), ("pipe", "is not a file"), ("x.rts", "does not exist")],
)
def test_invalid_further_source_is_refused(here: Path, lint: Lint, further: str, said: str) -> None:
    put({"rtshcua.toml": f'[lint]\nwith = ["{further}"]'})
    os.mkfifo("pipe")
    code, found = lint(".")
    assert (code, found[0][0]) == (ExitCode.INPUT, "configuration")
    assert found[0][1].startswith(f"rtshcua.toml: `{further}` in `with`")
    assert said in found[0][1]


def test_written_human_report_has_the_width_of_the_terminal(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    (here / "long.rts").write_text("skill look() { require wind.sped < 5 m/s and batery > 20 % and altitude < 20 m }")
    assert main(["lint", "long.rts", "--output", "report.txt"]) == ExitCode.DIAGNOSTICS
    lines = (here / "report.txt").read_text(encoding="utf-8").splitlines()
    assert max(len(line) for line in lines if "|" not in line and "-->" not in line) <= 60
