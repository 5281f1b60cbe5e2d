"""Ctrl-C ends a starting or working command silently at any moment."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from rtshcua import library
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import interrupts
from rtshcua.front.cli.entry_point import main
from rtshcua.front.cli.table import COMMANDS

PATIENCE_S = 60.0
TICK_S = 1 / os.sysconf("SC_CLK_TCK")
#: from when the door is open, in seconds of CPU time: what is imported, checked and written in this time
MOMENTS_S = (0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3)


def raises(process: subprocess.Popen[str]) -> bool | None:
    """Whether Python has a handler of SIGINT in the process by now; None before it is ready for any.

    Its first one raises KeyboardInterrupt.
    """
    status = dict(line.split(":", 1) for line in Path(f"/proc/{process.pid}/status").read_text().splitlines())
    return bool(int(status["SigCgt"], 16) & 1 << signal.SIGINT - 1)


def used_s(process: subprocess.Popen[str]) -> float:
    """The CPU time that it has used."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) * TICK_S


def until(found: Callable[[], bool], process: subprocess.Popen[str]) -> None:
    until_s = time.monotonic() + PATIENCE_S
    while not found():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until_s
        time.sleep(0.002)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the moment is read from /proc")
def test_sigint_ends_a_command_without_output() -> None:
    words = [sys.executable, "-m", "rtshcua", "check", str(library.root() / "missions/short.rts")]
    found: dict[float, tuple[int, str, str]] = {}
    for moment_s in MOMENTS_S:
        with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            until(lambda: bool(raises(process)), process)
            until(lambda: not raises(process), process)
            begun_s = used_s(process)
            until_s = time.monotonic() + PATIENCE_S
            while process.poll() is None and used_s(process) - begun_s < moment_s and time.monotonic() < until_s:
                time.sleep(0.002)
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=PATIENCE_S)
            found[moment_s] = process.returncode, out, err
    ended = {code for code, _, _ in found.values()}
    assert ended <= {-signal.SIGINT, ExitCode.OK}, found  # the last may have come when all was said
    assert found[MOMENTS_S[0]][0] == -signal.SIGINT
    assert not any(err for _, _, err in found.values()), found


@pytest.mark.parametrize(("before", "after"), [("SIG_IGN", "SIG_IGN"), ("default_int_handler", "SIG_DFL")])
def test_entry_point_keeps_the_callers_signal_handling(
    monkeypatch: pytest.MonkeyPatch, before: str, after: str
) -> None:
    """A shell starts background jobs with SIGINT ignored."""
    was = signal.signal(signal.SIGINT, getattr(signal, before))
    monkeypatch.setattr("rtshcua.front.cli.app.main", lambda: 0)
    try:
        assert main() == ExitCode.OK
        assert signal.getsignal(signal.SIGINT) == getattr(signal, after)
        with interrupts.breakable():
            within = signal.default_int_handler if after == "SIG_DFL" else signal.SIG_IGN
            assert signal.getsignal(signal.SIGINT) == within
        assert signal.getsignal(signal.SIGINT) == getattr(signal, after)
    finally:
        signal.signal(signal.SIGINT, was)


def test_commands_with_cleanup_handle_ctrl_c() -> None:
    """Terminals whose echo is off, children, temporary folders, tables that are half written."""
    orderly = {row.name for row in COMMANDS if row.ends_in_order}
    assert orderly >= {"sim", "qualify", "archive", "verify-log", "keys", "init"}
    assert not orderly & {"check", "lint", "fmt", "show", "explain", "docs"}
    assert not orderly & {"campaign", "witness", "operator"}, "they look at a flag: nothing rises amid what they do"


@pytest.mark.slow
@pytest.mark.parametrize("words", ["campaign MISSION --flights 500 --jobs 2", "witness LOGS --watch 3600"])
def test_long_running_command_ends_cleanly_on_ctrl_c(words: str, tmp_path: Path) -> None:
    """During flights in worker processes, and during a long wait."""
    (tmp_path / "logs").mkdir()
    environment = {
        **os.environ,
        "RTSHCUA_DATA_DIR": str(tmp_path / "data"),
        "RTSHCUA_STATE_DIR": str(tmp_path / "state"),
    }
    door = [sys.executable, "-m", "rtshcua"]
    subprocess.run([*door, "keys", "init"], env=environment, check=True, capture_output=True)
    names = {"MISSION": str(library.root() / "missions/short.rts"), "LOGS": str(tmp_path / "logs")}
    command = [*door, *(names.get(word, word) for word in words.split())]
    with subprocess.Popen(
        command, env=environment, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        until(lambda: bool(raises(process)), process)
        until(lambda: not raises(process), process)  # the door is open
        until(lambda: bool(raises(process)), process)  # the flag is looked at
        began_s = time.monotonic()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE_S)
    assert time.monotonic() - began_s < PATIENCE_S / 2
    assert "Traceback" not in out + err
    if words.startswith("witness"):
        assert (process.returncode, err) == (ExitCode.OK, "")
    else:
        assert process.returncode == ExitCode.INTERRUPTED
        assert "of 500 flights are kept in `runs/campaign-short-1`" in err


def test_entry_point_imports_no_own_module_first() -> None:
    code = (
        "import sys, signal; from rtshcua.front.cli.entry_point import main\n"
        "print([name for name in sys.modules if name.startswith('rtshcua.')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "['rtshcua.front', 'rtshcua.front.cli', 'rtshcua.front.cli.entry_point']"
