"""Commands with a closed standard output end with the documented exit code and no further output."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from rtshcua.diagnostics.exits import ExitCode
from virtual import case

COMMAND = f'"{sys.executable}" -m rtshcua'


def shell(line: str, folder: Path) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(["sh", "-c", line], cwd=folder, capture_output=True, text=True, check=False, timeout=60)


@pytest.mark.slow
@pytest.mark.parametrize(
    "words", ["--version", "--help", "show a.bundle", "explain E1001", "why a.bundle --step 1", "show -h"]
)
def test_closed_output_is_quiet_and_not_a_success(words: str, tmp_path: Path) -> None:
    (tmp_path / "a.bundle").write_bytes(case.seal(case.mission()))
    done = shell(f"{COMMAND} {words} >&-", tmp_path)
    assert (done.returncode, done.stderr) == (ExitCode.FULL, "")


@pytest.mark.slow
def test_closed_errors_do_not_go_to_the_output(tmp_path: Path) -> None:
    done = shell(f"{COMMAND} show nothing.bundle 2>&-", tmp_path)
    assert (done.returncode, done.stdout) == (ExitCode.INPUT, "")


def test_everything_closed(tmp_path: Path) -> None:
    assert shell(f"{COMMAND} --version <&- >&- 2>&-", tmp_path).returncode == ExitCode.FULL


def test_file_opened_later_does_not_become_standard_output(tmp_path: Path) -> None:
    program = (
        "from rtshcua.front.cli.streams import mend_streams; mend_streams()\n"
        "x = open('x', 'w'); x.write(str(x.fileno()))"
    )
    assert shell(f'"{sys.executable}" -c "{program}" <&- >&- 2>&-', tmp_path).returncode == 0
    assert int((tmp_path / "x").read_text()) > 2


@pytest.mark.parametrize("style", ["lines", "json", "screen"])
def test_the_view_of_a_run_ends_as_if_its_reader_had_left(style: str, tmp_path: Path) -> None:
    note = '{"event":"note","text":"hello"}'
    done = shell(f"echo '{note}' | \"{sys.executable}\" -P -m rtshcua.front.cli.render.live {style} >&-", tmp_path)
    assert (done.returncode, done.stderr) == (1, "")


@pytest.mark.slow
def test_a_help_page_whose_reader_left(tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [sys.executable, "-m", "rtshcua", "run", "--help"],
        cwd=tmp_path, stdout=writer, stderr=subprocess.PIPE, text=True, check=False, timeout=60,
    )  # fmt: skip
    os.close(writer)
    assert (done.returncode, done.stderr) == (ExitCode.FULL, "")
