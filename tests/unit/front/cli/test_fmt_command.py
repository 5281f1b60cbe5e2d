"""`rtshcua fmt`: selected files, output, exit codes, and no loss of text."""

import io
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from rtshcua.adapters.store import writing
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main
from rtshcua.ground.format import format_text

CHECKOUT = Path(__file__).resolve().parents[4]
COMMAND = [sys.executable, "-m", "rtshcua", "fmt"]

BAD = "skill s() { deadline 2 s\n grace 1 s } // end\n"
GOOD = "skill s() {\n  deadline 2 s\n  grace    1 s\n}  // end\n"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with one source that is not formatted, one that is, and others that are no sources."""
    monkeypatch.chdir(tmp_path)
    for name, text in {"a.rts": BAD, "b/c.rts": GOOD, "b/notes.txt": BAD, ".hidden/d.rts": BAD}.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def said(capsys: pytest.CaptureFixture[str]) -> tuple[str, str]:
    found = capsys.readouterr()
    return found.out, found.err


def test_shipped_sources_are_formatted(capsys: pytest.CaptureFixture[str]) -> None:
    folders = [str(CHECKOUT / folder) for folder in ("skills", "policies", "missions", "evaluation", "examples")]
    assert main(["fmt", "--check", "--isolated", *folders]) == ExitCode.OK, capsys.readouterr()


def test_in_place(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fmt"]) == ExitCode.OK
    assert said(capsys) == ("formatted: a.rts\n1 file formatted, 1 file already\n", "")
    assert Path("a.rts").read_text() == Path("b/c.rts").read_text() == GOOD
    assert Path("b/notes.txt").read_text() == Path(".hidden/d.rts").read_text() == BAD
    assert main(["fmt", "a.rts", "b"]) == ExitCode.OK
    assert said(capsys) == ("2 files already formatted\n", "")


def test_check_writes_nothing(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fmt", "--check", "."]) == ExitCode.DIAGNOSTICS
    assert said(capsys) == ("not formatted: a.rts\n1 file would be formatted, 1 file already\n", "")
    assert Path("a.rts").read_text() == BAD
    assert main(["fmt", "--check", "b"]) == ExitCode.OK


def test_diff_can_be_applied_by_patch(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.rts").write_text(BAD.rstrip("\n"))
    assert main(["fmt", "--diff", "b"]) == ExitCode.OK
    assert said(capsys) == ("", "")
    assert main(["fmt", "--diff", "."]) == ExitCode.DIAGNOSTICS
    out, err = said(capsys)
    assert err == ""
    assert out.startswith("--- a.rts\tcurrent\n+++ a.rts\tformatted\n@@ ")
    assert "\\ No newline at end of file\n" in out
    assert Path("a.rts").read_text() == BAD.rstrip("\n")
    assert main(["fmt", "--diff", "--check", "."]) == ExitCode.DIAGNOSTICS
    if shutil.which("patch"):
        subprocess.run(["patch", "-p0"], input=out, text=True, check=True, capture_output=True)
        assert Path("a.rts").read_text() == GOOD


def test_as_json(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fmt", "--check", "--json", "."]) == ExitCode.DIAGNOSTICS
    told = json.loads(said(capsys)[0])
    assert told["files"] == [
        {"file": "a.rts", "changed": True, "refused": False, "error": None},
        {"file": "b/c.rts", "changed": False, "refused": False, "error": None},
    ]  # fmt: skip
    (finding,) = told["diagnostics"]
    assert (finding["code"], finding["at"]["line"], finding["fixes"][0]["replacement"]) == ("E1501", 1, GOOD)
    assert main(["fmt", "--json", "-"]) == ExitCode.USAGE
    assert json.loads(said(capsys)[0])["error"]["slug"] == "usage"


@pytest.mark.parametrize(
    ("data", "words", "code"),
    [
        (b"skill s() { deadline", "E0101", ExitCode.DIAGNOSTICS),
        (b"skill s() { }\xff", "is not UTF-8", ExitCode.DIAGNOSTICS),
        (b"skill s() { } \0", "NUL", ExitCode.DIAGNOSTICS),
        (b"/" * (8 << 20) + b" ", "8 MiB", ExitCode.INPUT),
    ],
    ids=["syntax", "latin", "nul", "size"],
)
def test_other_files_are_skipped_and_sources_formatted(
    here: Path, data: bytes, words: str, code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("aa.rts").write_bytes(data)
    assert main(["fmt", "aa.rts", "a.rts"]) == code
    out, err = said(capsys)
    assert words in err
    assert "Traceback" not in err
    assert out == "formatted: a.rts\n1 file formatted\n"
    assert Path("aa.rts").read_bytes() == data
    assert Path("a.rts").read_text() == GOOD


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (["none.rts"], ExitCode.INPUT, "no such file"),
        (["b/notes.txt/x.rts"], ExitCode.INPUT, "no such file"),
        (["empty"], ExitCode.INPUT, "there is no source (.rts) in or below `empty`"),
        (["-", "a.rts"], ExitCode.USAGE, "`-` cannot be combined with other paths"),
        (["--stdin-filename", "x.rts", "a.rts"], ExitCode.USAGE, "`--stdin-filename` requires `-`"),
        (["--config", "none.toml", "a.rts"], ExitCode.INPUT, "none.toml"),
        (["--wrong"], ExitCode.USAGE, "no such option"),
    ],
)
def test_bad_command_lines(
    here: Path, words: list[str], code: int, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("empty").mkdir()
    assert main(["fmt", *words]) == code
    out, err = said(capsys)
    assert told in err
    assert "Traceback" not in err + out
    assert Path("a.rts").read_text() == BAD


def test_specifications_are_others_business(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("m.json").write_text("{ }")
    assert main(["fmt", "m.json", "a.rts"]) == ExitCode.OK
    out, err = said(capsys)
    assert "skipped m.json" in err
    assert "formatted: a.rts" in out
    assert Path("m.json").read_text() == "{ }"


def test_the_project_says_how_wide_and_which_not(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("rtshcua.toml").write_text('[format]\nwidth = 40\nexclude = ["b"]\n')
    wide = "skill s() { deadline 2 s  grace 1 s  lasts at most 5 min }\n"
    Path("a.rts").write_text(wide)
    Path("b/c.rts").write_text(BAD)
    assert main(["fmt"]) == ExitCode.OK
    assert Path("a.rts").read_text().count("\n") == 5
    assert Path("b/c.rts").read_text() == BAD
    Path("a.rts").write_text(wide)
    assert main(["fmt", "--isolated", "--check", "a.rts"]) == ExitCode.OK
    Path("rtshcua.toml").write_text("[format]\nwidht = 40\n")
    said(capsys)
    assert main(["fmt"]) == ExitCode.INPUT
    assert "width" in said(capsys)[1]


def test_standard_input(here: Path, monkeypatch: pytest.MonkeyPatch, capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    def fed(data: bytes, *words: str) -> tuple[int, bytes, bytes]:
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))
        code = main(["fmt", *words, "-"])
        sys.stdout.flush()
        return (code, *capfdbinary.readouterr())

    assert fed(BAD.replace("\n", "\r\n").encode()) == (ExitCode.OK, GOOD.encode(), b"")
    assert fed("// é\r\n".encode()) == (ExitCode.OK, "// é\n".encode(), b"")
    assert fed(b"") == (ExitCode.OK, b"", b"")
    assert fed(BAD.encode(), "--check") == (
        ExitCode.DIAGNOSTICS, b"not formatted: stdin.rts\n1 file would be formatted\n", b"",
    )  # fmt: skip
    code, out, err = fed(b"skill", "--stdin-filename", "b/x.rts")
    assert (code, out) == (ExitCode.DIAGNOSTICS, b"")
    assert b"b/x.rts:1" in err
    assert fed(BAD.encode(), "--diff")[1].startswith(b"--- stdin.rts")
    patch = fed(BAD.encode(), "--diff")[1]
    assert fed(BAD.encode(), "--diff")[0] == ExitCode.DIAGNOSTICS
    assert fed(BAD.encode(), "--check", "--diff") == (ExitCode.DIAGNOSTICS, patch, b"")
    code, out, err = fed(b"skill", "--check")
    assert (code, out, b"E0101" in err) == (ExitCode.DIAGNOSTICS, b"", True)
    Path("rtshcua.toml").write_text('[format]\nexclude = ["b"]\n')
    assert fed(BAD.encode(), "--stdin-filename", "b/x.rts") == (ExitCode.OK, BAD.encode(), b"")


def test_a_closed_pipe_is_quiet(here: Path) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [*COMMAND, "-"], input=BAD.encode(), stdout=writer, stderr=subprocess.PIPE, check=False, timeout=60
    )
    os.close(writer)
    assert (done.returncode, done.stderr) == (ExitCode.FULL, b"")


def test_a_file_that_may_not_be_written(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The error is reported, and the other files are formatted."""
    Path("a.rts").chmod(0o444)
    Path("b/c.rts").write_text(BAD)
    assert main(["fmt", "."]) == ExitCode.FULL
    out, err = said(capsys)
    assert out == "formatted: b/c.rts\n1 file formatted\n"
    assert err == "error: cannot write `a.rts`: the file is read-only\n"
    assert (Path("a.rts").read_text(), Path("b/c.rts").read_text()) == (BAD, GOOD)
    assert main(["fmt", "--json", "a.rts"]) == ExitCode.FULL
    assert json.loads(said(capsys)[0])["files"][0]["error"] == "the file is read-only"
    assert main(["fmt", "--check", "a.rts"]) == ExitCode.DIAGNOSTICS


@pytest.fixture
def interruptible() -> Iterator[None]:
    """Restore SIGINT, which a shell ignores for background jobs."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_leaves_whole_files(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object) -> None:
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(writing, "write_all", interrupted)
    assert main(["fmt", "a.rts"]) == ExitCode.INTERRUPTED
    assert Path("a.rts").read_text() == BAD
    assert sorted(each.name for each in here.iterdir()) == [".hidden", "a.rts", "b"]


def test_a_fault_of_ours_changes_nothing(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(format_text, "lay_out", lambda before, width: before.text.replace("2 s", "3 s"))
    assert main(["fmt", "a.rts"]) == ExitCode.FAULT
    assert "error[E1502]" in said(capsys)[1]
    assert Path("a.rts").read_text() == BAD


def test_unparsable_source_is_not_counted(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.rts").write_text("skill")
    assert main(["fmt", "a.rts"]) == ExitCode.DIAGNOSTICS
    assert said(capsys)[0] == ""
    assert main(["fmt", "."]) == ExitCode.DIAGNOSTICS
    assert said(capsys)[0] == "1 file already formatted\n"
