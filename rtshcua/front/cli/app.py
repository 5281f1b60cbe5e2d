"""The main program: `rtshcua COMMAND ...`. It looks up the command in the table, imports it, and runs it.

`rtshcua`, `rtshcua --help` and `rtshcua --version` import neither typer nor rich (bench/startup.py measures it).
"""

import gc
import io
import os
import re
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from importlib import import_module
from itertools import pairwise
from typing import Any, cast

from rtshcua import __version__
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.faults import as_json, barrier, fail
from rtshcua.front.cli.streams import mend_streams
from rtshcua.front.cli.table import COMMANDS, EXAMPLES, GROUPS, Row, find
from rtshcua.front.cli.width import fitted

#: thresholds of the garbage collector while sources are checked: syntax trees are many and long-lived
_COLLECTING = (50_000, 20, 100)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; raises nothing but SystemExit."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    mend_streams()
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a terminal without UTF-8 must not fail on a degree sign
    options = words[: words.index("--")] if "--" in words else words
    with as_json(wanted="--json" in options):
        return int(barrier(lambda: _dispatch(words)))


def _dispatch(words: list[str]) -> int:
    first, rest = (words[0], words[1:]) if words else ("--help", [])
    if first in ("--version", "-V"):
        print(f"rtshcua {__version__}")
        return ExitCode.OK
    if first == "help" and rest:
        first, rest = rest[0], ["--help"]
    if first in ("--help", "-h", "help"):
        print(overview(bold=_wants_colour()))
        return ExitCode.OK
    row = find(first)
    return _unknown(first) if row is None else _call(row, rest)


def _unknown(word: str) -> ExitCode:
    from rtshcua.diagnostics.suggest import nearest

    kind = "option" if word.startswith("-") else "command"
    near = nearest(word, [row.name for row in COMMANDS] + ["--help", "--version"])
    help = f"did you mean `rtshcua {near}`?" if near else "run `rtshcua --help` for a list of commands"
    return fail(ExitCode.USAGE, f"no such {kind}: `{word}`", help)


def _call(row: Row, words: list[str]) -> int:
    """Import the command of `row` and run it with typer, but report errors in our own format."""
    if _is_output_empty(words):  # an empty path would be the current folder
        return fail(ExitCode.USAGE, "`--output` has an empty value", "give the name of a file or folder")
    if row.fast_path:
        from rtshcua.front.cli import fast_path

        before = gc.get_threshold()
        gc.set_threshold(*_COLLECTING)
        try:
            code = fast_path.COMMANDS[row.name](words)
        finally:
            gc.set_threshold(*before)
        if code is not None:
            return code
    collecting = gc.isenabled()
    gc.disable()  # the loaded modules stay: collecting takes 10 % of a command's start
    try:
        import typer
        from typer.main import get_command

        from rtshcua.front.cli.interrupts import breakable
        from rtshcua.front.cli.options.option_groups import grouped

        command = get_command(import_module(row.module).app)
    finally:
        if collecting:
            gc.enable()
    _unguarded(command)
    _reflowed(command)
    grouped(command, row.name)
    try:
        with (
            command.make_context(f"rtshcua {row.name}", list(words), help_option_names=["-h", "--help"]) as context,
            breakable() if row.ends_in_order else nullcontext(),
        ):
            return int(cast("int | None", command.invoke(context)) or ExitCode.OK)
    except typer.Exit as end:
        return end.exit_code
    except (typer.Abort, EOFError) as error:  # Ctrl-C or the end of the input at a prompt
        if sys.stderr is not None and sys.stderr.isatty():
            sys.stderr.write("\n")  # the cursor is after the prompt
        if isinstance(error, EOFError) or isinstance(error.__context__, EOFError):
            return fail(ExitCode.INPUT, "the input ended at a prompt")
        return fail(ExitCode.INTERRUPTED, "interrupted at a prompt")
    except typer.TyperException as error:
        return _misused(row, error, words)


def _is_output_empty(words: list[str]) -> bool:
    """Whether the option `--output` is there without a name, in the words before `--`."""
    options = words[: words.index("--")] if "--" in words else words
    return "--output=" in options or any(pair in (("-o", ""), ("--output", "")) for pair in pairwise(options))


def _unguarded(command: object) -> None:
    """Disable typer's check of readable files: an unreadable file is bad input, not a wrong command line."""
    for parameter in getattr(command, "params", ()):
        described = getattr(parameter, "type_descriptor", None)
        each: Any
        for each in (getattr(described, "parameter_info", None), getattr(parameter, "type", None)):
            if hasattr(each, "readable"):
                each.readable = False
    for verb in getattr(command, "commands", {}).values():
        _unguarded(verb)


