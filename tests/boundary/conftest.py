"""The boundary in C, built once and called in this process."""

import ctypes
import fcntl
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def boundary() -> ctypes.CDLL:
    """The library of the present `boundary/`, or the one named by RTSHCUA_BOUNDARY (such as a sanitized one)."""
    named = os.environ.get("RTSHCUA_BOUNDARY")
    if named is not None:
        return ctypes.CDLL(named)
    build = ROOT / "build"
    build.mkdir(exist_ok=True)
    with (build / "boundary.lock").open("w") as lock:  # tests run in several processes
        fcntl.flock(lock, fcntl.LOCK_EX)
        made = subprocess.run(
            ["make", "--no-print-directory", "-C", str(ROOT / "boundary"), f"PYTHON={sys.executable}"],
            check=False,
            capture_output=True,
            text=True,
        )
    assert made.returncode == 0, made.stdout + made.stderr
    return ctypes.CDLL(str(build / "boundary" / "librtshcua.so"))
