"""The static table of commands: all that `rtshcua --help` reads, so that start-up stays fast as commands grow.

To add a command:

- the command `verify-log` lives in `rtshcua/front/cli/commands/verify_log.py`; nothing of it is imported before it is
  called;
- the module has `app = typer.Typer(add_completion=False)`. One `@app.command()` makes `rtshcua NAME ...`; for
  `rtshcua NAME VERB ...` give the app an `@app.callback()` too, over a function that does nothing, else a single verb
  would be swallowed;
- the function returns an `ExitCode`. It reports what it refuses itself, in one way for all: `return
  fail(ExitCode.INPUT, "...")` from `rtshcua.front.cli.faults`; OSError, Ctrl-C and faults rise to the barrier there;
- Ctrl-C ends it at once, by the signal, unless its row says that it ends in order, or it sets a flag instead
  (`rtshcua.front.cli.interrupts`).
"""

from typing import NamedTuple


class Row(NamedTuple):
    """One command: its name on the command line, the group it is shown in, and one line of help."""

    name: str
    group: str
    help: str
    fast_path: bool = False  # plain command lines of it are read by `rtshcua.front.cli.fast_path`, without typer
    reports: bool = False  # its `--json` is that of `Findings`, also where the command line is wrong
    ends_in_order: bool = False  # Ctrl-C raises in it, for something is put in order; else the signal ends it

    @property
    def module(self) -> str:
        """The module that holds the command's `app`."""
        return f"rtshcua.front.cli.commands.{self.name.replace('-', '_')}"


COMMANDS = (
    Row(
        "check",
        "write",
        "report everything that is wrong with sources or a mission specification",
        reports=True,
        fast_path=True,
    ),
    Row(
        "lint",
        "write",
        "report that and what is worth a second look; fix it, ignore it, for CI too",
        reports=True,
        fast_path=True,
    ),
    Row("fmt", "write", "lay sources out in the one style; comments stay where they are", reports=True),
    Row("test", "write", "run the tests of sources, say what they cover, and write tests for each limit", reports=True),
    Row(
        "campaign",
        "write",
        "fly a mission thousands of times with faults drawn by chance, and judge each",
        reports=True,
    ),
    Row("compile", "write", "check a mission and sign it into a bundle that can fly", reports=True),
    Row("explain", "write", "print what a diagnostic code means, with a bad and a good example"),
    Row("docs", "write", "render skills and policies as one page that a person can sign off on", reports=True),
    Row("schema", "write", "print the JSON Schema of a mission specification, for agents"),
    Row("init", "write", "make a project of your own, with policy, mission, tests and CI", ends_in_order=True),
    Row("lsp", "write", "serve an editor: findings while you write, hover, renaming, completion"),
    Row("completion", "write", "print a script by which bash, zsh or fish complete commands"),
    Row("keys", "fly", "make, list, replace and revoke keys, and the trust root", ends_in_order=True),
    Row("run", "fly", "fly a bundle on the simulated vehicle, or on yours with --connect"),
    Row("approve", "fly", "answer a step that asks for confirmation, with your signature", ends_in_order=True),
    Row("recall", "fly", "call a flight home, with your signature", fast_path=True),
    Row("operator", "fly", "follow a flight, and hold its recall ready: one key calls it home"),
    Row("replace", "fly", "hand a flight the mission that takes the place of its own"),
    Row("mcp", "fly", "let an agent's host propose missions to a vehicle that waits (MCP)"),
    Row("agent-bundle", "fly", "make a plug-in of that for hosts of agents: OpenClaw, Claude"),
    Row("doctor", "fly", "say what a vehicle supports, and what would stop a mission"),
    Row(
        "qualify",
        "fly",
        "fly a short test of the autopilot itself, and sign the result",
        reports=True,
        ends_in_order=True,
    ),
    Row("sim", "fly", "start the simulated vehicle alone, for any MAVLink ground station", ends_in_order=True),
    Row("recover", "fly", "end the log of a flight that broke off, and lose nothing of it"),
    Row("witness", "fly", "cosign logs from the ground, so that they cannot be rewritten or cut"),
    Row(
        "verify-log",
        "audit",
        "prove that a flight's log is whole, signed, and decides the same again",
        ends_in_order=True,
    ),
    Row("prove", "audit", "prove one record of a log, or that nothing changed since, in a small file"),
    Row("verify-proof", "audit", "verify such a file, which needs no log"),
    Row("archive", "audit", "keep many logs, verified, and ask them questions", ends_in_order=True),
    Row("why", "audit", "show a decision step by step: what decided, and what would have passed"),
    Row("show", "audit", "print a bundle, a key, a trust root or a log for a person"),
)

GROUPS = {"write": "Write a mission", "fly": "Fly it", "audit": "Audit it"}

EXAMPLES = (
    ("rtshcua keys init", "once: a development root and its keys"),
    ("rtshcua compile missions/short.rts -o short.bundle", "check, sign"),
    ("rtshcua run short.bundle", "fly it on the simulated vehicle"),
    ("rtshcua verify-log runs/*/log.jsonl", "prove what happened"),
)


def find(name: str) -> Row | None:
    """The row of the command called `name`, or None."""
    return next((row for row in COMMANDS if row.name == name), None)
