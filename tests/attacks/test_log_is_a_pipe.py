"""Threat: a pipe lies where a log, a proof or what belongs to a log is expected. Who reads it would wait for ever."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from reference.forgery import flight
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.wire.keys import Duty
from virtual import case

ROOT = case.KEYS[Duty.ROOT].public.hex()
PATIENCE_S = 60


def said(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "rtshcua.cli.app", *map(str, words)]
    return subprocess.run(
        command, check=False, capture_output=True, text=True, timeout=PATIENCE_S, stdin=subprocess.DEVNULL
    )


@pytest.mark.parametrize(
    "words",
    [
        ["verify-log", "--root", ROOT],
        ["verify-log", "--root", ROOT, "--fast"],
        ["verify-log", "--root", ROOT, "--audit"],
        ["verify-log", "--root", ROOT, "--explain", "1"],
        ["verify-proof", "--root", ROOT],
        ["recover", "--dry-run"],
        ["show"],
        ["why"],
        ["prove", "--since", "0"],
        ["archive", "add", "--root", ROOT, "--archive", "ARCHIVE"],
    ],
)
def test_a_pipe_is_refused_and_not_waited_for(words: list[str], tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "log.jsonl")
    words = [str(tmp_path / "archive") if word == "ARCHIVE" else word for word in words]
    done = said(*words, tmp_path / "log.jsonl")
    assert done.returncode == ExitCode.INPUT
    assert "no regular file" in done.stderr or "is not a log" in done.stderr


@pytest.mark.parametrize(
    ("name", "code"),
    [("mission.bundle", ExitCode.INPUT), ("telemetry.tlog", ExitCode.INPUT), ("log.anchors", ExitCode.OK)],
)
def test_a_pipe_beside_a_log_keeps_nobody_waiting(name: str, code: ExitCode, tmp_path: Path) -> None:
    (tmp_path / "log.jsonl").write_bytes(b"".join(flight()))
    os.mkfifo(tmp_path / name)
    assert said("verify-log", "--root", ROOT, "--audit", tmp_path).returncode == code
