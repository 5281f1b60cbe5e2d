"""Threat: a pipe takes the place of a source, a configuration or a bundle. A reader would wait for ever."""

import os
from pathlib import Path

import pytest

from rtshcua.diagnostics.exits import ExitCode
from virtual.forked import Forked

PATIENCE_S = 60


@pytest.mark.parametrize(
    "words",
    [
        ["check", "pipe.rts"],
        ["lint", "."],
        ["lint", "--config", "pipe.rts", "imports.rts"],
        ["test", "."],
        ["fmt", "--check", "pipe.rts"],
        ["docs", "pipe.rts", "--json"],
        ["compile", "pipe.rts", "-o", "x.bundle"],
        ["check", "--since", "pipe", "imports.rts"],
        ["doctor", "--connect", "udpin:127.0.0.1:14999", "pipe"],
        ["run", "pipe"],
        ["replace", "pipe", "--to", "socket"],
        ["why", "pipe"],
        ["check", "--with", "pipe.rts", "imports.rts"],
        ["lint", "--with", "pipe.rts", "imports.rts"],
        ["check", "pipe.json"],
        ["compile", "imports.rts", "--with", "pipe.rts", "-o", "x.bundle"],
        ["show", "pipe"],
        ["verify-log", "pipe", "--root", "0" * 64],
        ["approve", "pipe", "--step", "2", "-o", "answer"],
        ["check", "/dev/zero"],
        ["check", "/dev/tty"],
        ["run", "/dev/zero"],
        ["check", "--since", "/dev/zero", "imports.rts"],
    ],
    ids=" ".join,
)
def test_a_pipe_is_refused_and_not_waited_for(commands: Forked, words: list[str], tmp_path: Path) -> None:
    for name in ("pipe.rts", "pipe", "pipe.json"):
        os.mkfifo(tmp_path / name)
    (tmp_path / "imports.rts").write_text('import "pipe.rts"\n')
    if words[0] == "approve":  # it asks for keys first
        assert commands.run(["keys", "init"], tmp_path, PATIENCE_S).code == ExitCode.OK
    done = commands.run(words, tmp_path, PATIENCE_S)
    assert done.code == ExitCode.INPUT, done
    assert "not a regular file" in done.out + done.err


def test_an_import_of_a_pipe_is_a_finding(commands: Forked, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.rts")
    (tmp_path / "imports.rts").write_text('import "pipe.rts"\n')
    done = commands.run(["check", "imports.rts"], tmp_path, PATIENCE_S)
    assert done.code == ExitCode.DIAGNOSTICS
    assert "error[E0108]: cannot read `pipe.rts`: not a regular file" in done.out + done.err


@pytest.mark.parametrize("command", [["check"], ["lint"], ["compile", "-o", "x"]], ids=" ".join)
def test_a_zone_from_a_pipe_is_a_finding(commands: Forked, command: list[str], tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.geojson")
    (tmp_path / "zone.rts").write_text('zone yard from "pipe.geojson"\n')
    done = commands.run([*command, "zone.rts"], tmp_path, PATIENCE_S)
    assert done.code == ExitCode.DIAGNOSTICS
    assert "error[E0108]: cannot read `pipe.geojson`: not a regular file" in done.out + done.err


def test_settings_from_a_pipe_are_ignored(commands: Forked, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "rtshcua.toml")
    (tmp_path / "a.rts").write_text("\n")
    for command in ("lint", "test", "fmt"):
        commands.run([command, "."], tmp_path, PATIENCE_S)  # it ends
