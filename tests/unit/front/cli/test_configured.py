"""`--set`: accepted parameters, and errors for others."""

from pathlib import Path

import pytest

from rtshcua.adapters.doctor.diagnosis import MissionVerdict
from rtshcua.adapters.store.vehicle_records import OwedParameters
from rtshcua.app.fly.setting_notes import would_set
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app
from rtshcua.front.cli.commands.doctor import _owed
from rtshcua.front.cli.options.flight_options import settings_of
from rtshcua.mavlink.parameters import value_of
from rtshcua.onboard.enforcement.preparation import SETTABLE, Owed, unsettable
from rtshcua.simulation.process import config_of, main, parser
from virtual.rows import rows

REFUSED = [
    (["FENCE_RADIUS"], "is not NAME=NUMBER"),
    (["FENCE_RADIUS=wide"], "is not NAME=NUMBER"),
    (["FENCE_RADIUS=nan"], "is not NAME=NUMBER"),
    (["FENCE_RADIUS=1e60"], "is not NAME=NUMBER"),
    (["FENCE_RADIUS=5"], "must be from 30 to 10000, not 5"),
    (["ARMING_CHECK=0"], "cannot be set for a flight"),
    (["FENCE_TYPE=3"], "must be 4, 5, 6, 7, 12, 13, 14, 15, not 3"),
    (["GF_ACTION=0"], "must be 2, 3, 5, not 0"),
    (["FENCE_RADIUS=50", "FENCE_RADIUS=60"], "`FENCE_RADIUS` occurs twice"),
]


@pytest.mark.parametrize("command", [["run", "x.bundle"], ["doctor", "--connect", "udpin:127.0.0.1:9"]])
def test_unsettable_parameter_is_refused_first(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    for words, says in REFUSED:
        assert app.main([*command, *(f"--set={word}" for word in words)]) == ExitCode.USAGE
        assert says in capsys.readouterr().err, words


def test_set_requires_a_limited_speed(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["run", "x.bundle", "--set=FENCE_RADIUS=50"]
    assert app.main([*words, "--speed=6"]) == ExitCode.USAGE
    assert "`--set` requires a `--speed` of at most 5" in capsys.readouterr().err
    for more in (["--speed=5"], ["--speed=6", "--dry-run"]):
        assert app.main([*words, *more]) == ExitCode.INPUT, "there is no such bundle"


def test_settable_parameters_are_parsed_as_numbers() -> None:
    read = settings_of(["FENCE_RADIUS=250", "FENCE_ALT_MAX=80.5"])
    assert {name: value_of(bits) for name, bits in read.items()} == {"FENCE_RADIUS": 250.0, "FENCE_ALT_MAX": 80.5}
    assert would_set(read) == [
        "a flight would set FENCE_RADIUS to 250, FENCE_ALT_MAX to 80.5; this rehearsal assumes those values and "
        "sets nothing"
    ]
    assert settings_of(None) == {}
    assert would_set({}) == []


@rows("name", sorted(SETTABLE))
def test_the_bounds_of_each_are_its_own(name: str) -> None:
    accepted = SETTABLE[name]
    low, high = float(accepted[0]), float(accepted[-1])
    for value, good in ((low, True), (high, True), (low - 1, False), (high + 1, False)):
        (bits,) = settings_of([f"{name}={value}"]).values()
        assert (unsettable(name, bits) is None) == good


def test_doctor_reports_parameters_of_an_interrupted_run(tmp_path: Path) -> None:
    debts = OwedParameters(tmp_path, "quad")
    assert _owed(debts) == []
    fifty, wide = settings_of(["A=50"])["A"], settings_of(["A=300"])["A"]
    debts.keep({"FENCE_RADIUS": Owed(fifty, wide)})
    (found,) = _owed(OwedParameters(tmp_path, "quad"))
    assert found.verdict is MissionVerdict.WARN
    assert "FENCE_RADIUS from 300 to 50" in found.found
    (tmp_path / "parameters" / "vehicle-quad").write_text("?")
    (found,) = _owed(OwedParameters(tmp_path, "quad"))
    assert "is damaged" in found.found


def test_simulated_vehicle_takes_parameters(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--port", "9", "--flavour", "ardupilot", "--parameter", "FENCE_RADIUS=50", "--parameter=RTL_ALT=3000"]
    assert config_of(parser().parse_args(words)).parameters == (("FENCE_RADIUS", 50.0), ("RTL_ALT", 3_000.0))
    assert main([*words, "--parameter", "GF_ACTION=1"]) == 2
    assert "this vehicle has no parameter `GF_ACTION`" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        parser().parse_args([*words, "--parameter", "FENCE_RADIUS=wide"])
    assert "is not NAME=VALUE" in capsys.readouterr().err
