"""Suggestions for mistyped files, options, commands and codes."""

from collections.abc import Callable
from pathlib import Path

import pytest

from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main

Said = Callable[..., tuple[int, str]]


@pytest.fixture
def said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Said:
    """Run a command in a folder with `standard.rts`, an empty file and an empty folder; return its result."""
    monkeypatch.chdir(tmp_path)
    Path("standard.rts").write_text("")
    Path("empty.bundle").touch()
    Path("empty").mkdir()
    Path("area.json").write_text('{"type": "FeatureCollection", "features": []}')

    def run(*words: str) -> tuple[int, str]:
        code = main(list(words))
        out, err = capsys.readouterr()
        return code, out + err

    return run


@pytest.mark.parametrize(
    ("words", "code", "help"),
    [
        ("why standrd.rts --step 3", ExitCode.INPUT, "did you mean `standard.rts`?"),
        ("show emty.bundle", ExitCode.INPUT, "did you mean `empty.bundle`?"),
        ("why empty", ExitCode.INPUT, "there is no `log.jsonl` in the folder `empty`"),
        ("completion fsh", ExitCode.USAGE, "did you mean fish?"),
        ("compile standard.rts --key x", ExitCode.USAGE, "did you mean --policy-key or --mission-key?"),
        ("explain E07", ExitCode.USAGE, "`E0701`"),
        ("campaign standard.rts --flights x", ExitCode.USAGE, "'--flights': it should be a whole number"),
        ("show empty.bundle", ExitCode.INPUT, "`empty.bundle` is an empty file"),
        ("run empty.bundle", ExitCode.INPUT, "`empty.bundle` is an empty file"),
        ("fmt area.json", ExitCode.OK, "skipped area.json: it is GeoJSON, which `fmt` does not format"),
        ("check standard.rts", ExitCode.OK, "note: `standard.rts` is empty"),
    ],
)
def test_nearest_fix_is_suggested(said: Said, words: str, code: ExitCode, help: str) -> None:
    found = said(*words.split())
    assert found[0] == code, found
    assert help in found[1]


def test_no_name_is_suggested_without_a_similar_one(said: Said) -> None:
    assert "did you mean" not in said("show", "quite-another.bundle")[1]
    assert "did you mean" not in said("show", "nowhere/standard.rts")[1]


def test_folder_without_log_and_secret_root_key_are_reported(said: Said) -> None:
    assert said("keys", "init")[0] == ExitCode.OK
    assert "there is no `log.jsonl` in the folder `empty`" in said("verify-log", "empty")[1]
    secret = KeyStore(data_folder()).root_path.with_suffix(".key")
    Path("log.jsonl").write_text("{}")
    assert f"is its secret half: give `{secret.with_suffix('.trust')}`" in said(
        "verify-log", "--root", str(secret), "log.jsonl"
    )[1].replace("\n", " ").replace("  ", "")
