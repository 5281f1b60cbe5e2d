"""`--set` gives a mission its values; `check` and `compile` print its upper bounds."""

import json
from pathlib import Path

import pytest

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main

AT = ["--at", "2026-01-31T08:00:00Z"]
LOOK = """
import "lib:policies/bridge_inspection.rts"

mission look(over: zone = bridge_a, top: altitude in 10 m .. 25 m) under bridge_inspection@7 on quad {
  proposed by agent openclaw for role operator
  phase departure  { takeoff(altitude = top) }
  phase inspection { repeat 2 { goto(over.entry, altitude = top) } }
  phase recovery   { return_home() }
}
"""


@pytest.fixture
def look(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Path:
    monkeypatch.chdir(tmp_path)
    assert main(["keys", "init"]) == ExitCode.OK
    capsys.readouterr()
    (tmp_path / "look.rts").write_text(LOOK, encoding="utf-8")
    return tmp_path


def test_the_values_are_seen_in_each_step(look: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compile", "look.rts", "--set", "over=bridge_b", "--set", "top=12 m", *AT]) == ExitCode.OK
    out = capsys.readouterr().out
    assert "at most 4 steps, " in out
    assert main(["show", "look.bundle"]) == ExitCode.OK
    shown = capsys.readouterr().out
    assert "takeoff(altitude = 12 m)" in shown
    assert shown.count("altitude = 12 m") == 3
    assert (look / "look.bundle").is_file()


def test_other_values_give_another_bundle_under_the_same_policy(look: Path, capsys: pytest.CaptureFixture[str]) -> None:
    digests = set()
    for number, top in enumerate(("11 m", "12 m")):
        target = f"{number}.bundle"
        assert main(["compile", "look.rts", "--set", f"top={top}", "-o", target, "--json", *AT]) == ExitCode.OK
        found = json.loads(capsys.readouterr().out)
        digests.add(found["bundle"]["digest"])
        assert set(found["bounds"]) == {"invocations", "time_us", "energy", "steps"}
        assert found["bounds"]["invocations"] == 4
    assert len(digests) == 2


def test_a_value_that_is_missing_or_wrong_is_a_finding(look: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compile", "look.rts", *AT]) == ExitCode.DIAGNOSTICS
    assert "compile it with `--set top=...`" in capsys.readouterr().err
    assert main(["compile", "look.rts", "--set", "top=30 m", *AT]) == ExitCode.DIAGNOSTICS
    said = capsys.readouterr().err
    assert "E0605" in said
    assert "--> --set:1:5" in said
    assert not (look / "look.bundle").exists()


def test_check_needs_no_values_and_tells_the_bounds(look: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "look.rts"]) == ExitCode.OK
    assert "look: at most 4 steps, " in capsys.readouterr().out
    assert main(["check", "look.rts", "--json"]) == ExitCode.OK
    (mission,) = json.loads(capsys.readouterr().out)["missions"]
    assert (mission["mission"], mission["file"], mission["invocations"]) == ("look", "look.rts", 4)
