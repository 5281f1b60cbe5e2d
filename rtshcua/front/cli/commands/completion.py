"""`rtshcua completion`: a script that lets a shell complete what is typed after `rtshcua`."""

import sys
from enum import Enum
from typing import Annotated

import typer

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.faults import say, say_lines

app = typer.Typer(add_completion=False)


class Shell(Enum):
    """The shells that scripts are for."""

    BASH = "bash"
    ZSH = "zsh"
    FISH = "fish"


#: where each shell looks for a script by itself
PLACES = {
    Shell.BASH: "~/.local/share/bash-completion/completions/rtshcua",
    Shell.ZSH: "~/.zfunc/_rtshcua",
    Shell.FISH: "~/.config/fish/completions/rtshcua.fish",
}

_ZSH = "and in ~/.zshrc, before `compinit`: fpath+=~/.zfunc"


@app.command()
def completion(shell: Annotated[Shell, typer.Argument(help="which shell the script is for")]) -> ExitCode:
    """Print a script by which a shell completes commands, options, their values, codes and files. It starts nothing.

    Keep it where the shell looks for it: bash in ~/.local/share/bash-completion/completions/rtshcua, fish in
    ~/.config/fish/completions/rtshcua.fish, zsh under the name _rtshcua in a folder of its `fpath`.

    The script is of this version: print it again after an update.
    """
    import shtab

    from rtshcua.front.cli.options.completing.commands import parser

    print(shtab.complete(parser(), shell.value))
    if sys.stdout.isatty():
        say(f"to install it: rtshcua completion {shell.value} > {PLACES[shell]}")
        if shell is Shell.ZSH:
            say_lines(_ZSH)
    return ExitCode.OK
