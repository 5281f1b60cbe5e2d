"""The groups in which `--help` shows the options of commands with many options."""

from collections.abc import Mapping
from typing import Any, Final

#: by command: the title of each group and its options in order; other options come first, under `Options`
OPTION_GROUPS: Final[Mapping[str, Mapping[str, tuple[str, ...]]]] = {
    "run": {
        "The vehicle": (
            "--connect", "--vehicle", "--system", "--signing-key", "--unsigned-radio", "--set", "--no-fence",
            "--utc-error",
        ),
        "The simulated vehicle (without --connect)": (
            "--speed", "--flavour", "--battery", "--wind", "--fault", "--seed", "--scenario", "--fresh-state",
        ),
        "The flight": ("--dry-run", "--wait", "--wait-for", "--live", "--idle"),
        "Agents, operators, witnesses": ("--agent-socket", "--agent-group", "--operator-socket", "--witness"),
        "The enforcement boundary": ("--mode", "--boundary-user", "--boundary-socket"),
        "Keys and trust": ("--root", "--log-key", "--boundary-key", "--passphrase-file"),
        "Folders": ("--runs", "--state-dir"),
    },
    "sim": {
        "The link": ("--port", "--connect", "--usb", "--system", "--signing-key", "--answers"),
        "The vehicle": (
            "--flavour", "--stock", "--camera", "--gimbal", "--release", "--home", "--battery", "--speed",
            "--parameter", "--boot", "--estimate",
        ),
        "Wind and faults": ("--wind", "--fault", "--seed"),
    },
    "gateway": {
        "The policy": ("--allow", "--below", "--inside", "--save", "--policy", "--bundle"),
        "Clients": ("--client", "--pilot"),
        "The vehicle": (
            "--connect", "--vehicle", "--system", "--signing-key", "--unsigned-radio", "--set", "--utc-error",
        ),
        "The simulated vehicle (without --connect)": ("--flavour", "--battery", "--wind", "--fault", "--seed"),
        "Sessions, operators, keys": (
            "--sessions", "--operator-socket", "--passphrase-file", "--runs", "--state-dir",
        ),
    },
    "compile": {
        "The mission": ("--mission", "--set", "--with", "--at", "--output", "--picture"),
        "Accepted claims": ("--source", "--role", "--policy"),
        "Replacement for a flight under way": ("--replaces", "--from", "--flight", "--root"),
        "Keys": ("--policy-key", "--mission-key", "--passphrase-file"),
    },
    "approve": {
        "The answer": ("--step", "--role", "--refuse", "--for", "--other-path", "--yes"),
        "Waiting for questions": ("--wait", "--page", "--runs"),
        "The flight": ("--to", "--flight", "--output", "--replacement"),
        "Signer": ("--as", "--approval-key", "--passphrase-file", "--root"),
    },
    "qualify": {
        "The vehicle": (
            "--connect", "--vehicle", "--system", "--sitl", "--signing-key", "--unsigned-radio", "--no-fence",
            "--utc-error",
        ),
        "The test": ("--pilot", "--takeover", "--only", "--mission", "--speed"),
        "Folders and keys": ("--runs", "--passphrase-file"),
    },
    "lint": {
        "Input": ("--with", "--changed", "--base", "--config", "--isolated", "--no-cache"),
        "Fixes": ("--fix", "--unsafe-fixes", "--diff"),
        "Report": ("--format", "--output", "--statistics", "--fail-on"),
    },
    "test": {
        "Selection": ("-k", "--config", "--isolated"),
        "Report": ("--coverage", "--fail-under", "--verbose", "--junit"),
        "Generate tests": ("--generate", "--policy", "--skill", "--nominal", "--output", "--force"),
    },
    "campaign": {
        "The flights": ("--flights", "--seed", "--mission", "--with", "--flavour", "--fault", "--approve", "--at"),
        "Execution": ("--jobs", "--cluster", "--output", "--no-shrink"),
    },
    "archive query": {
        "The query": ("--sql", "--show-sql"),
        "Filters": (
            "--vehicle", "--mission", "--skill", "--outcome", "--reason", "--clause", "--rule", "--policy", "--since",
            "--until", "--witness",
        ),
        "The result": ("--limit", "--csv"),
    },
}  # fmt: skip
#: a command with more options than this must have groups
MANY: Final = 12


def grouped(command: object, name: str) -> None:
    """Assign the options of a typer command to their groups, in order."""
    for verb, each in getattr(command, "commands", {}).items():
        grouped(each, f"{name} {verb}")
    groups = OPTION_GROUPS.get(name)
    if groups is None:
        return
    order = {option: number for number, option in enumerate(option for group in groups.values() for option in group)}
    title = {option: title for title, options in groups.items() for option in options}
    parameters: list[Any] = getattr(command, "params", [])
    for parameter in parameters:
        found = next((option for option in getattr(parameter, "opts", ()) if option in title), None)
        if found is not None:
            parameter.rich_help_panel = title[found]
    parameters.sort(
        key=lambda one: min((order[each] for each in getattr(one, "opts", ()) if each in order), default=-1)
    )
