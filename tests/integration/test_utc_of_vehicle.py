"""If the kernel does not confirm this machine's clock, the vehicle's time of day bounds it, or it is unknown."""

import json
from typing import Any

import pytest

from rtshcua.adapters import utc
from rtshcua.app.fly import connect
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main


def rehearsal(ground: Any, capfd: Any, port: int, *words: str) -> dict[str, Any]:
    """What a rehearsal on a vehicle that lives as fast as we do says."""
    code = main(
        [
            "run", ground.bundle(), "--connect", f"udpin:127.0.0.1:{port}", "--vehicle", "quad-07", "--dry-run",
            "--json", *words,
        ]
    )  # fmt: skip
    out, err = capfd.readouterr()
    assert code in (ExitCode.OK, ExitCode.REFUSED), err
    told: dict[str, Any] = json.loads(out)
    return told


def rehearsed(ground: Any, capfd: Any, port: int, *words: str) -> dict[str, Any]:
    """What it says of the first step of a flight that is decided in one process."""
    step: dict[str, Any] = rehearsal(ground, capfd, port, "--mode", "software", *words)["steps"][0]
    return step


@pytest.fixture(autouse=True)
def unsynchronised(ground: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ground.folder)
    monkeypatch.setattr(utc, "kernel_error_us", lambda: None)


@pytest.mark.slow
def test_vehicle_time_bounds_the_clock_error(ground: Any, capfd: Any, port: int) -> None:
    """ArduCopter tells it when it is asked."""
    ground.vehicle(port, 1, "--flavour", "ardupilot")
    step = rehearsed(ground, capfd, port)
    assert step["outcome"] == "allow", step


@pytest.mark.slow
def test_freshness_is_unknown_without_a_clock_bound(
    ground: Any, capfd: Any, port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connect, "UTC_S", 0.5)
    ground.vehicle(port, 1, "--flavour", "ardupilot", "--fault", "mute,at=0s,message=SYSTEM_TIME")
    step = rehearsed(ground, capfd, port)
    assert (step["outcome"], step["reason"]) == ("defer", "freshness/clock-uncertain"), step
    assert rehearsed(ground, capfd, port, "--utc-error", "200ms")["outcome"] == "allow"


@pytest.mark.slow
def test_rehearsal_uses_the_clock_of_the_flights_boundary(ground: Any, capfd: Any, port: int) -> None:
    """Apart from the run, the boundary believes the vehicle's time over a link with a key alone."""
    ground.vehicle(port, 1, "--flavour", "ardupilot")
    told = rehearsal(ground, capfd, port, "--mode", "process")
    step = told["steps"][0]
    assert (step["outcome"], step["reason"]) == ("defer", "freshness/clock-uncertain"), step
    assert told["exit_code"] == ExitCode.REFUSED
    assert any("`--utc-error 500ms`" in note and "`--signing-key`" in note for note in told["notes"]), told["notes"]
    stated = rehearsal(ground, capfd, port, "--mode", "process", "--utc-error", "500ms")
    assert stated["steps"][0]["outcome"] == "allow", stated
    assert not any("--utc-error" in note for note in stated["notes"])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--utc-error", "soon", "--connect", "udpin:127.0.0.1:1", "--vehicle", "quad-07"], "is not a duration"),
        (["--utc-error", "1s"], "requires `--connect`"),
    ],
)
def test_invalid_clock_bound_is_refused(ground: Any, capfd: Any, words: list[str], said: str) -> None:
    assert main(["run", ground.bundle(), *words]) == ExitCode.USAGE
    assert said in capfd.readouterr().err
