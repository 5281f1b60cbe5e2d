"""`rtshcua lsp`: usage errors are reported before a server is started."""

import sys

import pytest

from rtshcua.front.cli.app import main


def test_missing_extra_names_the_package(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setitem(sys.modules, "pygls", None)
    for name in [each for each in sys.modules if each.startswith("rtshcua.front.lsp")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "lsprotocol", None)
    assert main(["lsp"]) == 2
    captured = capsys.readouterr()
    assert "the language server is not installed" in captured.err
    assert ".[editor]" in captured.err
    assert captured.out == ""


@pytest.mark.parametrize("words", [["--tcp", "0"], ["--tcp", "70000"], ["--tcp", "5007", "--stdio"], ["--tcp", "x"]])
def test_a_port_is_a_port(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["lsp", *words]) == 2
    assert "Traceback" not in capsys.readouterr().err
