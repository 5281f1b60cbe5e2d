"""Reads plain command lines of `check`, `lint` and `recall` without typer, whose start takes longer than they do.

Every other command line is left to typer: help, errors, abbreviations, and unlisted options.

Processor time of a command with this, against typer's: 0.66 for `check` of a short mission (bench/startup.py), 0.44
for `lint` of 20 files that it has seen before (bench/lint.py), 0.50 for `recall` (bench/recall.py). Two of them run in
commit hooks, and a recall must be fast. tests/unit/front/cli/test_fast_path.py compares the lists and the results with
typer.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from rtshcua.diagnostics.exits import ExitCode

Kind = Literal["flag", "text", "path", "paths"]

LINT: Mapping[str, tuple[str, Kind]] = {
    "--format": ("format", "text"),
    "--output": ("output", "path"),
    "-o": ("output", "path"),
    "--fail-on": ("fail_on", "text"),
    "--with": ("with_", "paths"),
    "--changed": ("changed", "flag"),
    "--base": ("base", "text"),
    "--fix": ("fix", "flag"),
    "--unsafe-fixes": ("unsafe_fixes", "flag"),
    "--diff": ("diff", "flag"),
    "--config": ("config", "path"),
    "--isolated": ("isolated", "flag"),
    "--no-cache": ("no_cache", "flag"),
    "--statistics": ("statistics", "flag"),
    "--json": ("json", "flag"),
}

CHECK: Mapping[str, tuple[str, Kind]] = {
    "--since": ("since", "path"),
    "--with": ("with_", "paths"),
    "--map": ("map_", "path"),
    "--picture": ("picture", "path"),
    "--at": ("at", "text"),
    "--deny-warnings": ("deny_warnings", "flag"),
    "--json": ("as_json", "flag"),
}

RECALL: Mapping[str, tuple[str, Kind]] = {
    "--policy": ("policy", "flag"),
    "--to": ("to", "path"),
    "--output": ("output", "path"),
    "-o": ("output", "path"),
    "--send": ("send", "path"),
    "--root": ("root", "path"),
    "--flight": ("flight", "text"),
    "--as": ("person", "text"),
    "--approval-key": ("approval_key", "path"),
    "--passphrase-file": ("passphrase_file", "path"),
    "--json": ("as_json", "flag"),
}


def read(words: Sequence[str], known: Mapping[str, tuple[str, Kind]]) -> tuple[tuple[Path, ...], dict[str, Any]] | None:
    """Return the paths of a command line and its options by name; None if typer must read it."""
    paths: list[Path] = []
    options: dict[str, Any] = {}
    left = iter(words)
    for word in left:
        if not word or word == "--":
            return None
        if not word.startswith("-"):
            paths.append(Path(word))
            continue
        option, equals, value = word.partition("=")
        if option not in known or (equals and not option.startswith("--")):
            return None
        name, kind = known[option]
        if kind == "flag":
            if equals:
                return None
            options[name] = True
            continue
        if not equals:
            value = next(left, "-")
        if not value or (value.startswith("-") and not equals):
            return None
        made = value if kind == "text" else Path(value)
        options[name] = (*options.get(name, ()), made) if kind == "paths" else made
    return tuple(paths), options


def lint(words: Sequence[str]) -> ExitCode | None:
    """Run `rtshcua lint`; None if typer must read the command line."""
    found = read(words, LINT)
    if found is None or not found[0]:
        return None
    from rtshcua.app.lint.scope import LintOptions
    from rtshcua.front.cli.render.lint_report import run

    return run(LintOptions(found[0], **found[1]))


def check(words: Sequence[str]) -> ExitCode | None:
    """Run `rtshcua check`; None if typer must read the command line."""
    found = read(words, CHECK)
    if found is None or not found[0]:
        return None
    from rtshcua.front.cli.render.check_report import check_sources

    return check_sources(found[0], **found[1])


def recall(words: Sequence[str]) -> ExitCode | None:
    """Run `rtshcua recall`; None if typer must read the command line."""
    found = read(words, RECALL)
    if found is None or len(found[0]) > 1:
        return None
    from rtshcua.front.cli import recalling

    return recalling.recall(next(iter(found[0]), None), **found[1])


COMMANDS: Mapping[str, Callable[[Sequence[str]], ExitCode | None]] = {"lint": lint, "check": check, "recall": recall}
