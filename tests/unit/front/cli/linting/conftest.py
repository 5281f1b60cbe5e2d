"""Fixtures that run `rtshcua lint` in a temporary folder."""

import json
from pathlib import Path
from typing import Any

import pytest

from reference.lint_project import MISSION, POLICY, Lint, put
from rtshcua.front.cli.app import main


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    put({"policy.rts": POLICY, "one.rts": MISSION, "two.rts": MISSION})
    return tmp_path


@pytest.fixture
def lint(capsys: pytest.CaptureFixture[str]) -> Lint:
    """Run `rtshcua lint --json` with arguments; return the exit code, and the code and file of each finding."""

    def run(*words: str) -> tuple[int, list[tuple[str, str]]]:
        code = main(["lint", *words, "--json"])
        answered: dict[str, Any] = json.loads(capsys.readouterr().out)
        if "error" in answered and not answered["diagnostics"]:
            return code, [(answered["error"]["slug"], answered["error"]["message"])]
        return code, [(each["code"], (each["at"] or {"file": ""})["file"]) for each in answered["diagnostics"]]

    return run
