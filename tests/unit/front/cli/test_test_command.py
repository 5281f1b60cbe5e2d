"""`rtshcua test`: selected tests, output, exit codes and written files."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from reference.tested import POLICY, TESTS
from rtshcua.app.testing import run as running
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    put("policy.rts", POLICY)
    put("tests/yard.rts", TESTS.replace('"policy.rts"', '"../policy.rts"'))
    return tmp_path


def put(name: str, text: str) -> None:
    Path(name).parent.mkdir(parents=True, exist_ok=True)
    Path(name).write_text(text, encoding="utf-8")


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    code = app.main(["test", *words])
    out, err = capsys.readouterr()
    return code, out, err


def answer(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, dict[str, Any]]:
    code, out, err = run(capsys, *words, "--json")
    assert err == ""
    return code, json.loads(out)


def test_output_has_a_line_per_test_and_a_summary(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys)
    assert (code, err) == (ExitCode.OK, "")
    assert out.splitlines() == [
        "tests/yard.rts",
        "  ok    hovering (3 rows)",
        "  ok    coming home",
        "2 tests, 4 cases: all passed",
    ]


def test_verbose_lists_rows(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = run(capsys, "-v")
    assert "      ok    [60 %]" in out.splitlines()


def test_failure_shows_source_clause_and_nearest_value(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put("policy.rts", POLICY.replace("> 50 %", "> 70 %"))
    code, out, err = run(capsys, "tests")
    assert code == ExitCode.TESTS
    assert "  FAIL  hovering (1 of 3 rows)" in out
    assert out.splitlines()[-1] == "2 tests, 4 cases: 1 failed"
    assert "error[E1411]" in err
    assert "60 %    expect allow" in err
    assert "permit  hover by role operator through agent when battery > 70 %" in err
    assert "`battery = 70.01 %`" in err


def test_tests_run_only_in_named_files(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put("all.rts", 'import "tests/yard.rts"\ntest "mine" from noon { when hover(5 s) expect allow }\n')
    code, found = answer(capsys, "all.rts")
    assert (code, [each["name"] for each in found["tests"]]) == (ExitCode.OK, ["mine"])
    _, found = answer(capsys, ".")
    assert found["summary"] == {"tests": 3, "cases": 5, "passed": 5, "failed": 0, "left_out": 0}


def test_only_those_that_are_named(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, found = answer(capsys, "-k", "HOME")
    assert [each["name"] for each in found["tests"]] == ["coming home"]
    assert found["summary"]["left_out"] == 3
    code, out, _ = run(capsys, "-k", "no such")
    assert (code, out) == (ExitCode.TESTS, "no test was run: no name of 4 contains `no such`\n")
    for near in ("comming home", "comming"):
        _, out, _ = run(capsys, "-k", near)
        assert out == f"no test was run: no name of 4 contains `{near}`; the nearest is `coming home`\n"


def test_run_without_tests_fails(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "policy.rts")
    assert code == ExitCode.TESTS
    assert out.startswith("no test was found")


def test_sources_with_errors_are_not_called_sources_without_tests(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    put("broken.rts", 'test "one" { when')
    Path("binary.rts").write_bytes(b"\x00\xff\xfe")
    words = "no test was run: the sources have errors\n"
    for name, code in (
        ("broken.rts", ExitCode.DIAGNOSTICS),
        ("binary.rts", ExitCode.DIAGNOSTICS),
        ("nope.rts", ExitCode.INPUT),
    ):
        assert run(capsys, name)[:2] == (code, words)


def test_case_as_json_is_complete(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, found = answer(capsys, "-k", "40 %")
    assert code == ExitCode.OK
    assert (found["format"], found["exit"], found["diagnostics"]) == ("rtshcua/diagnostics", "ok", [])
    start = POLICY.index("permit  hover")
    row = Path("tests/yard.rts").read_text(encoding="utf-8").index("40 %")
    assert found["tests"] == [
        {
            "name": "hovering [40 %]",
            "test": "hovering",
            "row": 1,
            "at": {"file": "tests/yard.rts", "start": row, "end": row + 50, "line": 7, "column": 5},
            "policy": "yard@1",
            "skill": "hover",
            "met": True,
            "expected": {"outcome": "deny", "target": None, "reason": "authority/out-of-scope", "clause": None},
            "decided": {
                "outcome": "deny",
                "target": None,
                "reason": "authority/out-of-scope",
                "clause": "permit hover by role operator through agent when battery > 50 %",
                "written": {"file": "policy.rts", "start": start, "end": start + 64, "line": 7, "column": 3},
            },
        }
    ]
    assert found["coverage"] is None


def test_coverage_lists_undecided_clauses(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "--coverage")
    assert code == ExitCode.OK
    assert "coverage of yard@1 on quad: " in out
    lines = out.splitlines()
    forbid = lines.index("  policy.rts:9  forbid hover by any when battery > 90 %")
    assert lines[forbid + 1] == "      never true, never decided"  # it was unknown, and the permit decided
    assert not any("permit hover" in line for line in lines)
    assert any(line.endswith("never decided: no test would detect a change of them") for line in lines)


def test_coverage_as_json(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, found = answer(capsys, "--coverage")
    (policy,) = found["coverage"]["policies"]
    permit = policy["clauses"][0]
    assert (policy["policy"], policy["vehicle"], policy["decisions"]) == ("yard", "quad", 4)
    assert permit["reached"] == {"true": 1, "false": 1, "unknown": 1, "decided": 1}
    assert (permit["missing"], permit["impossible"], permit["at"]["line"]) == ([], [], 7)
    reached = [count for clause in policy["clauses"] for count in clause["reached"].values()]
    assert policy["covered"] == sum(count > 0 for count in reached)
    assert policy["total"] == len(reached)
    assert policy["per_mille"] == policy["covered"] * 1000 // policy["total"]


def test_a_policy_that_no_test_is_under_counts(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = POLICY[: POLICY.index("nominal")].replace("policy yard", "policy idle")
    put("other.rts", other)
    _, found = answer(capsys, "--coverage")
    by_name = {each["policy"]: each for each in found["coverage"]["policies"]}
    assert (by_name["idle"]["covered"], by_name["idle"]["decisions"]) == (0, 0)
    assert by_name["idle"]["total"] == by_name["yard"]["total"]


def test_a_policy_with_errors_is_not_passed_over(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put("other.rts", POLICY[: POLICY.index("nominal")].replace("policy yard", "policy idle").replace("50 %", "50 m"))
    code, found = answer(capsys, "--coverage")
    assert code == ExitCode.DIAGNOSTICS
    assert [each["at"]["file"] for each in found["diagnostics"]] == ["other.rts"]


@pytest.mark.parametrize(("least", "code"), [("0", ExitCode.OK), ("40", ExitCode.OK), ("100", ExitCode.TESTS)])
def test_a_threshold(here: Path, capsys: pytest.CaptureFixture[str], least: str, code: ExitCode) -> None:
    ended, found = answer(capsys, "--fail-under", least)
    assert (ended, found["coverage"]["enough"]) == (code, code is ExitCode.OK)


def test_a_threshold_of_the_configuration(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put("rtshcua.toml", "[test]\nfail-under = 100\n")
    code, out, _ = run(capsys)
    assert code == ExitCode.TESTS
    assert re.match(r"coverage is \d+\.\d %, below the required 100 % \(", out.splitlines()[-1])
    assert run(capsys, "tests/yard.rts")[0] == ExitCode.OK, "a file alone was not to cover all"
    assert run(capsys, "-k", "HOME")[0] == ExitCode.OK
    assert run(capsys, "--isolated")[0] == ExitCode.OK
    assert run(capsys, "--fail-under", "1")[0] == ExitCode.OK
    put("rtshcua.toml", '[test]\nexclude = ["tests/**"]\n')
    assert run(capsys)[0] == ExitCode.TESTS
    assert run(capsys, "tests/yard.rts")[0] == ExitCode.OK
    put("rtshcua.toml", "[test]\nfail-under = 101\n")
    assert run(capsys)[0] == ExitCode.INPUT


def test_junit_has_a_case_each_and_the_coverage(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put("policy.rts", POLICY.replace("> 50 %", "> 70 %"))
    code, _, _ = run(capsys, "--junit", "out.xml", "--coverage")
    assert code == ExitCode.TESTS
    root = ElementTree.parse("out.xml").getroot()
    assert (root.get("tests"), root.get("failures")) == ("4", "1")
    names = [case.get("name") for case in root.iter("testcase")]
    assert names == ["hovering [60 %]", "hovering [40 %]", "hovering [unknown]", "coming home"]
    times = [float(case.get("time", "0")) for case in root.iter("testcase")]
    assert min(times) > 0
    assert float(root.get("time", "0")) >= max(times)
    properties = [each.get("name") for each in root.iter("property")]
    assert properties[0] == "coverage yard@1"
    assert "never decided yard@1" in properties
    (failure,) = root.iter("failure")
    assert failure.get("type") == "E1411"


def test_errors_in_sources_end_otherwise_and_others_are_run(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put("broken.rts", 'test "x" {')
    code, out, err = run(capsys)
    assert code == ExitCode.DIAGNOSTICS
    assert "error[E0102]" in err
    assert "2 tests, 4 cases: all passed" in out


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["missing.rts"], ExitCode.INPUT),
        (["empty"], ExitCode.INPUT),
        (["binary.rts"], ExitCode.DIAGNOSTICS),
        (["--fail-under", "101"], ExitCode.USAGE),
        (["--force"], ExitCode.USAGE),
        (["--junit", "no/folder/out.xml"], ExitCode.INPUT),
        (["--config", "missing.toml"], ExitCode.INPUT),
        (["--generate", "--policy", "yrad"], ExitCode.USAGE),
        (["--generate", "policy.rts", "--skill", "fly"], ExitCode.USAGE),
        (["--generate", "policy.rts", "--nominal", "night"], ExitCode.USAGE),
        (["--generate", "policy.rts", "-o", "policy.rts"], ExitCode.USAGE),
        (["mission.json"], ExitCode.USAGE),
    ],
)
def test_bad_input(here: Path, capsys: pytest.CaptureFixture[str], words: list[str], code: ExitCode) -> None:
    Path("empty").mkdir()
    Path("binary.rts").write_bytes(b"\xff\xfe\x00")
    Path("mission.json").write_text("{}", encoding="utf-8")
    paths = [] if any(word.endswith((".rts", ".json")) or word == "empty" for word in words) else ["tests"]
    ended, _, err = run(capsys, *words, *paths)
    assert ended == code
    assert "Traceback" not in err
    assert err


def test_ctrl_c(here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(running, "run_case", interrupted)
    code, _, err = run(capsys)
    assert (code, err) == (ExitCode.INTERRUPTED, "error: interrupted\n")


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="no pipes of this kind")
def test_a_reader_that_left(here: Path) -> None:
    command = [sys.executable, "-m", "rtshcua", "test"]
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "wb") as closed:
        ended = subprocess.run(command, stdout=closed, stderr=subprocess.PIPE, check=False)
    assert (ended.returncode, ended.stderr) == (ExitCode.FULL, b"")


def test_unknown_path_suggests_a_file_and_the_k_option(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests/charge.rts").write_text("")
    assert app.main(["test", "charg"]) == ExitCode.INPUT
    said = capsys.readouterr().err
    assert "no such file or directory: `charg`" in said
    assert "did you mean `tests/charge.rts`? `-k charg` chooses tests by name" in said
    assert app.main(["test", "hovering"]) == ExitCode.INPUT
    said = capsys.readouterr().err
    assert "did you mean" not in said
    assert "`-k hovering` chooses tests by name" in said
