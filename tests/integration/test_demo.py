"""`make demo` prints at most 40 lines of at most 80 columns: the flight once, and next steps at the end."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_demo_fits_a_screen_and_ends_with_next_steps(tmp_path: Path) -> None:
    for name in ("missions", "policies", "skills", "rtshcua"):
        (tmp_path / name).symlink_to(CHECKOUT / name)
    (tmp_path / ".make").mkdir()
    shutil.copy(CHECKOUT / ".make" / "demo", tmp_path / ".make")
    (tmp_path / ".venv").mkdir()
    (tmp_path / ".venv" / "bin").symlink_to(Path(sys.executable).parent)
    (tmp_path / "build").mkdir()
    command = [sys.executable, ".make/demo", "20"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) <= 40
    assert max(map(len, lines)) <= 80
    assert [lines.index(each) >= 0 for each in lines if re.match(r"\d of 4  ", each)] == [True] * 4
    for number, skill in enumerate(("takeoff", "goto", "inspect_area", "inspect_area", "hover", "return_home"), 1):
        (told,) = (each for each in lines if re.search(rf"\bdone  {number} ", each))
        assert skill in told, "each step is told once"
    assert any("6 of 6 steps done" in each for each in lines)
    assert any("VERIFIED" in each for each in lines)
    assert "Try next" in lines
    tried = [shlex.split(each.split("    ")[0]) for each in (line.strip() for line in lines[lines.index("Try next") :])]
    assert sum(words[:1] == ["rtshcua"] for words in tried) >= 3
