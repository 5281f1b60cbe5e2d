"""Threat: the name of a file in a checkout contains terminal escapes, or a line that a build reads as a command."""

from pathlib import Path

import pytest

from rtshcua.front.cli.app import main
from rtshcua.library import root

NAME = "ev\x1b]0;il\x07\u202e\n::error::no.rts"
WORDS = (("check", "."), ("check", NAME), ("fmt", "--check", "."), ("lint", "."), ("docs", ".", "-o", "page.html"))


def test_file_names_are_displayed_escaped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    main(["keys", "init"])
    text = (root() / "missions" / "short.rts").read_text()
    text = text.replace('import "../', 'import "lib:')
    Path("plain.rts").write_text(text)
    Path(NAME).write_text(text.replace("  phase", "    phase"))  # not formatted, and of the same mission
    capsys.readouterr()
    wrong: list[tuple[tuple[str, ...], str]] = []
    for words in WORDS:
        main(list(words))
        said = "".join(capsys.readouterr())
        if words != ("fmt", ".") and not said:
            continue
        if any(not line.isprintable() or line.startswith("::error::no") for line in said.splitlines()):
            wrong.append((words, said))
        if words == ("fmt", "."):
            Path(NAME).write_text(text.replace("  phase", "    phase"))
    assert [words for words, _ in wrong] == []
