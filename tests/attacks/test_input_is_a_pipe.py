"""Threat: a pipe lies where a source, a configuration or a bundle is expected. Who reads it would wait for ever."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from rtshcua.diagnostics.exits import ExitCode

PATIENCE_S = 60


def run(words: list[str], folder: Path) -> tuple[int, str]:
    done = subprocess.run(
        [sys.executable, "-m", "rtshcua.cli.app", *words],
        cwd=folder, check=False, capture_output=True, text=True, timeout=PATIENCE_S, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    return done.returncode, done.stdout + done.stderr


@pytest.mark.parametrize(
    "words",
    [
        ["check", "pipe.rts"],
        ["lint", "."],
        ["lint", "--config", "pipe.rts", "imports.rts"],
        ["test", "."],
        ["fmt", "--check", "pipe.rts"],
        ["docs", "pipe.rts", "--json"],
        ["compile", "pipe.rts", "-o", "x.bundle"],
        ["check", "--since", "pipe", "imports.rts"],
        ["doctor", "--connect", "udpin:127.0.0.1:14999", "pipe"],
        ["run", "pipe"],
        ["replace", "pipe", "--to", "socket"],
        ["why", "pipe"],
    ],
    ids=" ".join,
)
def test_a_pipe_is_refused_and_not_waited_for(words: list[str], tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.rts")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "imports.rts").write_text('import "pipe.rts"\n')
    code, said = run(words, tmp_path)
    assert code == ExitCode.INPUT, said
    assert "no regular file" in said


def test_an_import_of_a_pipe_is_a_finding(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.rts")
    (tmp_path / "imports.rts").write_text('import "pipe.rts"\n')
    code, said = run(["check", "imports.rts"], tmp_path)
    assert code == ExitCode.DIAGNOSTICS
    assert "error[E0108]: cannot read `pipe.rts`: no regular file" in said
