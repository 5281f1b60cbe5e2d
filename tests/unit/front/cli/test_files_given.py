"""Files and folders as arguments: every command reports the same errors for them."""

import json
import os
import shutil
from errno import EACCES
from pathlib import Path
from typing import Any

import pytest

from reference.forgery import ROOT_KEY, flight
from rtshcua.adapters.store.writing import NotWritten, replace
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app

ROOT = ("--root", ROOT_KEY.hex())
LINES = flight()
READERS = (
    ("verify-log", *ROOT), ("verify-log", *ROOT, "--fast"), ("verify-log", *ROOT, "--audit"),
    ("verify-log", *ROOT, "--explain", "0"), ("show",), ("why",), ("prove", "0"), ("recover", "--dry-run"),
    ("export", "--to", "plan", "-o", "flight.plan"),
)  # fmt: skip


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "runs" / "one" / "log.jsonl"
    path.parent.mkdir(parents=True)
    path.write_bytes(b"".join(LINES))
    return path


def given(words: tuple[str, ...], path: Path) -> int:
    return app.main([words[0], str(path), *words[1:]])


@pytest.mark.parametrize("words", READERS)
def test_a_log_that_is_cut_inside_its_first_record(words: tuple[str, ...], log: Path) -> None:
    for length in (len(LINES[0]) // 2, len(LINES[0]) - 1, 11):
        log.write_bytes(LINES[0][:length])
        assert given(words, log) == ExitCode.EVIDENCE


@pytest.mark.parametrize("words", READERS)
def test_unreadable_file_is_bad_input(
    words: tuple[str, ...], log: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is not a usage error, which an argument parser with a file check would report."""
    opened = os.open

    def denied(path: Any, *rest: Any, **more: Any) -> int:
        if Path(path) == log:
            raise PermissionError(13, "Permission denied", str(path))
        return opened(path, *rest, **more)

    real = Path.open

    def refused(self: Path, *rest: Any, **more: Any) -> Any:
        if self == log:
            raise PermissionError(13, "Permission denied", str(self))
        return real(self, *rest, **more)

    monkeypatch.setattr(os, "access", lambda *_, **__: False)
    monkeypatch.setattr(os, "open", denied)
    monkeypatch.setattr(Path, "open", refused)
    assert given(words, log) == ExitCode.INPUT
    assert f"error[input]: permission denied: `{log}`" in capsys.readouterr().err


def test_read_only_folder_is_reported(
    log: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    opened = os.open

    def denied(path: Any, flags: int, *rest: Any, **more: Any) -> int:
        if flags & os.O_CREAT:
            raise PermissionError(13, "Permission denied", str(path))
        return opened(path, flags, *rest, **more)

    monkeypatch.setattr(os, "open", denied)
    assert app.main(["prove", str(log), "3", "-o", "there.tlog-proof"]) == ExitCode.FULL
    assert capsys.readouterr().err == "error: permission denied: `there.tlog-proof`\n"
    with pytest.raises(NotWritten, match=r"'there\.bundle'"):
        replace(Path("there.bundle"), b"")


@pytest.mark.parametrize("words", [("verify-log", *ROOT, "--json"), ("recover", "--dry-run", "--json")])
def test_a_folder_of_runs_is_all_of_them(
    words: tuple[str, ...], log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(log.parent, tmp_path / "runs" / "late" / "two")
    assert given(words, tmp_path / "runs") == ExitCode.OK
    told = [json.loads(line)["log"] for line in capsys.readouterr().out.splitlines()]
    assert told == [str(tmp_path / "runs" / name / "log.jsonl") for name in ("late/two", "one")]
    (tmp_path / "empty").mkdir()
    assert given(words, tmp_path / "empty") == ExitCode.INPUT


def test_seal_is_explained(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    number = next(number for number, line in enumerate(LINES) if b'"type":"seal"' in line)
    assert app.main(["why", str(log), "--record", str(number)]) == ExitCode.OK
    out = capsys.readouterr().out
    assert "seal: an event, not a decision" in out
    assert f"epoch 0 sealed, {json.loads(LINES[number])['records']} records" in out
    assert app.main(["why", str(log), "--record", str(len(LINES))]) == ExitCode.INPUT
    assert f"has no explainable record {len(LINES)}" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [("check",), ("lint",), ("fmt", "--check"), ("test",), ("docs", "-o", "x.html"), ("verify-log", *ROOT),
     ("archive", "add", *ROOT)],
)  # fmt: skip
def test_a_folder_that_cannot_be_read_is_not_passed_over(
    words: tuple[str, ...], log: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Otherwise unread files would be reported as free of errors."""
    Path("runs/fine.rts").write_text("role watch\n", encoding="utf-8")
    locked, scanned = Path("runs/locked"), os.scandir
    locked.mkdir()

    def denied(path: Any) -> Any:
        if Path(path) == locked:
            raise PermissionError(EACCES, "Permission denied", str(path))
        return scanned(path)

    monkeypatch.setattr(os, "scandir", denied)
    assert app.main([*words, "runs"]) == ExitCode.INPUT
    assert capsys.readouterr().err.endswith("error[input]: permission denied: `runs/locked`\n")


def test_show_names_the_log_that_a_folder_lacks(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for folder, code in (("runs/one", ExitCode.OK), ("runs", ExitCode.INPUT)):
        assert app.main(["show", folder]) == code
    assert capsys.readouterr().err == (
        "error[input]: no `log.jsonl` in the folder `runs`\n help: name a file or a run folder\n"
    )
