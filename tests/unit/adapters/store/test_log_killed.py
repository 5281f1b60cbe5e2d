"""Writers killed at random moments lose no acknowledged line, and the log is recovered."""

import subprocess
import sys
from pathlib import Path

import pytest

from reference import killed

TESTS = Path(killed.__file__).parents[1]


def kill(count: int, seed: int) -> None:
    """Run in a separate process without threads, which can fork."""
    command = [sys.executable, killed.__file__, str(count), str(seed)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={"PYTHONPATH": str(TESTS)})
    assert (done.returncode, done.stderr) == (0, ""), done.stdout


@pytest.mark.slow
def test_acknowledged_lines_survive_a_kill() -> None:
    kill(15, 1)


@pytest.mark.soak
def test_acknowledged_lines_survive_five_hundred_kills() -> None:
    kill(500, 1_000)
