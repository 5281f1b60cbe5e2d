"""`rtshcua run --scenario` injects the scenario's faults into a run in real time."""

from pathlib import Path
from typing import Any

import pytest

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app

FIELD = Path(__file__).parents[1] / "campaign" / "field.rts"
SOURCE = """import "field.rts"

scenario "somebody else flies" {
  flies  round_the_barn
  aboard px4
  1 s after takeoff pilot_mode(mode = position)
  expect ends stood_down
  expect never hover
  expect flies hover
}
"""


def test_run_applies_a_scenario_and_reports_its_expectations(ground: Any, capsys: pytest.CaptureFixture[str]) -> None:
    (ground.folder / "field.rts").write_text(FIELD.read_text())
    (ground.folder / "flights.rts").write_text(SOURCE)
    made = ground.folder / "field.bundle"
    assert app.main(["compile", str(FIELD), "-o", str(made)]) == ExitCode.OK, capsys.readouterr()
    run = ground.run(made.name, "--scenario", "flights.rts").end()
    assert run.code == ExitCode.TESTS, run.stderr
    assert run.log()[-1]["ending"] == "stood-down"
    notes = [event["text"] for event in run.events if event["event"] == "note"]
    (happened,) = [text for text in notes if text.startswith("the scenario: ")]
    assert happened.endswith("1 s after takeoff pilot_mode(mode = position)")
    assert [text for text in notes if text.startswith(("met: ", "NOT MET: "))] == [
        "met: expect ends stood_down: the run ended with `stood-down`",
        "met: expect never hover: flown skills: takeoff",
        "NOT MET: expect flies hover: flown skills: takeoff",
    ]
