"""`rtshcua verify-proof` refuses special files at once, because reading a pipe could block."""

import os
from pathlib import Path

import pytest

from reference.sealed_log import PIN
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app


def verify(*words: str) -> int:
    return app.main(["verify-proof", "--root", PIN.hex(), *words])


def test_a_pipe_or_a_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    os.mkfifo("pipe")
    Path("folder").mkdir()
    Path("proof").write_bytes(b"none")
    for name in ("pipe", "folder", os.devnull):
        assert verify(name) == ExitCode.INPUT
        assert f"not a regular file: `{name}`" in capsys.readouterr().err
        assert verify("proof", "--checkpoint", name) == ExitCode.INPUT
        assert f"not a regular file: `{name}`" in capsys.readouterr().err
