"""`rtshcua doctor` beside a simulated vehicle that is a process of its own, and where there is none to be heard."""

import json
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from rtshcua.adapters.simulator import Simulator
from virtual.forked import Forked

COMMAND = [sys.executable, "-m", "rtshcua.cli.app", "doctor"]


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(("127.0.0.1", 0))
        port: int = link.getsockname()[1]
        return port


def doctor(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*COMMAND, *words], capture_output=True, text=True, timeout=120, check=False)


def test_a_vehicle_over_real_udp() -> None:
    port = free_port()
    with Simulator(["--port", str(port), "--flavour", "ardupilot"]):
        done = doctor("--connect", f"udpin:127.0.0.1:{port}", "--seconds", "5", "--json")
    said = json.loads(done.stdout)
    found = {each["slug"]: each["verdict"] for each in said["findings"]}
    assert found["link/heartbeat"] == found["autopilot/version"] == found["link/answers"] == "ok"
    assert said["exit_code"] == done.returncode
    assert done.stderr == ""


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (["--connect", "serial:/dev/ttyAMA0:57601"], 2, "    |                     ^^^^^"),
        (["--connect", "serial:/dev/no-such-device:57600"], 8, "no such file"),
        (["--connect", "udpin:127.0.0.1:14550", "missing.bundle"], 3, "no such file"),
        ([], 2, "--connect"),
        (["--connect", "udpin:127.0.0.1:14550", "--agent-user", "no-such-user"], 2, "no user `no-such-user`"),
    ],
)
def test_wrong_words(commands: Forked, words: list[str], code: int, says: str, tmp_path: Path) -> None:
    done = commands.run(["doctor", *words], tmp_path, 120)
    assert done.code == code
    assert says in done.err
    assert "Traceback" not in done.err
