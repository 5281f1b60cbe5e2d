"""Incidents of a scenario in one run: allowed runs, times and reports."""

from pathlib import Path
from typing import Any

import msgspec
import pytest

from reference.flying import refusal_of
from rtshcua.adapters.simulator import SimulatorError
from rtshcua.app.fly.incidents import Incidents, plan_incidents
from rtshcua.decision.prepare import PreparedPolicy, prepare
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.scenario_option import chosen
from rtshcua.model.flat.situation import Now

S = 1_000_000
ISSUED_US = 1_780_300_800 * S
SOURCE = """import "lib:missions/short.rts"

scenario "gusts and a lost fix" {
  flies  short
  start  battery = 80 %, wind(speed = 3 m/s, from = 270 deg)
  at 2 s gps_loss(for = 1 s)
  at 1 s link_silence(for = 2 s)
  expect ends completed
}

scenario "killed" {
  flies  short
  at 4 s runtime_killed(for = 2 s)
  expect ends aborted
}

scenario "at its own time" {
  flies  short
  aboard px4
  start  at "2026-06-01T08:00:00Z"
  expect ends completed
}
"""


class Vehicle:
    """A vehicle that records its commands; `gone`: it no longer listens."""

    def __init__(self, *, gone: bool = False) -> None:
        self.told: list[str] = []
        self.gone = gone

    def inject(self, fault: str) -> None:
        if self.gone:
            raise SimulatorError("the simulated vehicle ended: broken pipe")
        self.told.append(fault)


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "flights.rts"
    path.write_text(SOURCE)
    return path


def incidents(source: Path, name: str, **options: str | int | None) -> Incidents:
    found = planned(source, name, **options)
    assert isinstance(found, Incidents)
    return found


def planned(source: Path, name: str, **options: Any) -> Incidents | Refusal:
    flight = chosen(f"{source}:{name}" if name else str(source), ISSUED_US)
    if isinstance(flight, Refusal):
        return flight
    return plan_incidents(flight, options.get("flavour"), options.get("seed"))


def prepared(source: Path) -> PreparedPolicy:
    flight = chosen(f"{source}:killed", ISSUED_US)
    assert not isinstance(flight, Refusal)
    made = prepare(flight.policy.lowered.policy)
    assert isinstance(made, PreparedPolicy)
    return made


def refused(source: Path, name: str, **options: str | int | None) -> str:
    found = refusal_of(planned(source, name, **options))
    assert found.code == ExitCode.USAGE
    return found.text


def test_start_conditions_are_passed_to_the_simulator(source: Path) -> None:
    assert incidents(source, "gusts and a lost fix", seed=9).options == [
        "--flavour", "px4", "--seed", "9", "--estimate", "real", "--battery", "80", "--wind", "3,270,0",
    ]  # fmt: skip


def test_missing_scenario_file_is_bad_input(source: Path) -> None:
    source.rename(source.with_name("flight.rts"))
    found = refusal_of(planned(source, ""))
    assert (found.code, found.text) == (
        ExitCode.INPUT,
        f"cannot read `{source}`: no such file",
    )


def test_unsupported_incident_is_refused_by_name(source: Path) -> None:
    assert "`at 4 s runtime_killed(for = 2 s)` can be injected in virtual time only" in refused(source, "killed")
    assert "the scenario sets its start time" in refused(source, "at its own time")
    assert "no scenario `nobody`" in refused(source, "nobody")
    assert "3 scenarios" in refused(source, "")


def test_incident_starts_at_its_scheduled_time(source: Path) -> None:
    made, vehicle = incidents(source, "gusts and a lost fix"), Vehicle()
    made.begin(prepared(source), chosen(f"{source}:killed", ISSUED_US).mission, vehicle)  # type: ignore[arg-type]
    turns: list[int] = []
    watch = made.around(lambda now, _, __: turns.append(now.monotonic_us), 100 * S)
    for at_us in (100 * S, 101 * S - 1, 101 * S, 102 * S + 1):
        watch(Now(at_us, ISSUED_US, 0), [], [])
        if at_us < 101 * S:
            assert vehicle.told == []
    assert [each.split(",")[0] for each in vehicle.told] == ["link-silence", "gps-loss"]
    assert made.happened == ["1.00 s: at 1 s link_silence(for = 2 s)", "2.00 s: at 2 s gps_loss(for = 1 s)"]
    assert len(turns) == 4


def test_a_vehicle_that_is_gone_does_not_end_the_run(source: Path) -> None:
    made, vehicle = incidents(source, "gusts and a lost fix"), Vehicle(gone=True)
    made.begin(prepared(source), chosen(f"{source}:killed", ISSUED_US).mission, vehicle)  # type: ignore[arg-type]
    made.around(lambda *_: None, 0)(Now(1 * S, ISSUED_US, 0), [], [])
    assert made.happened == ["1.00 s: at 1 s link_silence(for = 2 s): the simulated vehicle ended: broken pipe"]


def test_another_mission_than_the_scenarios_is_refused(source: Path) -> None:
    made, mission = incidents(source, "gusts and a lost fix"), chosen(f"{source}:killed", ISSUED_US).mission
    first, *others = mission.invocations
    higher = msgspec.structs.replace(first, arguments=(first.arguments[0] + 1, *first.arguments[1:]))
    for wrong in (
        msgspec.structs.replace(mission, name="long"),
        msgspec.structs.replace(mission, invocations=tuple(others)),
        msgspec.structs.replace(mission, invocations=(higher, *others)),
    ):
        found = made.begin(prepared(source), wrong, Vehicle())  # type: ignore[arg-type]
        assert "flies another mission" in refusal_of(found).text
