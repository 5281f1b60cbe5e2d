"""The unit for permanent use: systemd takes it, it is shut in, and a run flies so."""

import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from rtshcua.cli.app import main

UNIT = Path(__file__).resolve().parents[2] / "examples" / "systemd" / "rtshcua@.service"
#: exposure in tenths, of 100, as `systemd-analyze security` counts it
MOST = 15
ANALYZE = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd-analyze is installed")


def analyzed(*words: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["systemd-analyze", *words], capture_output=True, text=True, check=False)


@pytest.fixture
def instance(tmp_path: Path) -> Path:
    """The unit for one vehicle; the program and the user that it names are here."""
    text = UNIT.read_text(encoding="utf-8").replace("/opt/rtshcua/bin/rtshcua", sys.executable)
    made = tmp_path / "rtshcua@quad-07.service"
    made.write_text(re.sub("(?m)^(User|Group)=rtshcua$", r"\1=root", text), encoding="utf-8")
    return made


@ANALYZE
def test_systemd_takes_it(instance: Path) -> None:
    checked = analyzed("verify", "--man=no", instance)
    assert (checked.returncode, checked.stderr) == (0, "")
    instance.write_text(instance.read_text().replace("ProtectSystem=strict", "ProtectSystems=strict"))
    assert "ProtectSystems" in analyzed("verify", "--man=no", instance).stderr


@ANALYZE
def test_it_is_shut_in(instance: Path, tmp_path: Path) -> None:
    own = tmp_path / "own" / instance.name
    own.parent.mkdir()
    own.write_text(instance.read_text().replace("=root", "=daemon"))
    checked = analyzed("security", "--offline=true", f"--threshold={MOST}", own)
    assert checked.returncode == 0, checked.stdout


def test_its_command_is_one_that_run_takes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It gets as far as the bundle, which is not there."""
    (line,) = re.findall("(?m)^ExecStart=(.*)$", UNIT.read_text(encoding="utf-8"))
    words = line.replace("%i", "quad-07").replace("${LINK}", "udpin:127.0.0.1:14599").split()[1:]
    words = [word.replace("/etc/rtshcua", str(tmp_path)).replace("/run", str(tmp_path)) for word in words]
    assert main(words) == 3
    assert "no such file" in capsys.readouterr().err


def test_a_flight_with_no_memory_that_is_written_and_run(ground: Any) -> None:
    """MemoryDenyWriteExecute= of systemd, by the kernel's own means (PR_SET_MDWE), where it has them."""
    start = (
        "import ctypes, os, sys\n"
        "refused = ctypes.CDLL(None).prctl(65, 1, 0, 0, 0)\n"
        "os.execv(sys.executable, [sys.executable, '-m', 'rtshcua.cli.app', *sys.argv[1:]])\n"
    )
    ground.command = (sys.executable, "-c", start)
    assert ground.run(ground.bundle(), "--mode", "process", speed=5).end().code == 0
