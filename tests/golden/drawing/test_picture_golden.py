"""The pictures of a shipped mission and of a refused one.

`UPDATE_GOLDENS=1 pytest tests/golden/drawing` writes them anew; look at them in a browser before you keep them.
"""

import os
from pathlib import Path

import pytest

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main

HERE = Path(__file__).parent
SOURCES = {"standard": HERE.parents[2] / "missions" / "standard.rts", "refused": HERE / "refused.rts"}


@pytest.mark.parametrize("name", SOURCES)
def test_picture_matches_the_golden(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(HERE)  # findings name the file from here
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    code = main(["check", os.path.relpath(SOURCES[name], HERE), "--picture", str(tmp_path / "made.svg")])
    assert code == (ExitCode.DIAGNOSTICS if name == "refused" else ExitCode.OK)
    found, golden = (tmp_path / "made.svg").read_text(encoding="utf-8"), HERE / f"{name}.svg"
    if os.environ.get("UPDATE_GOLDENS"):
        golden.write_text(found, encoding="utf-8")
    assert found == golden.read_text(encoding="utf-8")
