"""The boundary's program for aarch64 under qemu: it answers like the one in Python, and flies.

qemu passes on few of the system calls for hardening; those measures are reported as missing.
"""

import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from boundary.sessions_in_c_and_python import ask_both, decided
from rtshcua.adapters.boundary import process as boundary_process
from rtshcua.adapters.boundary.process import Measure, measures_here

CHECKOUT = Path(__file__).resolve().parents[2]
MACHINE, EMULATOR = "aarch64", shutil.which("qemu-aarch64-static") or shutil.which("qemu-aarch64")
pytestmark = [
    pytest.mark.clients,
    pytest.mark.skipif(
        EMULATOR is None and platform.machine() != MACHINE, reason="no qemu-aarch64-static is installed"
    ),
]


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program that the wheel for aarch64 has, or a script that runs it under qemu."""
    made = subprocess.run(
        [CHECKOUT / ".make" / "boundary", sys.executable], env=os.environ | {"TARGET": f"{MACHINE}-linux-musl"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert made.returncode == 0, made.stdout + made.stderr
    built = CHECKOUT / "build" / "boundary" / f"{MACHINE}-linux-musl" / "rtshcua-boundary"
    if platform.machine() == MACHINE:
        return built
    script = tmp_path_factory.mktemp(MACHINE) / "rtshcua-boundary"
    script.write_text(f'#!/bin/sh\nexec {EMULATOR} {built} "$@"\n')
    script.chmod(0o755)
    return script


@pytest.mark.long
@pytest.mark.parametrize("requests", [1_000, pytest.param(5_000, marks=pytest.mark.soak)])
def test_aarch64_boundary_answers_as_the_native_one(
    requests: int, program: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(boundary_process, "program", lambda: program)
    counts = ask_both(7, requests, tmp_path)
    assert decided(counts) >= requests
    assert min(counts[each] for each in ("dispatches", "frames", "documents accepted", "statements")) > 0, counts


def test_missing_hardening_measures_are_named(program: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(boundary_process, "program", lambda: program)
    user = (65_534, 65_534) if os.geteuid() == 0 else None
    here = measures_here(user)
    assert Measure.LOCKED_MEMORY in here
    assert (Measure.OWN_USER in here) is (user is not None)
    if platform.machine() != MACHINE:
        assert not here & (Measure.NO_FILES | Measure.FEW_CALLS | Measure.SECRET_MEMORY)


def test_flight_with_the_aarch64_boundary(program: Path, ground: Any) -> None:
    start = (
        "from pathlib import Path\n"
        "from rtshcua.adapters.boundary import process as boundary_process\n"
        f"boundary_process.program = lambda: Path({str(program)!r})\n"
        "from rtshcua.front.cli.app import main\n"
        "main()\n"
    )
    ground.command = (sys.executable, "-c", start)
    flown = ground.run(ground.bundle(), "--mode", "process", speed=2).end()
    assert flown.code == 0, flown.stderr
    if platform.machine() != MACHINE:
        notes = " ".join(str(event) for event in flown.events)
        assert "seccomp" in notes
        assert "Landlock" in notes
    verified = ground.start("verify-log", "--audit", str(flown.folder), "--json").end()
    assert verified.code == 0, verified.events
