"""docs/testing.md: its examples compile, and its commands end as documented."""

import re
import shlex
from pathlib import Path

import pytest

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app

PAGE = Path(__file__).resolve().parents[4] / "docs" / "testing.md"
TEXT = PAGE.read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE)


@pytest.mark.slow
def test_its_commands_are_true(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    policy, tests, flights = blocks("rts")
    Path("yard.rts").write_text(policy, encoding="utf-8")
    Path("tests").mkdir()
    Path("tests/yard.rts").write_text(tests, encoding="utf-8")
    (settings,) = blocks("toml")
    Path("rtshcua.toml").write_text(settings, encoding="utf-8")
    commands = [shlex.split(line, comments=True) for block in blocks("sh") for line in block.splitlines()]
    assert len(commands) == 9
    for program, *words in commands:
        assert program == "rtshcua"
        if "tests/flights.rts" in words:  # the others need not fly them too
            Path("tests/flights.rts").write_text(flights, encoding="utf-8")
        assert app.main(words) == ExitCode.OK, words
        assert "error" not in capsys.readouterr().err
        Path("tests/flights.rts").unlink(missing_ok=True)
    assert Path("report.xml").read_text(encoding="utf-8").startswith("<?xml")


def test_the_page_fits_its_width() -> None:
    assert max(len(line) for line in TEXT.splitlines() if not line.startswith("|")) <= 130
