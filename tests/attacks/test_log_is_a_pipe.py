"""Threat: a pipe takes the place of a log, a proof or a file beside a log. A reader would wait for ever."""

import os
from pathlib import Path

import pytest

from reference.forgery import flight
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.wire.keys import Duty
from virtual import case
from virtual.forked import Forked

ROOT = case.KEYS[Duty.ROOT].public.hex()
PATIENCE_S = 60


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
        ["export", "--to", "plan"],
        ["archive", "add", "--root", ROOT, "--archive", "ARCHIVE"],
    ],
)
def test_a_pipe_is_refused_and_not_waited_for(commands: Forked, words: list[str], tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "log.jsonl")
    words = [str(tmp_path / "archive") if word == "ARCHIVE" else word for word in words]
    done = commands.run([*words, str(tmp_path / "log.jsonl")], tmp_path, PATIENCE_S)
    assert done.code == ExitCode.INPUT
    assert "not a regular file" in done.err or "is not a log" in done.err


@pytest.mark.parametrize(
    ("name", "code"),
    [("mission.bundle", ExitCode.INPUT), ("telemetry.tlog", ExitCode.INPUT), ("log.anchors", ExitCode.OK)],
)
def test_a_pipe_beside_a_log_keeps_nobody_waiting(commands: Forked, name: str, code: ExitCode, tmp_path: Path) -> None:
    (tmp_path / "log.jsonl").write_bytes(b"".join(flight()))
    os.mkfifo(tmp_path / name)
    words = ["verify-log", "--root", ROOT, "--audit", str(tmp_path)]
    assert commands.run(words, tmp_path, PATIENCE_S).code == code
