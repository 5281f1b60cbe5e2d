"""`rtshcua mcp`: usage errors are reported before anything is served."""

import sys
from pathlib import Path

import pytest

from rtshcua.front.cli.app import main


def test_missing_extra_names_the_package(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.delitem(sys.modules, "rtshcua.front.mcp.server", raising=False)
    monkeypatch.setitem(sys.modules, "mcp", None)
    monkeypatch.setitem(sys.modules, "anyio", None)
    assert main(["mcp", "b", "--to", "s", "--with", "p.rts"]) == 2
    captured = capsys.readouterr()
    assert "the MCP server is not installed" in captured.err
    assert ".[mcp]" in captured.err
    assert captured.out == ""


@pytest.mark.parametrize("words", [["b"], ["b", "--to", "s"], ["--to", "s", "--with", "p.rts"]])
def test_bundle_socket_and_sources_are_all_needed(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["mcp", *words]) == 2
    assert "Traceback" not in capsys.readouterr().err


def test_invalid_bundle_is_refused(tmp_path: Path, own_world: None, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mcp", reason="the extra `mcp` is not installed: `make setup` installs it")
    (tmp_path / "b").write_bytes(b"no bundle")
    assert main(["mcp", str(tmp_path / "b"), "--to", "s", "--with", "p.rts"]) in (3, 4)
    assert main(["mcp", str(tmp_path / "none"), "--to", "s", "--with", "p.rts"]) == 3
    assert "Traceback" not in capsys.readouterr().err
