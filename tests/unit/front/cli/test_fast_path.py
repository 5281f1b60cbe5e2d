"""Simple command lines are parsed without typer, with the same result."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.main import get_command

from rtshcua.app.lint.scope import LintOptions
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import fast_path
from rtshcua.front.cli.app import main
from rtshcua.front.cli.commands import check, lint, recall
from rtshcua.front.cli.table import COMMANDS

COMMAND = {"lint": (lint, fast_path.LINT), "check": (check, fast_path.CHECK), "recall": (recall, fast_path.RECALL)}
#: command lines that the fast path leaves to typer
LEFT = {"recall": {"--for"}}


@pytest.mark.parametrize("name", COMMAND)
def test_both_know_the_same_options(name: str) -> None:
    module, known = COMMAND[name]
    declared: dict[str, Any] = {}
    for parameter in get_command(module.app).params:
        kind = "flag" if getattr(parameter, "is_flag", False) else "paths" if parameter.multiple else "value"
        declared |= {option: (parameter.name, kind) for option in parameter.opts if option.startswith("-")}
    for option in {"--help", *LEFT.get(name, ())}:
        declared.pop(option, None)
    plain = {"text": "value", "path": "value"}
    names = {"json": "as_json"} if name == "lint" else {}
    assert declared == {each: (names.get(to, to), plain.get(kind, kind)) for each, (to, kind) in known.items()}


def test_the_table_says_which_commands_have_one() -> None:
    assert {row.name for row in COMMANDS if row.fast_path} == set(fast_path.COMMANDS)


WORDS = st.one_of(
    st.sampled_from(
        [*fast_path.LINT, "--", "-", "", "--help", "-h", "--fixx", "--no-fix", "-ox", "--output=", "--json=1"]
    ),
    st.sampled_from(["a.rts", "b", "--format=json", "--with=c", "--base=x", "human", "--output=-x", "-o=1"]),
)


@given(st.lists(WORDS, max_size=6))
def test_typer_reads_the_same_words_the_same_way(words: list[str]) -> None:
    found = fast_path.read(words, fast_path.LINT)
    if found is None or not found[0]:
        return
    given: list[LintOptions] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lint, "run", lambda options: given.append(options) or ExitCode.OK)
        command = get_command(lint.app)
        with command.make_context("rtshcua lint", list(words), help_option_names=["-h", "--help"]) as context:
            command.invoke(context)
    assert given == [LintOptions(found[0], **found[1])]
    assert all(isinstance(path, Path) for path in found[0])


def test_other_command_lines_are_left_to_typer(capsys: pytest.CaptureFixture[str]) -> None:
    assert fast_path.lint([]) is fast_path.lint(["--fix"]) is fast_path.check(["--json"]) is None
    for words in (
        ["--help"],
        ["a.rts", "--formt", "json"],
        ["a.rts", "--format"],
        ["a.rts", "--json=1"],
    ):
        assert fast_path.read(words, fast_path.LINT) is None, words
    assert main(["check", "--since"]) == ExitCode.USAGE
    assert "requires an argument" in capsys.readouterr().err.lower()
