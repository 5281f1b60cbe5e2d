"""docs/flying/first-flight.md: its sources compile, its commands are commands, and what it says of the bench is so."""

import re
import shlex
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from rtshcua.adapters.qualification.sortie import SORTIES
from rtshcua.cli.sources import compile_sources
from rtshcua.cli.table import find
from rtshcua.virtual.vehicle import VirtualVehicle
from virtual.qualifying import Qualifying

PAGES = Path(__file__).resolve().parents[2] / "docs/flying"
FIRST = (PAGES / "first-flight.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", FIRST, flags=re.DOTALL)


def commands() -> list[str]:
    lines = [line for block in blocks("sh") for line in block.splitlines()]
    return sorted({part.strip() for line in lines for part in line.split("&&") if part.strip().startswith("rtshcua ")})


def test_the_tethers_policy_and_mission_compile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    policy, mission = blocks("rts")
    (tmp_path / "policies").mkdir()
    (tmp_path / "missions").mkdir()
    (tmp_path / "policies/tether.rts").write_text(policy, encoding="utf-8")
    (tmp_path / "missions/tethered.rts").write_text(mission, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    compiled, _ = compile_sources([Path("missions/tethered.rts")], mission=None, issued_at_us=1)
    assert not compiled.diagnostics
    assert compiled.mission is not None


@pytest.mark.parametrize("line", commands())
def test_each_command_is_typed_as_it_is(line: str) -> None:
    _, name, *words = shlex.split(line)
    row = find(name)
    assert row is not None, name
    command: Any = get_command(import_module(row.module).app)
    if hasattr(command, "commands"):
        verb, *words = words
        command = command.commands[verb]
    command.make_context(name, words)


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_without_propellers_it_is_told_to_land_and_disarms(flavour: str) -> None:
    def without_propellers(vehicle: VirtualVehicle) -> None:
        body = vehicle.simulation._autopilot.vehicle
        body._lift_off = lambda: setattr(body, "_lifting_s", float("inf"))  # type: ignore[method-assign]

    flown = Qualifying(flavour, without_propellers).sortie(SORTIES[0])
    takeoff, landing = flown.commands
    assert (flown.ending, flown.down) == ("aborted", True)
    assert 8_000_000 <= (takeoff.ended_us or 0) - takeoff.begun_us <= 10_500_000
    assert landing.skill == "emergency_land"
