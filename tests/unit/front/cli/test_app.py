"""The entry point: output, start time and failures."""

import errno
import os
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated

import pytest
import typer

from rtshcua import __version__
from rtshcua.app.exit_codes import exit_code_of
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app, table


def run_module(*words: str, **options: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "rtshcua", *words]
    return subprocess.run(command, text=True, check=False, **{"capture_output": True, **options})


def install(monkeypatch: pytest.MonkeyPatch, body: Callable[..., object]) -> None:
    """Replace the command `rtshcua show`."""
    door = typer.Typer(add_completion=False)
    door.command()(body)
    monkeypatch.setattr(app, "import_module", lambda name: SimpleNamespace(app=door))


@pytest.mark.parametrize("words", [[], ["--help"], ["-h"], ["help"]])
def test_overview_lists_every_command(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(words) == ExitCode.OK
    out = capsys.readouterr().out
    for row in table.COMMANDS:
        assert f"  {row.name} " in out
        assert row.help in out
    assert max(map(len, out.splitlines())) <= 100
    assert "\033" not in out


def test_overview_in_a_terminal_has_bold_headings() -> None:
    assert "\033[1mFly it\033[0m" in app.overview(bold=True)


@pytest.mark.parametrize("word", ["--version", "-V"])
def test_version(word: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main([word]) == ExitCode.OK
    assert capsys.readouterr().out == f"rtshcua {__version__}\n"


@pytest.mark.parametrize("words", [[], ["--help"], ["--version"]])
def test_overview_imports_no_command(words: list[str]) -> None:
    program = (
        f"import sys; from rtshcua.front.cli.app import main; main({words})\n"
        "print(*sys.modules, sep='\\n', file=sys.stderr)"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    heavy = {"typer", "rich", "lark", "pydantic", "pymavlink", "cryptography", "dataclasses", "difflib", "inspect"}
    assert not heavy & set(run.stderr.split())


def test_lint_of_files_seen_before_loads_no_evidence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RTSHCUA_DATA_DIR", str(tmp_path / "data"))
    (tmp_path / "a.rts").write_text("zone pond = circle(47.39840 N, 8.54640 E, 15 m)\n")
    program = "import sys; from rtshcua.front.cli.app import main; main(['lint', 'a.rts']); print(*sys.modules)"
    for _ in range(2):
        run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=tmp_path)
    loaded = run.stdout.splitlines()[-1].split()
    assert "rtshcua.app.lint.service" in loaded
    assert not {"msgspec", "lark", "typer", "rtshcua.evidence", "rtshcua.ground.language.parse"} & set(loaded)


def test_check_does_not_import_lint(tmp_path: Path) -> None:
    (tmp_path / "a.rts").write_text("zone pond = circle(47.39840 N, 8.54640 E, 15 m)\n")
    program = "import sys; from rtshcua.front.cli.app import main; main(['check', 'a.rts']); print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=tmp_path)
    loaded = run.stdout.splitlines()[-1].split()
    assert "rtshcua.app.check" in loaded
    assert not {"typer", "platformdirs", "rtshcua.app.lint.scope"} & set(loaded)


@pytest.mark.slow
def test_shipped_sources_are_checked_without_float_geometry(checkout: Path) -> None:
    """Unneeded imports are slow, and floating-point geometry differs between machines."""
    files = [str(path) for folder in ("skills", "policies", "missions") for path in (checkout / folder).glob("*.rts")]
    program = (
        f"import sys; from rtshcua.front.cli.app import main; code = main(['check', *{files}])\n"
        "print(code, *sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    code, *modules = run.stdout.splitlines()[-1].split()
    assert (code, run.stderr) == (str(int(ExitCode.OK)), "")
    assert not {"shapely", "numpy", "lark", "pymavlink", "rich"} & set(modules)


@pytest.mark.parametrize(
    ("word", "answer"),
    [
        ("comple", "no such command: `comple`\n help: did you mean `rtshcua compile`?"),
        ("verify_log", "no such command: `verify_log`\n help: did you mean `rtshcua verify-log`?"),
        ("--versoin", "no such option: `--versoin`\n help: did you mean `rtshcua --version`?"),
        ("zzz", "no such command: `zzz`\n help: run `rtshcua --help` for a list of commands"),
    ],
)
def test_unknown_words(word: str, answer: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main([word]) == ExitCode.USAGE
    assert capsys.readouterr().err == f"error[usage]: {answer}\n"


@pytest.mark.slow
@pytest.mark.parametrize("row", table.COMMANDS, ids=lambda row: row.name)
def test_every_row_leads_to_a_command_with_help(row: table.Row, capsys: pytest.CaptureFixture[str]) -> None:
    door = import_module(row.module).app
    assert isinstance(door, typer.Typer)
    assert app.main([row.name, "--help"]) == ExitCode.OK
    out = capsys.readouterr().out
    assert f"rtshcua {row.name}" in out
    assert "--install-completion" not in out
    assert app.main(["help", row.name]) == ExitCode.OK
    assert capsys.readouterr().out == out


def test_rows_are_in_a_group_and_named_once() -> None:
    assert len({row.name for row in table.COMMANDS}) == len(table.COMMANDS)
    assert {row.group for row in table.COMMANDS} == set(table.GROUPS)


def test_exit_code_of_the_command_is_the_exit_code(monkeypatch: pytest.MonkeyPatch) -> None:
    def ends(code: int) -> ExitCode:
        return ExitCode(code)

    install(monkeypatch, ends)
    assert [app.main(["show", str(code.value)]) for code in ExitCode] == list(ExitCode)


def test_none_means_success_and_typer_exit_keeps_its_code(monkeypatch: pytest.MonkeyPatch) -> None:
    def ends(early: bool = False) -> None:
        if early:
            raise typer.Exit(7)

    install(monkeypatch, ends)
    assert app.main(["show"]) == ExitCode.OK
    assert app.main(["show", "--early"]) == ExitCode.STOOD_DOWN


@pytest.mark.parametrize(
    ("words", "named"),
    [([], "path"), (["a", "b"], "b"), (["a", "--speeed", "2"], "--speeed"), (["a", "--speed", "x"], "--speed")],
)
def test_misused_command(
    words: list[str], named: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def takes(path: str, speed: int = 1) -> None:
        """Does nothing."""

    install(monkeypatch, takes)
    assert app.main(["show", *words]) == ExitCode.USAGE
    error, usage, help = capsys.readouterr().err.splitlines()
    assert error.startswith("error[usage]: ")
    assert named in error
    assert error.removeprefix("error[usage]: ")[0].islower()
    assert not error.endswith(".")
    assert usage.startswith("usage: rtshcua show [OPTIONS] ")
    assert help == " help: run `rtshcua show --help` for its options"


def test_typo_and_limit_have_the_common_error_format(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def takes(speed: Annotated[int, typer.Option(max=50)] = 1) -> None:
        """Does nothing."""

    install(monkeypatch, takes)
    assert app.main(["show", "--sped", "2"]) == ExitCode.USAGE
    assert capsys.readouterr().err.startswith("error[usage]: no such option: --sped; did you mean --speed?\n")
    assert app.main(["show", "--speed", "60"]) == ExitCode.USAGE
    assert "'--speed': it should be less than or equal to 50\n" in capsys.readouterr().err


def test_paragraphs_of_help_end_where_the_terminal_does(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def told() -> None:
        """Do a thing.

        A paragraph that is broken
        where the source ends a line.

        Another one.
        """

    install(monkeypatch, told)
    assert app.main(["show", "--help"]) == ExitCode.OK
    out = capsys.readouterr().out
    assert "A paragraph that is broken where the source ends a line." in out
    assert "line. Another" not in out


def test_misused_verb_names_the_verb(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    door = typer.Typer(add_completion=False)
    door.callback()(lambda: None)

    @door.command()
    def init(name: str) -> ExitCode:
        print(name)
        return ExitCode.INPUT

    monkeypatch.setattr(app, "import_module", lambda name: SimpleNamespace(app=door))
    assert app.main(["keys", "init", "x"]) == ExitCode.INPUT
    assert capsys.readouterr().out == "x\n"
    assert app.main(["keys", "init"]) == ExitCode.USAGE
    assert capsys.readouterr().err.endswith(" help: run `rtshcua keys init --help` for its options\n")
    assert app.main(["keys", "init", "-h"]) == ExitCode.OK
    assert app.main(["keys"]) == ExitCode.USAGE
    assert capsys.readouterr().err.endswith(" help: run `rtshcua keys --help` for its options\n")


def abort_at_the_end() -> typer.Abort:
    """The exception of a prompt at the end of the input."""
    try:
        try:
            raise EOFError
        except EOFError:
            raise typer.Abort from None
    except typer.Abort as error:
        return error


def test_output_after_an_interrupted_prompt_starts_on_a_new_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    door = typer.Typer()

    @door.command()
    def ask() -> None:
        sys.stderr.write("sign? [y/N]: ")
        raise typer.Abort

    monkeypatch.setattr(app, "import_module", lambda name: SimpleNamespace(app=door))
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    assert app.main(["check"]) == ExitCode.INTERRUPTED
    assert "[y/N]: \nerror: interrupted at a prompt" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (KeyboardInterrupt(), ExitCode.INTERRUPTED, "error: interrupted"),
        (typer.Abort(), ExitCode.INTERRUPTED, "error: interrupted at a prompt"),
        (EOFError(), ExitCode.INPUT, "error[input]: the input ended at a prompt"),
        (abort_at_the_end(), ExitCode.INPUT, "error[input]: the input ended at a prompt"),
        (BrokenPipeError(errno.EPIPE, "Broken pipe"), ExitCode.FULL, ""),
        (OSError(errno.ENOSPC, "No space left on device", "x"), ExitCode.FULL, "error: no space left on device: `x`"),
        (OSError("odd"), ExitCode.FULL, "error: odd"),
        (OSError(), ExitCode.FULL, "error: the system gave no reason"),
        (FileNotFoundError(errno.ENOENT, "No such file", "x"), ExitCode.INPUT, "error[input]: no such file: `x`"),
        (
            PermissionError(errno.EACCES, "Permission denied", "x"),
            ExitCode.INPUT,
            "error[input]: permission denied: `x`",
        ),
        (OSError(errno.EADDRINUSE, "Address already in use"), ExitCode.LINK, "error: address already in use"),
        (TimeoutError("timed out"), ExitCode.LINK, "error: timed out"),
    ],
)
def test_exception_becomes_one_line_and_an_exit_code(
    error: BaseException,
    code: ExitCode,
    message: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def breaks() -> None:
        raise error

    install(monkeypatch, breaks)
    assert app.main(["show"]) == code
    assert capsys.readouterr().err.strip() == message


def test_error_caused_by_ctrl_c_is_an_interrupt(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Named:
        def __set_name__(self, owner: type, name: str) -> None:
            raise KeyboardInterrupt

    def imports() -> None:
        type("Late", (), {"name": Named()})  # Python 3.11 makes a RuntimeError of it

    def gives_up() -> None:
        try:
            raise KeyboardInterrupt
        finally:
            raise ValueError("I/O operation on closed file")

    for breaks in (imports, gives_up):
        install(monkeypatch, breaks)
        assert app.main(["show"]) == ExitCode.INTERRUPTED
        assert capsys.readouterr().err == "error: interrupted\n"


@pytest.mark.parametrize("debug", ["", "0", "1"])
def test_traceback_requires_debug_variable(
    debug: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def breaks() -> None:
        raise LookupError("two\nlines")

    monkeypatch.setenv("RTSHCUA_DEBUG", debug)
    install(monkeypatch, breaks)
    assert app.main(["show"]) == ExitCode.FAULT
    err = capsys.readouterr().err
    assert "error: internal fault, please report it: LookupError: two lines\n" in err
    assert ("Traceback" in err) == (debug == "1")


def test_output_before_an_error_is_kept(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def breaks() -> None:
        print("half")
        raise FileNotFoundError(errno.ENOENT, "No such file", "x")

    install(monkeypatch, breaks)
    assert app.main(["show"]) == ExitCode.INPUT
    assert capsys.readouterr().out == "half\n"


def test_fail_gives_help() -> None:
    run = subprocess.run(
        [sys.executable, "-c", "from rtshcua.front.cli.faults import *; fail(ExitCode.INPUT, 'no', help='try')"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stderr == "error[input]: no\n help: try\n"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has a disk that is always full")
def test_full_disk_and_closed_pipe_end_without_traceback() -> None:
    with Path("/dev/full").open("w") as full:
        run = run_module("--help", capture_output=False, stdout=full, stderr=subprocess.PIPE)
    assert (run.returncode, run.stderr) == (ExitCode.FULL, "error: no space left on device\n")
    reader, writer = os.pipe()
    os.close(reader)
    run = run_module("--help", capture_output=False, stdout=writer, stderr=subprocess.PIPE)
    os.close(writer)
    assert (run.returncode, run.stderr) == (ExitCode.FULL, "")


def test_ascii_terminal_gets_escaped_text() -> None:
    program = "from rtshcua.front.cli import app; app.overview = lambda bold: 'height 20 m, heading 90°'; app.main([])"
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=environment, check=True)
    assert run.stdout == "height 20 m, heading 90\\xb0\n"


def test_every_code_of_the_system_leads_somewhere() -> None:
    assert {exit_code_of(OSError(number, "")) for number in errno.errorcode} == {
        ExitCode.INPUT,
        ExitCode.LINK,
        ExitCode.FULL,
    }
