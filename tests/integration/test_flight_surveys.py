"""Surveys with cameras fly on both simulated autopilots: over a field, along a road and a wall, around a tower."""

from pathlib import Path

import pytest

from reference.mapping import SCAN, SIDEWAYS, program
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app

FLIES = """
scenario "it flies" {
  flies  flight
  aboard px4, ardupilot
  start  wind(speed = 2 m/s)
  expect ends completed
  expect never emergency_land
}
"""
LESS = ("energy   at most 35 %", "energy   at most 25 %")
NEXT = "look(field, 50 m)"


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        [LESS, (NEXT, f"{NEXT}\n    look(road, 50 m, pattern = corridor)")],
        [LESS, *SIDEWAYS, ("15 m", "14 m"), ("40 m .. highest", "10 m .. highest"),
         (NEXT, "look(tower, 20 m, pattern = around)\n    look(wall, 20 m)")],
        [LESS, *SCAN, ("altitude in 10 m .. highest", "altitude in 10 m .. 30 m"),
         (NEXT, "look(tower, 12 m, 19 m, pattern = around)\n    look(wall, 12 m, 19 m)")],
    ],
    ids=["down", "sideways", "scan"],
)  # fmt: skip
def test_surveys_with_cameras_are_flown(
    changes: list[tuple[str, str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("map.rts").write_text(program(*changes) + FLIES, encoding="utf-8")
    assert app.main(["check", "map.rts"]) == ExitCode.OK, capsys.readouterr().err
    assert app.main(["test", "map.rts"]) == ExitCode.OK, capsys.readouterr().err
    assert "1 scenario, 2 flights: all passed" in capsys.readouterr().out
