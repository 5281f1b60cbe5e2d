"""`rtshcua sim`: the started simulator, and the printed commands."""

import json
import shlex
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import pytest

from rtshcua.adapters.simulator import SimulatorError
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.commands import sim as command
from rtshcua.simulation.config import AutopilotKind
from rtshcua.simulation.process import config_of, parser

KEY = b"shared/traces test key, 32 bytes"


class FakeSimulator:
    """A simulator that records its arguments and ends at once."""

    words: tuple[str, ...] = ()

    def __init__(self, words: list[str]) -> None:
        type(self).words = tuple(words)
        options = parser().parse_args(words)
        self.ready = {"flavour": options.flavour, "system": options.system, "peer": options.port}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None: ...

    def wait(self) -> int:
        raise KeyboardInterrupt


@pytest.fixture(autouse=True)
def process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command, "Simulator", FakeSimulator)


def key_file(folder: Path, mode: int = 0o600) -> Path:
    path = folder / "link.key"
    path.write_bytes(KEY)
    path.chmod(mode)
    return path


def test_sim_prints_how_to_connect(capsys: pytest.CaptureFixture[str]) -> None:
    assert command.sim() == ExitCode.OK
    out = capsys.readouterr().out
    assert "a simulated px4 vehicle, system 1, sends to udp port 14550" in out
    assert typed(out)[:7] == AS_QUAD
    assert "QGroundControl   start it" in out
    assert "mavproxy.py --master=udpin:127.0.0.1:14550" in out
    assert "`arm throttle`, `long NAV_TAKEOFF -1 0 0 nan nan nan nan`" in out


AS_QUAD = ["rtshcua", "run", "BUNDLE", "--connect", "udpin:127.0.0.1:14550", "--vehicle", "IDENTITY"]


def typed(out: str) -> list[str]:
    """The arguments of the printed command, as split by a shell."""
    return shlex.split(out[out.index("rtshcua run") : out.index("  QGroundControl")].replace("\\\n", " "))


@pytest.mark.parametrize(
    ("apart", "kernel_us", "keyed", "speed", "needs"),
    [
        (True, None, False, 1, ["--utc-error", "500ms"]),
        (True, 1_000, False, 1, []),
        (False, None, False, 1, []),
        (True, None, True, 1, ["--signing-key", "KEY", "--unsigned-radio"]),
        (True, None, False, 5, ["--speed", "5"]),
    ],
)
def test_printed_run_command_works_when_copied(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
    apart: bool, kernel_us: int | None, keyed: bool, speed: float, needs: list[str],
) -> None:  # fmt: skip
    """A separate boundary does not take the time from a link without a key, and this machine may be unsynchronised."""
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(command, "program", lambda: Path("rtshcua-boundary") if apart else None)
    monkeypatch.setattr(command, "kernel_error_us", lambda: kernel_us)
    key = key_file(tmp_path) if keyed else None
    assert command.sim(signing_key=key, speed=speed) == ExitCode.OK
    assert typed(capsys.readouterr().out) == AS_QUAD + [str(key) if each == "KEY" else each for each in needs]


def test_another_port_flavour_and_id(capsys: pytest.CaptureFixture[str]) -> None:
    assert command.sim(flavour=AutopilotKind.ARDUPILOT, port=14_560, system=7) == ExitCode.OK
    out = capsys.readouterr().out
    assert "a simulated ardupilot vehicle, system 7, sends to udp port 14560" in out
    assert "Comm Links, Add: type UDP, port 14560" in out
    assert "`mode GUIDED`, `arm throttle`, `takeoff 10`" in out


def test_a_key_reaches_the_vehicle_and_never_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = key_file(tmp_path)
    assert command.sim(signing_key=path, usb=True) == ExitCode.OK
    assert f"--signing-key {path}" in capsys.readouterr().out
    config = config_of(parser().parse_args(FakeSimulator.words), utc_us=5)
    assert (config.signing_key, config.usb, config.utc_us, config.speed) == (KEY, True, 5, 100)
    assert not any(KEY.decode() in word or KEY.hex() in word for word in FakeSimulator.words)
    path.write_text(KEY.hex() + "\n")
    assert config_of(parser().parse_args(FakeSimulator.words)).signing_key == KEY


@pytest.mark.parametrize(
    ("content", "mode", "code"), [(KEY, 0o644, ExitCode.UNTRUSTED), (b"short", 0o600, ExitCode.INPUT)]
)
def test_a_key_that_does_not_serve(
    tmp_path: Path, content: bytes, mode: int, code: ExitCode, capsys: pytest.CaptureFixture[str]
) -> None:
    path = key_file(tmp_path, mode)
    path.write_bytes(content)
    assert command.sim(signing_key=path) == code, "as `run` and `doctor` say it"
    assert str(path) in capsys.readouterr().err
    assert command.sim(signing_key=tmp_path / "none") == ExitCode.INPUT


def test_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert command.sim(as_json=True) == ExitCode.OK
    assert json.loads(capsys.readouterr().out) == {"flavour": "px4", "system": 1, "peer": 14_550}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"port": 1, "connect": "udpout:127.0.0.1:1"}, "cannot be combined"),
        ({"connect": "udpin:127.0.0.1:1"}, "cannot be used here"),
        ({"connect": "udpout:192.0.2.1:1"}, "is not on this machine"),
        ({"connect": "nonsense"}, "nonsense"),
    ],
)
def test_links_that_are_not_for_it(words: dict[str, Any], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert command.sim(**words) == ExitCode.USAGE
    assert message in capsys.readouterr().err


def test_simulator_start_failure_is_reported(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(_: list[str]) -> None:
        raise SimulatorError("the port is taken")

    monkeypatch.setattr(command, "Simulator", refuse)
    assert command.sim() == ExitCode.LINK
    assert "the port is taken" in capsys.readouterr().err


def test_simulator_exit_is_reported(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(FakeSimulator, "wait", lambda _: 9)
    assert command.sim() == ExitCode.FAULT
    assert "with code 9" in capsys.readouterr().err
