"""Build one argparse parser of all commands, from which shtab generates completion scripts."""

import argparse
from enum import Enum
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import shtab
from typer.main import get_command

from rtshcua.front.cli.options.completing.values import FOLDERS, patterns, words
from rtshcua.front.cli.table import COMMANDS


def parser() -> argparse.ArgumentParser:
    """Return a parser of all commands, options and values; it is not used for parsing. Imports every command."""
    root = argparse.ArgumentParser("rtshcua")
    root.add_argument("-V", "--version", action="store_true", help="the version")
    commands = root.add_subparsers(required=True, metavar="COMMAND")
    for row in COMMANDS:
        made = commands.add_parser(row.name, help=_help(row.help), description=row.help)
        _fill(made, row.name, get_command(import_module(row.module).app))
    helping = commands.add_parser("help", help="print the help of a command", description="print the help of a command")
    helping.add_argument("command", nargs="?", choices=words("help", "command"), help="a command")
    return root


def _fill(made: argparse.ArgumentParser, name: str, command: Any) -> None:
    verbs = getattr(command, "commands", {})
    if verbs:
        inner = made.add_subparsers(required=True, metavar="VERB")
        for verb, each in verbs.items():
            line = (each.help or "").strip().split("\n")[0]
            _fill(inner.add_parser(verb, help=_help(line), description=line), f"{name} {verb}", each)
    for parameter in command.params:
        if not getattr(parameter, "hidden", False):
            _add(made, name, parameter)


def _add(made: argparse.ArgumentParser, command: str, parameter: Any) -> None:
    """Add one typer option or argument."""
    help = _help(getattr(parameter, "help", None) or parameter.name)
    if parameter.param_type_name == "argument":
        action = made.add_argument(parameter.name, nargs=_count(parameter), help=help)
    elif getattr(parameter, "is_flag", False):
        made.add_argument(
            *_dashed(parameter.opts),
            *_dashed(parameter.secondary_opts),
            action="store_true",
            dest=parameter.name,
            help=help,
        )
        return
    else:
        kind: Literal["append", "store"] = "append" if parameter.multiple else "store"
        action = made.add_argument(*_dashed(parameter.opts), action=kind, dest=parameter.name, help=help)
    _describe(action, command, parameter)


def _describe(action: argparse.Action, command: str, parameter: Any) -> None:
    """Set the choices or the file patterns of an argument."""
    kind = parameter.type_descriptor.annotation
    while get_origin(kind) is list:
        (kind,) = get_args(kind)
    known = words(command, parameter.name)
    if known:
        action.choices = known
    elif get_origin(kind) is Literal:
        action.choices = tuple(str(each) for each in get_args(kind))
    elif isinstance(kind, type) and issubclass(kind, Enum):
        action.choices = tuple(str(each.value) for each in kind)
    elif isinstance(kind, type) and issubclass(kind, Path):
        wanted = patterns(command, parameter.name)
        files = shtab.DIRECTORY if parameter.name in FOLDERS else shtab.glob(*wanted) if wanted else shtab.FILE
        action.complete = files  # type: ignore[attr-defined]


def _count(parameter: Any) -> str | None:
    if parameter.nargs == -1:
        return "*"
    return None if parameter.required else "?"


def _dashed(names: list[str]) -> list[str]:
    return [name for name in names if name.startswith("-")]


def _help(text: str) -> str:
    """Return a help text on one line, escaped for argparse."""
    return " ".join(text.split()).replace("%", "%%")
