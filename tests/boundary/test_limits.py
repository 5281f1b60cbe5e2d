"""The headers generated from Python's limits, reasons and layouts are up to date."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_generated_headers_are_up_to_date() -> None:
    command = [sys.executable, ROOT / ".make" / "limits", "--check"]
    checked = subprocess.run(command, check=False, capture_output=True, text=True)
    assert checked.returncode == 0, checked.stderr
