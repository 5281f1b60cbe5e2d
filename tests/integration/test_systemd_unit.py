"""The systemd units: systemd accepts them, they are sandboxed, and a run flies with them."""

import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from rtshcua.front.cli.app import main

UNITS = Path(__file__).resolve().parents[2] / "examples" / "systemd"
UNIT = UNITS / "rtshcua@.service"
SERVICES = ("rtshcua@quad-07.service", "rtshcua-boundary@quad-07.service")
#: exposure in tenths, of 100, as `systemd-analyze security` counts it
MOST = {"rtshcua@quad-07.service": 15, "rtshcua-boundary@quad-07.service": 6}
ANALYZE = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd-analyze is installed")


def analyzed(*words: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["systemd-analyze", *words], capture_output=True, text=True, check=False)


@pytest.fixture
def instances(tmp_path: Path) -> Path:
    """A folder with the units for one vehicle; the programs and users that they name are here."""
    for unit in UNITS.iterdir():
        text = re.sub("/opt/rtshcua/bin/rtshcua(-boundary)?", sys.executable, unit.read_text(encoding="utf-8"))
        text = re.sub("(?m)^((?:Socket)?(?:User|Group))=rtshcua(-boundary)?$", r"\1=root", text)
        for name in (unit.name, unit.name.replace("@", "@quad-07")):
            (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


@ANALYZE
def test_systemd_accepts_the_units(instances: Path) -> None:
    made = [instances / name for name in (*SERVICES, "rtshcua-boundary@quad-07.socket")]
    checked = analyzed("verify", "--man=no", *made)
    assert (checked.returncode, checked.stderr) == (0, "")
    for each, right in zip(made, ("ProtectSystem=", "ProtectSystem=", "MaxConnections="), strict=True):
        text = each.read_text()
        each.write_text(text.replace(right, f"Wrong{right}"))
        assert f"Wrong{right[:-1]}" in analyzed("verify", "--man=no", each).stderr
        each.write_text(text)


@ANALYZE
@pytest.mark.parametrize("name", SERVICES)
def test_unit_is_sandboxed(name: str, instances: Path, tmp_path: Path) -> None:
    own = tmp_path / "own" / name
    own.parent.mkdir()
    own.write_text((instances / name).read_text().replace("=root", "=daemon"))
    checked = analyzed("security", "--offline=true", f"--threshold={MOST[name]}", own)
    assert checked.returncode == 0, checked.stdout


def test_socket_belongs_to_the_user_of_the_run() -> None:
    """And the boundary has another user, whose folder is the one that its program is given."""
    run, boundary, socket = (
        dict(re.findall("(?m)^([A-Za-z]+)=(.*)$", (UNITS / name).read_text(encoding="utf-8")))
        for name in ("rtshcua@.service", "rtshcua-boundary@.service", "rtshcua-boundary@.socket")
    )
    assert (socket["SocketUser"], socket["SocketMode"]) == (run["User"], "0600")
    assert boundary["User"] not in (run["User"], "root")
    assert boundary["ExecStart"].endswith(f" --folder /var/lib/{boundary['StateDirectory']}")
    assert f"--boundary-socket {socket['ListenSequentialPacket']} " in run["ExecStart"]
    assert run["Requires"] == "rtshcua-boundary@%i.socket"


def test_command_of_the_unit_is_valid(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It gets as far as the bundle, which is not there."""
    (line,) = re.findall("(?m)^ExecStart=(.*)$", UNIT.read_text(encoding="utf-8"))
    words = line.replace("%i", "quad-07").replace("${LINK}", "udpin:127.0.0.1:14599").split()[1:]
    words = [word.replace("/etc/rtshcua", str(tmp_path)).replace("/run", str(tmp_path)) for word in words]
    assert main(words) == 3
    assert "no such file" in capsys.readouterr().err


@pytest.mark.slow
def test_flight_without_writable_executable_memory(ground: Any) -> None:
    """MemoryDenyWriteExecute= of systemd, by the kernel's own means (PR_SET_MDWE), where it has them."""
    start = (
        "import ctypes, os, sys\n"
        "refused = ctypes.CDLL(None).prctl(65, 1, 0, 0, 0)\n"
        "os.execv(sys.executable, [sys.executable, '-m', 'rtshcua.front.cli.app', *sys.argv[1:]])\n"
    )
    ground.command = (sys.executable, "-c", start)
    assert ground.run(ground.bundle(), "--mode", "process", speed=5).end().code == 0