def _reflowed(command: object) -> None:
    """Join each paragraph of a command's help into one line, which typer wraps at the terminal's width; and mark the
    brackets in the help of its options as text: rich would drop them, with the defaults in them, as a style.
    """
    text = getattr(command, "help", None)
    if text:
        command.help = "\n\n".join(" ".join(each.split()) for each in text.split("\n\n"))  # type: ignore[attr-defined]
    for parameter in getattr(command, "params", ()):
        if getattr(parameter, "help", None):
            parameter.help = re.sub(r"(?<!\\)\[", r"\\[", parameter.help)
    for verb in getattr(command, "commands", {}).values():
        _reflowed(verb)


def _misused(row: Row, error: Exception, given: list[str]) -> ExitCode:
    """Report a wrong command line in the common error format, or as JSON for commands that report findings."""
    words = cast("str", error.format_message()).rstrip(".")  # type: ignore[attr-defined]
    context = getattr(error, "ctx", None)
    path = context.command_path if context is not None else f"rtshcua {row.name}"
    words = words.replace("Value error, ", "")  # typer's words for what an enumeration does not have
    words = words.replace(": Input should", ": it should")
    words = words.replace("a valid integer, unable to parse string as an integer", "a whole number")
    words, _, near = words.partition(" (Possible options: ")
    near = _meant(words, getattr(context, "command", None)) or near.rstrip(")")
    words = words.partition(" Did you mean ")[0].rstrip(".") if near else words
    words = f"{words}; did you mean {near}?" if near else words
    words = words[:1].lower() + words[1:]
    verb = re.fullmatch(r"no such command '(.*?)'(?:\. Did you mean (.*?))?\??", words, re.DOTALL)
    if verb is not None:
        meant = (verb[2] or "").replace("'", "").removeprefix("one of: ").partition(", ")[0]
        help = f"did you mean `{path} {meant}`?" if meant else f"run `{path} --help` for a list of commands"
        return fail(ExitCode.USAGE, f"no such command: `{path.partition(' ')[2]} {verb[1]}`", help)
    help = f"run `{path} --help` for its options"
    if row.reports and "--json" in given:
        from rtshcua.front.cli.render.findings import Findings

        return Findings(json=True).refuse(ExitCode.USAGE, "usage", words, help)
    usage = None if context is None else context.get_usage().removeprefix("Usage: ")
    return fail(ExitCode.USAGE, words, help, usage=usage)


def _meant(words: str, command: object) -> str:
    """Return the probable intention of an unknown option or value, or an empty text."""
    from rtshcua.diagnostics.suggest import nearest

    chosen = re.search(r"'([^']*)' is not one of (.+)$", words)
    if chosen is not None:
        return nearest(chosen[1], re.findall("'([^']*)'", chosen[2])) or ""
    option = re.match(r"[Nn]o such option: --([a-z-]+)", words)
    known = [each for parameter in getattr(command, "params", ()) for each in parameter.opts]
    return "" if option is None else " or ".join(each for each in known if each.endswith(f"-{option[1]}"))


def overview(*, bold: bool) -> str:
    """Return the text of `rtshcua --help`, from the table alone."""
    width = max(len(row.name) for row in COMMANDS)
    example_width = max(len(line) for line, _ in EXAMPLES)

    def head(text: str) -> str:
        return f"\033[1m{text}\033[0m" if bold else text

    lines = [
        f"{head('rtshcua')} {__version__}: an agent may propose what a drone does,",
        "and can never make the drone do it",
        "",
        f"{head('usage')}  rtshcua COMMAND [OPTIONS] ...",
    ]
    for group, title in GROUPS.items():
        lines += ["", head(title)]
        for row in COMMANDS:
            lines += fitted(f"  {row.name:<{width}}  {row.help}") if row.group == group else []
    lines += ["", head("For example")]
    for line, what in EXAMPLES:
        lines += fitted(f"  {line:<{example_width}}  {what}")
    lines += [
        "",
        head("Options"),
        f"  {'-h, --help':<{width + 3}}  print this help; `rtshcua COMMAND --help` for one command",
        f"  {'-V, --version':<{width + 3}}  print the version",
    ]
    return "\n".join(lines)


def _wants_colour() -> bool:
    terminal = sys.stdout is not None and sys.stdout.isatty()
    return terminal and "NO_COLOR" not in os.environ and os.environ.get("TERM") != "dumb"
