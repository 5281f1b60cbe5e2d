"""`rtshcua completion`: real shells complete commands, options, values, codes and files."""

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from rtshcua.front.cli import app
from rtshcua.front.cli.options.completing.commands import parser
from rtshcua.front.cli.options.completing.values import FILES, FOLDERS
from rtshcua.front.cli.table import COMMANDS

Complete = Callable[..., list[str]]

BASH = """
source "$1"; shift
COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMPREPLY=()
_shtab_rtshcua
printf '%s\\n' "${COMPREPLY[@]}"
"""


def asked(capsys: pytest.CaptureFixture[str], shell: str) -> str:
    assert app.main(["completion", shell]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    return out


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with one file of each kind."""
    monkeypatch.chdir(tmp_path)
    for name in ("a.rts", "b.bundle", "c.json", "d.jsonl", "e.txt", "rtshcua.toml"):
        (tmp_path / name).touch()
    (tmp_path / "sub").mkdir()
    return tmp_path


@pytest.fixture
def tab(place: Path, capsys: pytest.CaptureFixture[str]) -> Complete:
    """The completions of bash for the last word."""
    script = place / ".script"
    script.write_text(asked(capsys, "bash"))

    def tab(*words: str) -> list[str]:
        command = ["bash", "--norc", "-c", BASH, "tab", str(script), "rtshcua", *words]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        assert done.stderr == ""
        return sorted(done.stdout.split())

    return tab


def test_another_shell_is_refused_in_our_words(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["completion", "tcsh"]) == 2
    assert (
        "error[usage]: invalid value for 'shell': 'tcsh' is not one of 'bash', 'zsh', 'fish'\n"
        in capsys.readouterr().err
    )


def test_bash_completes_all_of_it(tab: Complete) -> None:
    assert set(tab("")) == {row.name for row in COMMANDS} | {"help"}
    assert tab("verify-") == ["verify-log", "verify-proof"]
    assert set(tab("keys", "")) == {
        "accept", "approver", "boundary", "init", "link", "list", "mission", "provision", "replace",
        "revoke", "rotate-root", "show",
    }  # fmt: skip
    assert "--if-missing" in tab("keys", "init", "--i")
    assert tab("check", "--deny") == ["--deny-warnings"]
    assert tab("run", "--mode", "") == ["none", "optee", "process", "software", "trustzone-m"]
    assert tab("explain", "E031") == [f"E031{digit}" for digit in range(10)]
    assert tab("explain", "datum") == ["datum-mismatch", "datum-not-allowed"]
    assert tab("lint", "--format", "") == ["github", "human", "json", "junit", "sarif"]
    assert tab("lint", "--fail-on", "n") == ["never", "note"]
    assert tab("completion", "") == ["bash", "fish", "zsh"]
    assert tab("help", "arch") == ["archive"]


def test_bash_completes_files_by_their_kind(tab: Complete) -> None:
    assert tab("check", "") == ["a.rts", "c.json", "sub"]
    assert tab("check", "a.rts", "--since", "") == ["a.rts", "b.bundle", "sub"]
    assert tab("run", "") == ["b.bundle", "sub"]
    assert tab("verify-log", "d") == ["d.jsonl"]
    assert tab("run", "--runs", "") == ["sub"]
    assert "e.txt" in tab("run", "--log-key", "")


@pytest.mark.clients
@pytest.mark.skipif(shutil.which("fish") is None, reason="fish is not installed")
def test_fish_completes(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (place / ".script").write_text(asked(capsys, "fish"))
    lines = ["rtshcua verify-", "rtshcua run --mode ", "rtshcua explain datum", "rtshcua run "]
    asking = "source .script; " + "; ".join(f'complete -C "{line}" | string split -f1 \\t; echo .' for line in lines)
    done = subprocess.run(["fish", "--no-config", "-c", asking], capture_output=True, text=True, check=True)
    assert [sorted(part.split()) for part in done.stdout.split(".\n")[:3]] == [
        ["verify-log", "verify-proof"], ["none", "optee", "process", "software", "trustzone-m"],
        ["datum-mismatch", "datum-not-allowed"],
    ]  # fmt: skip
    assert done.stdout.endswith("b.bundle\nsub/\n.\n")


@pytest.mark.clients
@pytest.mark.skipif(shutil.which("zsh") is None, reason="zsh is not installed")
def test_zsh_can_load_it(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (place / "_rtshcua").write_text(asked(capsys, "zsh"))
    loading = "fpath=($PWD $fpath); autoload -U compinit; compinit -u -D; print $_comps[rtshcua]; autoload +X _rtshcua"
    done = subprocess.run(["zsh", "-f", "-c", loading], capture_output=True, text=True, check=True)
    assert (done.stdout.strip(), done.stderr) == ("_rtshcua", "")


def test_completion_tables_name_existing_parameters() -> None:
    seen: set[str] = set()

    def walk(name: str, each: object) -> None:
        for action in each._actions:  # type: ignore[attr-defined]
            seen.update((action.dest, f"{name} {action.dest}".strip()))
            if isinstance(action.choices, dict):
                for word, inner in action.choices.items():
                    walk(f"{name} {word}".strip(), inner)

    walk("", parser())
    assert {*FILES, *FOLDERS} <= seen
    assert "keys init if_missing" in seen


def test_an_unknown_shell_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["completion", "tcsh"]) == 2
    assert "tcsh" in capsys.readouterr().err
