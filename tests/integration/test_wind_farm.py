"""The wind farm of `examples`: several missions, with shifts, approvals and towers as exclusion zones."""

import re
import shlex
from pathlib import Path

import pytest

from rtshcua.app.programs import read_sources
from rtshcua.app.testing.run import ISSUED_AT_US
from rtshcua.campaign.rounds import FlownMission
from rtshcua.diagnostics.diagnostic import has_errors
from rtshcua.front.cli import app
from rtshcua.front.cli.table import COMMANDS
from rtshcua.ground.pipeline.suite import scenarios
from rtshcua.ground.testing.scenario_lowering import ScenarioFlight
from rtshcua.mavlink import dialect
from rtshcua.virtual import development_keys
from rtshcua.virtual.expectations import expectations
from rtshcua.virtual.flight import LATER_US
from rtshcua.virtual.judge import judge

FARM = Path(__file__).resolve().parents[2] / "examples" / "wind_farm"
FLIGHTS = re.findall(r'(?m)^scenario "(.*)"', (FARM / "tests" / "flights.rts").read_text(encoding="utf-8"))


@pytest.fixture
def farm(monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(FARM)
    return FARM


def flight(name: str) -> ScenarioFlight:
    found = scenarios(read_sources([Path("tests/flights.rts")]).program, dialect.load(), ISSUED_AT_US, LATER_US)
    assert not has_errors(found.diagnostics)
    return next(each for each in found.found if each.scenario.name == name)


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
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
@pytest.mark.parametrize("name", FLIGHTS)
def test_scenarios_fly_as_expected(farm: Path, name: str, flavour: str) -> None:
    chosen = flight(name)
    assert flavour in chosen.scenario.flavours
    policy, start = chosen.policy.lowered.policy, chosen.scenario.start
    assert start.utc_us is not None
    mission = development_keys.flies_at(chosen.mission, start.utc_us)
    was = FlownMission.of(policy, mission, mission.issued_at_us).flown(chosen.scenario, flavour, 1)
    verdict = judge(was)
    assert verdict.failures == ()
    assert [each.found for each in expectations(was, verdict) if not each.met] == []


def test_page_names_existing_commands_and_sources() -> None:
    page = (FARM / "README.md").read_text(encoding="utf-8")
    lines = [shlex.split(line, comments=True) for line in page.splitlines() if line.startswith("rtshcua ")]
    assert len(lines) > 12
    assert {words[1] for words in lines} <= {command.name for command in COMMANDS}
    for path in (word for words in lines for word in words if word.endswith(".rts")):
        assert (FARM / path).is_file(), path
