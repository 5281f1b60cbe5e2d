"""The options of commands that have many, in the groups in which `--help` shows them."""

from collections.abc import Mapping
from typing import Final

#: by command, the title of each group, and its options in their order; what is in none stands first, under `Options`
OPTION_GROUPS: Final[Mapping[str, Mapping[str, tuple[str, ...]]]] = {
    "run": {
        "The vehicle": (
            "--connect", "--vehicle", "--system", "--signing-key", "--unsigned-radio", "--set", "--no-fence",
            "--utc-error",
        ),
        "Without --connect: the simulated vehicle": (
            "--speed", "--flavour", "--battery", "--wind", "--fault", "--seed", "--scenario", "--fresh-state",
        ),
        "How it flies": ("--dry-run", "--wait", "--wait-for"),
        "Agents, operators, witnesses": ("--agent-socket", "--agent-group", "--operator-socket", "--witness"),
        "Where decisions are made": ("--mode", "--boundary-user", "--boundary-socket"),
        "Keys and trust": ("--root", "--log-key", "--boundary-key", "--passphrase-file"),
        "What is kept, and where": ("--runs", "--state-dir"),
    },
    "sim": {
        "The link": ("--port", "--connect", "--usb", "--system", "--signing-key", "--answers"),
        "The vehicle": (
            "--flavour", "--stock", "--release", "--home", "--battery", "--speed", "--parameter", "--boot",
            "--estimate",
        ),
        "What goes wrong": ("--wind", "--fault", "--seed"),
    },
    "compile": {
        "The mission": ("--mission", "--set", "--with", "--at", "--output"),
        "What it may claim": ("--source", "--role", "--policy"),
        "For a flight under way": ("--replaces", "--from", "--flight", "--root"),
        "Keys": ("--policy-key", "--mission-key", "--passphrase-file"),
    },
    "approve": {
        "The answer": ("--step", "--role", "--refuse", "--for", "--other-path", "--yes"),
        "Which flight": ("--to", "--flight", "--output", "--replacement"),
        "Who signs": ("--as", "--approval-key", "--passphrase-file", "--root"),
    },
    "qualify": {
        "The vehicle": (
            "--connect", "--vehicle", "--system", "--sitl", "--signing-key", "--unsigned-radio", "--no-fence",
            "--utc-error",
        ),
        "The test": ("--pilot", "--takeover", "--only", "--mission", "--speed"),
        "What is kept, and where": ("--runs", "--passphrase-file"),
    },
    "lint": {
        "What is looked at": ("--with", "--changed", "--base", "--config", "--isolated", "--no-cache"),
        "What is mended": ("--fix", "--unsafe-fixes", "--diff"),
        "What is told": ("--format", "--output", "--statistics", "--fail-on"),
    },
    "test": {
        "Which tests": ("-k", "--config", "--isolated"),
        "What is told": ("--coverage", "--fail-under", "--verbose", "--junit"),
        "Write tests": ("--generate", "--policy", "--skill", "--nominal", "--output", "--force"),
    },
    "campaign": {
        "The flights": ("--flights", "--seed", "--mission", "--with", "--flavour", "--fault", "--approve", "--at"),
        "How they are flown": ("--jobs", "--cluster", "--output", "--no-shrink"),
    },
    "archive query": {
        "The question": ("--sql", "--show-sql"),
        "Which decisions": (
            "--vehicle", "--mission", "--skill", "--outcome", "--reason", "--clause", "--rule", "--policy", "--since",
            "--until", "--witness",
        ),
        "The answer": ("--limit", "--csv"),
    },
}  # fmt: skip
#: a command with more options than this has groups
MANY: Final = 12


def grouped(command: object, name: str) -> None:
    """Give each option of a command (of typer's) the group that it is shown in, the groups in their order."""
    for verb, each in getattr(command, "commands", {}).items():
        grouped(each, f"{name} {verb}")
    groups = OPTION_GROUPS.get(name)
    if groups is None:
        return
    order = {option: number for number, option in enumerate(option for group in groups.values() for option in group)}
    title = {option: title for title, options in groups.items() for option in options}
    parameters = command.params  # type: ignore[attr-defined]
    for parameter in parameters:
        found = next((option for option in getattr(parameter, "opts", ()) if option in title), None)
        if found is not None:
            parameter.rich_help_panel = title[found]
    parameters.sort(
        key=lambda one: min((order[each] for each in getattr(one, "opts", ()) if each in order), default=-1)
    )
