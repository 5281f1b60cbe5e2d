"""Commands with many options show them in groups."""

from collections.abc import Iterator
from importlib import import_module

import pytest
from typer.main import get_command

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main
from rtshcua.front.cli.options.option_groups import MANY, OPTION_GROUPS, grouped
from rtshcua.front.cli.table import COMMANDS

#: options that every command may list under `Options`
COMMON = {"--json", "--plain", "--help", "--deny-warnings", "--archive", "-a"}


def commands() -> Iterator[tuple[str, object]]:
    for row in COMMANDS:
        command = get_command(import_module(row.module).app)
        grouped(command, row.name)
        verbs = getattr(command, "commands", None)
        yield from (((f"{row.name} {verb}", each) for verb, each in verbs.items()) if verbs else [(row.name, command)])


def options(command: object) -> list[list[str]]:
    return [each.opts for each in command.params if each.opts[0].startswith("-")]  # type: ignore[attr-defined]


def test_commands_with_many_options_group_each_option() -> None:
    for name, command in commands():
        found = options(command)
        groups = OPTION_GROUPS.get(name, {})
        assert groups or len(found) <= MANY, name
        listed = [option for group in groups.values() for option in group]
        assert len(listed) == len(set(listed)), name
        if groups:
            loose = [each for each in found if not {*each} & {*listed}]
            assert {option for each in loose for option in each} <= COMMON, name
            assert {*listed} <= {option for each in found for option in each}, f"{name}: no such option"


def test_every_group_is_of_a_command_that_there_is() -> None:
    assert {*OPTION_GROUPS} <= {name for name, _ in commands()}


@pytest.mark.parametrize("name", ["run", "sim", "compile", "archive query"])
def test_the_help_shows_the_groups_in_their_order(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*name.split(), "--help"]) == ExitCode.OK
    text = capsys.readouterr().out
    places = [text.index(f" {title} ─") for title in OPTION_GROUPS[name]]
    assert places == sorted(places)


def test_arguments_keep_their_order() -> None:
    for row in COMMANDS:
        plain, changed = (get_command(import_module(row.module).app) for _ in range(2))
        grouped(changed, row.name)
        before, after = (
            [each.name for each in getattr(one, "params", []) if not each.opts[0].startswith("-")]
            for one in (plain, changed)
        )
        assert before == after
