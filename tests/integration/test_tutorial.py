"""docs/tutorial.md as written: its files are created, its commands run, their output compared.

`...` stands for anything: at the end of a line for the rest of it, alone on a line for any lines.
"""

import re
import shlex
from pathlib import Path

import pytest

from rtshcua.front.cli import app

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "tutorial.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(rts|console) ?(\S*)\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)


def pattern(expected: str) -> str:
    """The expected output as a regular expression."""
    lines = [
        r"(?:.*\n)*?" if line == "..." else re.escape(line.removesuffix("...")) + (r".*\n" if "..." in line else r"\n")
        for line in expected.splitlines()
    ]
    return "".join(lines)


def test_tutorial_runs_as_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    commands = 0
    for kind, name, text in BLOCKS:
        if kind == "rts":
            Path(name).write_text(text, encoding="utf-8")
            continue
        for command, expected in re.findall(r"^\$ rtshcua (.*)\n((?:(?!\$ ).*\n)*)", text, re.MULTILINE):
            app.main(shlex.split(command))
            out, err = capsys.readouterr()
            found = re.sub(r" +$", "", err + out, flags=re.MULTILINE)
            assert re.fullmatch(pattern(expected), found), f"$ rtshcua {command}\n{found}"
            commands += 1
    assert commands == 7
