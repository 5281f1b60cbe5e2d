"""`rtshcua test --generate`: the written file, its place, and that it passes."""

import json
from pathlib import Path

import pytest

from reference.tested import POLICY
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    put("policy.rts", POLICY)
    (tmp_path / "tests").mkdir()
    return tmp_path


def put(name: str, text: str) -> None:
    Path(name).write_text(text, encoding="utf-8")


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    code = app.main(["test", *words])
    out, err = capsys.readouterr()
    return code, out, err


def test_generated_tests_pass_here_and_are_not_written_over(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "--generate", "policy.rts", "-o", "tests/limits.rts")
    assert (code, out) == (ExitCode.OK, "")
    assert "in tests/limits.rts" in err
    text = Path("tests/limits.rts").read_text(encoding="utf-8")
    assert 'import "../policy.rts"' in text
    assert "from noon {" in text  # the nominal that there is
    code, out, _ = run(capsys, "tests/limits.rts", "--coverage", "--json")
    found = json.loads(out)
    assert code == ExitCode.OK
    permit = found["coverage"]["policies"][0]["clauses"][0]
    assert permit["missing"] == []
    assert run(capsys, "--generate", "policy.rts", "-o", "tests/limits.rts")[0] == ExitCode.USAGE
    assert run(capsys, "--generate", "policy.rts", "-o", "tests/limits.rts", "--force")[0] == ExitCode.OK
    assert Path("tests/limits.rts").read_text(encoding="utf-8") == text


def test_generated_tests_on_the_standard_output(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "--generate", "policy.rts", "--skill", "hover")
    assert code == ExitCode.OK
    put("limits.rts", out)
    assert run(capsys, "limits.rts")[0] == ExitCode.OK
    _, described, _ = run(capsys, "--generate", "policy.rts", "--skill", "hover", "--json")
    assert json.loads(described)["text"] == out


def test_generate_requires_an_unambiguous_policy(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put("other.rts", POLICY[: POLICY.index("nominal")].replace("policy yard", "policy idle"))
    code, _, err = run(capsys, "--generate", "policy.rts", "other.rts")
    assert code == ExitCode.USAGE
    assert "`yard`, `idle`" in err
    assert run(capsys, "--generate", "policy.rts", "other.rts", "--policy", "idle")[0] == ExitCode.OK


def test_unreached_limits_are_reported_in_file_stderr_and_json(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put("policy.rts", POLICY.replace("battery > 90 %", "battery > 90 % and battery < 80 %"))
    _, out, err = run(capsys, "--generate", "policy.rts", "--skill", "hover")
    words = "hover: forbid: forbid hover by any when battery > 90 % and battery < 80 %: `battery`"
    assert f"not reached: {words}" in err
    assert f"// - {words}" in out
    _, described, _ = run(capsys, "--generate", "policy.rts", "--skill", "hover", "--json")
    found = json.loads(described)["unreached"]
    told = {"skill": "hover", "role": "forbid", "text": words.split(": ")[2], "about": "`battery`", "turned": False}
    assert told in found


def test_no_role_is_invented_where_the_policy_names_one(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put(
        "own.rts",
        'import "lib:policies/site.rts"\nimport "lib:skills/takeoff.rts"\nimport "lib:skills/return_home.rts"\n'
        'import "lib:skills/emergency_land.rts"\nrole pilot\npolicy own version 1 {\n  permit takeoff by role pilot\n'
        "  permit return_home, emergency_land by any\n  contingency return_home, emergency_land\n}\n",
    )
    code, out, _ = run(capsys, "--generate", "own.rts")
    assert code == ExitCode.OK
    assert "role pilot" in out
    assert "role operator" not in out
