"""`rtshcua completion`: print a completion script for a shell."""

import sys
from enum import Enum
from typing import Annotated

import typer

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.faults import say, say_lines

app = typer.Typer(add_completion=False)


class Shell(Enum):
    """The supported shells."""

    BASH = "bash"
    ZSH = "zsh"
    FISH = "fish"


#: where each shell finds the script
PLACES = {
    Shell.BASH: "~/.local/share/bash-completion/completions/rtshcua",
    Shell.ZSH: "~/.zfunc/_rtshcua",
    Shell.FISH: "~/.config/fish/completions/rtshcua.fish",
}

_ZSH = "and in ~/.zshrc, before `compinit`: fpath+=~/.zfunc"


@app.command()
def completion(shell: Annotated[Shell, typer.Argument(help="the shell")]) -> ExitCode:
    """Print a shell script that completes commands, options, values, codes and files. It runs no program.

    Save it where the shell finds it: bash: ~/.local/share/bash-completion/completions/rtshcua; fish:
    ~/.config/fish/completions/rtshcua.fish; zsh: as _rtshcua in a folder of `fpath`.

    The script is for this version: print it again after an update.
    """
    import shtab

    from rtshcua.front.cli.options.completing.commands import parser

    print(shtab.complete(parser(), shell.value))
    if sys.stdout.isatty():
        say(f"to install it: rtshcua completion {shell.value} > {PLACES[shell]}")
        if shell is Shell.ZSH:
            say_lines(_ZSH)
    return ExitCode.OK
