"""`rtshcua test` with scenarios: each flight is flown, judged, compared with its expectations, and reported."""

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from rtshcua.app.testing import flying
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app
from rtshcua.ground.testing.reporting import FlightFailure, FlightResult

SOURCE = """import "lib:missions/short.rts"

scenario "a dropout on the way" {
  flies  short
  aboard px4
  start  battery = 90 %
  2 s after hover link_silence(for = 2 s)
  expect ends completed
  expect flies return_home
  expect never emergency_land
}

scenario "too little charge" {
  flies  short
  aboard ardupilot
  after hover battery(level = 25 %)
  expect ends completed
  expect fallback return_home
}
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("flights.rts").write_text(SOURCE)
    return tmp_path


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    code = app.main(["test", *words])
    out, err = capsys.readouterr()
    return code, out, err


@pytest.mark.slow
def test_scenarios_are_flown(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "--coverage", "--junit", "report.xml", "-v")
    assert code == ExitCode.TESTS
    assert "  ok    a dropout on the way (1 flight)\n      1 completed\n" in out
    assert "  FAIL  too little charge (1 of 1 flight)\n      1 aborted\n" in out
    assert "2 scenarios, 2 flights: 1 failed\n" in out
    assert err.startswith("error[E1610]: on ardupilot with seed 1: ")
    assert "  = help: before it ended as `aborted`: " in err
    assert "battery(level = 25 %)" in err
    assert "17 |   expect ends completed\n" in err.replace("\x1b", "")
    assert "coverage of training_field@2 on quad: " in out
    suite = ElementTree.parse("report.xml").getroot()
    assert [len(case) for case in suite.iter("testcase")] == [0, 1]
    assert all(float(case.get("time", "0")) > 0.01 for case in suite.iter("testcase")), "a flight takes its time"


@pytest.mark.slow
def test_reference_scenario_meets_its_expectations(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = (Path(__file__).parents[4] / "docs" / "language.md").read_text(encoding="utf-8")
    example = page.split("## Scenarios\n\n```rts\n")[1].split("```")[0]
    fewer = example.replace("aboard px4, ardupilot", "aboard px4").replace("seeds  1 .. 20", "seeds  3")
    assert fewer.count("aboard px4 ") == fewer.count("seeds  3 ") == 1
    Path("flights.rts").write_text(fewer)
    code, out, err = run(capsys)
    assert (code, err) == (ExitCode.OK, "")
    assert "1 scenario, 1 flight: all passed\n" in out


def test_only_those_that_are_chosen_are_flown(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "-k", "DROPOUT")
    assert (code, err) == (ExitCode.OK, "")
    assert out.splitlines() == [
        "flights.rts", "  ok    a dropout on the way (1 flight)", "1 scenario, 1 flight: all passed; 1 case not chosen"
    ]  # fmt: skip


@pytest.fixture
def not_flown(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every third seed fails in two ways."""

    def fly(_: Any, flight: Any) -> FlightResult:
        wrong = (
            FlightFailure(0, "expectation", "it ended as `aborted`"),
            FlightFailure(-1, "collision", "it hit <something>"),
        )
        found = wrong if flight.seed % 3 == 0 else ()
        return FlightResult(
            flight.number, flight.flavour, flight.seed, "aborted", found, ("late: wind",), ("3.00 s x",), ()
        )

    monkeypatch.setattr(flying.ScenarioTrial, "fly", fly)
    monkeypatch.setattr(flying, "cores", lambda: 1)


@pytest.mark.usefixtures("not_flown")
def test_repeated_failure_is_reported_once(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("flights.rts").write_text(SOURCE.replace("aboard px4", "aboard px4, ardupilot\n  seeds  1 .. 6"))
    code, out, err = run(capsys, "-k", "dropout", "--json")
    assert (code, err) == (ExitCode.TESTS, "")
    found = json.loads(out)
    (scenario,) = found["scenarios"]
    assert (scenario["name"], scenario["mission"], scenario["met"]) == ("a dropout on the way", "short", False)
    assert scenario["endings"] == {"aborted": 12}
    assert [(each["flavour"], each["seed"]) for each in scenario["flights"]][:3] == [
        ("px4", 1), ("ardupilot", 1), ("px4", 2)
    ]  # fmt: skip
    assert scenario["flights"][4]["wrong"][1] == {"slug": "collision", "text": "it hit <something>"}
    assert [each["message"] for each in found["diagnostics"]] == [
        "on px4 with seed 3, and in 3 more of 12 flights: `collision`: it hit <something>",
        "on px4 with seed 3, and in 3 more of 12 flights: it ended as `aborted`, which was not expected",
    ]
    assert [each["at"]["line"] for each in found["diagnostics"]] == [3, 9]


def test_a_source_with_errors_flies_nothing(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("flights.rts").write_text(SOURCE.replace("flies  short", "flies  shrot", 1))
    code, out, err = run(capsys)
    assert code == ExitCode.DIAGNOSTICS
    assert "did you mean `short`?" in err
    assert "no test was run: the sources have errors" in out
