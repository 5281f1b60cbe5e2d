"""The wind farm of `examples`: several missions, with shifts, approvals and towers as exclusion zones."""

import re
import shlex
from pathlib import Path

import pytest

from rtshcua.front.cli import app
from rtshcua.front.cli.table import COMMANDS
from virtual.examples import failures_of, flights_of

FARM = Path(__file__).resolve().parents[2] / "examples" / "wind_farm"
FLIGHTS = FARM / "tests" / "flights.rts"


@pytest.fixture
def farm(monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(FARM)
    return FARM


@pytest.mark.slow
def test_example_passes_check_with_high_coverage(farm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["check", "missions"]) == 0, capsys.readouterr().err
    assert app.main(["test", "--coverage", "--fail-under", "90", "tests/farm.rts"]) == 0, capsys.readouterr().out


def test_substation_flight_depends_on_the_day(farm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def codes(when: str) -> set[str]:
        app.main(["check", "--at", when, "missions/substation.rts"])
        return set(re.findall(r"error\[(E\d+)\]", capsys.readouterr().err))

    assert codes("2026-11-28T09:00:00Z") == set()
    assert codes("2026-11-30T09:00:00Z") == {"E0508"}  # a working day
    assert codes("2026-11-29T09:00:00Z") == {"E0718"}  # nobody is on shift


def test_every_tower_is_an_exclusion_zone(farm: Path) -> None:
    policy = (farm / "policies" / "farm.rts").read_text(encoding="utf-8")
    (airspace,) = re.findall(r"(?m)^  airspace .*$", policy)
    assert re.findall(r"tower_\d", airspace) == [f"tower_{number}" for number in range(1, 7)]


@pytest.mark.soak  # each takes as long as ten tests
@pytest.mark.parametrize(("name", "flavour"), flights_of(FLIGHTS))
def test_scenarios_fly_as_expected(farm: Path, name: str, flavour: str) -> None:
    assert failures_of(FLIGHTS, name, flavour) == []


def test_page_names_existing_commands_and_sources() -> None:
    page = (FARM / "README.md").read_text(encoding="utf-8")
    lines = [shlex.split(line, comments=True) for line in page.splitlines() if line.startswith("rtshcua ")]
    assert len(lines) > 12
    assert {words[1] for words in lines} <= {command.name for command in COMMANDS}
    for path in (word for words in lines for word in words if word.endswith(".rts")):
        assert (FARM / path).is_file(), path
