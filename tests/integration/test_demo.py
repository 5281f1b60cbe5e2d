"""`rtshcua demo`: four refusals and one flight, in lines of at most 80 columns, and commands that can be repeated."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
RTSHCUA = [sys.executable, "-m", "rtshcua"]


def run(folder: Path, *words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    given = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "RTSHCUA_DATA_DIR")}
    given |= {"PYTHONPATH": str(CHECKOUT)} | environment
    return subprocess.run([*RTSHCUA, *words], cwd=folder, capture_output=True, text=True, check=False, env=given)


@pytest.mark.slow
def test_demo_refuses_four_times_and_flies_once(tmp_path: Path) -> None:
    done = run(tmp_path, "demo")
    assert done.returncode == 0, done.stdout + done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) <= 64
    assert max(map(len, lines)) <= 80
    begun = [line for line in lines if re.match(r"\d of 9  ", line)]
    assert [int(line[0]) for line in begun] == list(range(1, 10))
    assert sum(line.endswith("refused") or ": refused" in line for line in begun) == 4
    told = " ".join(" ".join(lines).split())
    for reason in ("the nearest accepted value is `60 m`", "`area = city` is not permitted", "did not sign these bytes",
                   "a bundle flies once", "completed: 4 of 4 steps", "VERIFIED"):  # fmt: skip
        assert reason in told, reason
    folder = tmp_path / "rtshcua-demo"
    assert (folder / "flight.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert not list(tmp_path.glob("*.key")), "keys are in its folder"

    tried = [shlex.split(line) for line in lines[lines.index("Try next") :] if line.startswith("  rtshcua ")]
    assert len(tried) == 4
    data = str(folder / "keys-and-state")
    for words in tried:
        if words[1] != "run":
            again = run(folder, *words[1:], RTSHCUA_DATA_DIR=data)
            assert again.returncode == 0, (words, again.stdout, again.stderr)
    again = run(tmp_path, "demo", "--json")
    assert again.returncode == 0, "a second time, in the same folder"
    events = [json.loads(line) for line in again.stdout.splitlines()]
    assert {each["event"] for each in events} == {"begun", "said"}
    assert [each["number"] for each in events if each["event"] == "begun"] == list(range(1, 10))


def test_demo_says_why_it_ends_early(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    done = run(tmp_path, "demo", "--folder", "file/x")
    assert done.returncode == 74
    assert "cannot write to" in done.stderr
    (tmp_path / "odd").mkdir()
    (tmp_path / "odd/keys-and-state").write_text("no folder")
    done = run(tmp_path, "demo", "--folder", "odd")
    assert done.returncode not in (0, 1)
    assert "Traceback" not in done.stderr
