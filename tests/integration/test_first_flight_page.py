"""docs/flying/first-flight.md: its sources compile, its commands exist, and its statements about the bench are true."""

import re
import shlex
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from rtshcua.adapters.qualification.sortie import SORTIES
from rtshcua.app.programs import compile_sources
from rtshcua.front.cli.table import find
from rtshcua.virtual.vehicle import VirtualVehicle
from virtual.forked import Forked
from virtual.qualifying import Qualifying

PAGES = Path(__file__).resolve().parents[2] / "docs/flying"
FIRST = (PAGES / "first-flight.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", FIRST, flags=re.DOTALL)


def typed() -> list[str]:
    lines = [line for block in blocks("sh") for line in block.splitlines()]
    return sorted({part.strip() for line in lines for part in line.split("&&") if part.strip().startswith("rtshcua ")})


def test_tether_policy_and_mission_compile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    policy, mission = blocks("rts")
    (tmp_path / "policies").mkdir()
    (tmp_path / "missions").mkdir()
    (tmp_path / "policies/tether.rts").write_text(policy, encoding="utf-8")
    (tmp_path / "missions/tethered.rts").write_text(mission, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    compiled, _ = compile_sources([Path("missions/tethered.rts")], mission=None, issued_at_us=1)
    assert not compiled.diagnostics
    assert compiled.mission is not None


@pytest.mark.slow
def test_commands_of_the_page_fit_its_project(commands: Forked, own_world: None, tmp_path: Path) -> None:
    def typed_here(line: str, where: Path) -> str:
        done = commands.run(shlex.split(line)[1:], where, 60)
        assert done.code == 0, (line, done.out, done.err)
        return done.out

    typed_here("rtshcua init first", tmp_path)
    here = tmp_path / "first"
    site = (here / "site.rts").read_text(encoding="utf-8")
    added = blocks("text")[0]
    assert "brakes" in added
    assert "return" in added
    (here / "site.rts").write_text(
        re.sub(r"(?m)^  home .*$", lambda home: f"{home[0]}\n{added}", site), encoding="utf-8"
    )
    for path, source in zip(("policies/tether.rts", "missions/tethered.rts"), blocks("rts"), strict=True):
        (here / path).write_text(source, encoding="utf-8")
    for line in ("rtshcua test --generate policies/tether.rts -o tests/tether.rts", "rtshcua test ."):
        assert line in typed()
        typed_here(line, here)
    missions = {word for line in typed() for word in shlex.split(line) if word.startswith("missions/")}
    assert all((here / word).with_suffix(".rts").is_file() for word in missions)
    called = {word for line in typed() for word in re.findall(r"--vehicle (\S+)", line)}
    for source in sorted({(here / word).with_suffix(".rts") for word in missions}):
        compiled, _ = compile_sources([source], mission=None, issued_at_us=1)
        assert compiled.policy is not None
        assert called == {compiled.policy.vehicle.identity}


@pytest.mark.parametrize("line", typed())
def test_commands_of_the_page_run_as_written(line: str) -> None:
    _, name, *words = shlex.split(line)
    row = find(name)
    assert row is not None, name
    command: Any = get_command(import_module(row.module).app)
    if hasattr(command, "commands"):
        verb, *words = words
        command = command.commands[verb]
    command.make_context(name, words)


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_bench_flight_without_propellers_lands_and_disarms(flavour: str) -> None:
    def without_propellers(vehicle: VirtualVehicle) -> None:
        body = vehicle.simulation._autopilot.vehicle
        body._lift_off = lambda: setattr(body, "_lifting_s", float("inf"))  # type: ignore[method-assign]

    flown = Qualifying(flavour, without_propellers).sortie(SORTIES[0])
    takeoff, landing = flown.commands
    assert (flown.ending, flown.down) == ("aborted", True)
    assert 8_000_000 <= (takeoff.ended_us or 0) - takeoff.begun_us <= 10_500_000
    assert landing.skill == "emergency_land"
