"""`--json`: every error is one JSON object on the standard output."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app, faults
from rtshcua.front.cli.table import COMMANDS
from rtshcua.wire.untrusted import Untrusted


@pytest.fixture(autouse=True)
def nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RTSHCUA_DATA_DIR", str(tmp_path / "data"))


@pytest.mark.parametrize(
    ("words", "code", "slug"),
    [
        ("run missing.bundle", ExitCode.INPUT, "input"),
        ("doctor --connect nowhere", ExitCode.USAGE, "usage"),
        ("doctor --connect udpin:127.0.0.1:1 missing.bundle", ExitCode.INPUT, "input"),
        ("approve missing.bundle --step 1 --to x", ExitCode.UNTRUSTED, "no-keys"),
        ("verify-log missing", ExitCode.UNTRUSTED, "no-keys"),
        ("show missing", ExitCode.INPUT, "input"),
        ("explain E9999", ExitCode.USAGE, "usage"),
        ("show", ExitCode.USAGE, "usage"),
        ("fly", ExitCode.USAGE, "usage"),
    ],
)
def test_every_error_is_one_object(words: str, code: ExitCode, slug: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main([*words.split(), "--json"]) == code
    said = capsys.readouterr()
    found: dict[str, Any] = json.loads(said.out)
    assert set(found) == {"error", "exit_code"}
    assert set(found["error"]) - {"at"} == {"slug", "text", "help"}
    assert (found["exit_code"], found["error"]["slug"]) == (code, slug)
    assert said.err.splitlines()[0] == f"error[{slug}]: {found['error']['text']}", "a person still reads it"


#: arguments of each command with a missing file as the only error; None if it takes no file
MISSING: dict[str, str | None] = {
    "check": "none.rts", "lint": "none.rts", "fmt": "none.rts", "test": "none.rts", "campaign": "none.rts",
    "compile": "none.rts", "docs": "none.rts", "explain": None, "schema": None, "init": None, "lsp": None,
    "completion": None, "keys": "accept none.trust --vehicle x", "run": "none.bundle",
    "approve": "none --step 1 --to x",
    "recall": "none --to x", "operator": None, "replace": "none --to x", "gateway": "none.toml", "mcp": None,
    "agent-bundle": "out --bundle none --with none.rts --to x", "doctor": "none --connect udpin:127.0.0.1:1",
    "qualify": "none.rts --connect udpin:127.0.0.1:1 --vehicle x --pilot x", "sim": None,
    "recover": "none", "witness": "none", "bind": "none none.ulg", "export": "none --to csv",
    "verify-log": "none", "prove": "none 1", "verify-proof": "none", "archive": "add none", "why": "none",
    "demo": None,
    "bench": "paper --campaign none", "import": "none.plan", "show": "none", "report": "none", "watch": "none --web",
}  # fmt: skip


@pytest.mark.parametrize("name", MISSING)
def test_a_missing_file_and_wrong_usage_have_one_form_in_all_commands(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert app.main(["keys", "init"]) == ExitCode.OK
    capsys.readouterr()
    cases = [(f"{name} --none-such", ExitCode.USAGE)]
    cases += [] if MISSING[name] is None else [(f"{name} {MISSING[name]}", ExitCode.INPUT)]
    members: list[set[str]] = []
    for words, code in cases:
        assert app.main([*words.split(), "--json"]) == code, words
        said = capsys.readouterr()
        found = json.loads(said.out)
        assert found["exit_code"] == code
        assert set(found["error"]) - {"at", "message"} == {"slug", "text", "help"}
        assert found["error"]["slug"] == code.slug
        assert found["error"]["help"] != ""
        assert said.err.startswith((f"error[{code.slug}]: ", "error[E0108]: ")) or not said.err
        members.append(set(found) - {"error", "exit_code"})
    assert all("diagnostics" in each for each in members) or not any(members), "its row says whether it `reports`"


def test_every_command_is_tried() -> None:
    assert MISSING.keys() == {row.name for row in COMMANDS}


def test_invalid_address_error_has_its_position(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["doctor", "--connect", "serial:/dev/ttyAMA0:57601", "--json"]) == ExitCode.USAGE
    at = json.loads(capsys.readouterr().out)["error"]["at"]
    assert at == {"option": "--connect", "value": "serial:/dev/ttyAMA0:57601", "start": 20, "end": 25}


def test_without_json_the_output_stays_empty(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["show", "missing", "--json"]) == app.main(["show", "missing"]) == ExitCode.INPUT
    assert len(capsys.readouterr().out.splitlines()) == 1


def test_json_after_double_dash_is_an_argument(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["show", "--", "--json"]) == ExitCode.INPUT
    assert capsys.readouterr().out == ""


def raising(error: BaseException) -> Callable[[], int]:
    def command() -> int:
        raise error

    return command


@pytest.mark.parametrize(
    ("error", "code", "slug"),
    [
        (KeyboardInterrupt(), ExitCode.INTERRUPTED, "interrupted"),
        (Untrusted("expired", "it has expired"), ExitCode.UNTRUSTED, "expired"),
        (Untrusted("malformed", "it is not CBOR"), ExitCode.INPUT, "malformed"),
        (RuntimeError("odd"), ExitCode.FAULT, "fault"),
    ],
)
def test_exceptions_become_json_errors(
    error: BaseException, code: ExitCode, slug: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with faults.as_json(wanted=True):
        assert faults.barrier(raising(error)) == code
    assert json.loads(capsys.readouterr().out)["error"]["slug"] == slug


def test_an_output_that_refuses_the_error_too(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*words: object, **options: object) -> None:
        raise BrokenPipeError

    monkeypatch.setattr("builtins.print", refuse)
    with faults.as_json(wanted=True):
        assert faults.fail(ExitCode.INPUT, "nothing there") == ExitCode.INPUT
