"""The static table of commands, which is all that `rtshcua --help` imports, so that it starts fast.

To add a command:

- the command `verify-log` lives in `rtshcua/front/cli/commands/verify_log.py`; nothing of it is imported before it is
  called;
- the module has `app = typer.Typer(add_completion=False)`. One `@app.command()` makes `rtshcua NAME ...`; for
  `rtshcua NAME VERB ...` give the app an `@app.callback()` too, over a function that does nothing, else a single verb
  would be swallowed;
- the function returns an `ExitCode`. It reports its own errors with `return fail(ExitCode.INPUT, "...")` of
  `rtshcua.front.cli.faults`; the barrier there handles OSError, Ctrl-C and faults;
- Ctrl-C ends the command at once by the signal, unless its row has `ends_in_order`, or the command uses a flag
  (`rtshcua.front.cli.interrupts`).
"""

from typing import NamedTuple


class Row(NamedTuple):
    """One command: its name, its group in `rtshcua --help`, and one line of help."""

    name: str
    group: str
    help: str
    fast_path: bool = False  # `rtshcua.front.cli.fast_path` reads its plain command lines without typer
    reports: bool = False  # `--json` prints the object of `Findings`, also if the command line is wrong
    ends_in_order: bool = False  # Ctrl-C raises KeyboardInterrupt, so that the command can clean up
    file: str = ""  # the name of its module, if that of the command is a keyword of Python

    @property
    def module(self) -> str:
        """The module that holds the command's `app`."""
        return f"rtshcua.front.cli.commands.{self.file or self.name.replace('-', '_')}"


COMMANDS = (
    Row(
        "check",
        "write",
        "report the errors in sources or a mission specification",
        reports=True,
        fast_path=True,
    ),
    Row(
        "lint",
        "write",
        "report errors and warnings; fix or ignore them; reports for CI",
        reports=True,
        fast_path=True,
    ),
    Row("fmt", "write", "format sources in one style", reports=True),
    Row("test", "write", "run the tests of sources, measure coverage, and generate tests", reports=True),
    Row(
        "campaign",
        "write",
        "fly a mission many times with random faults, and judge each flight",
        reports=True,
    ),
    Row("compile", "write", "check a mission and sign it into a bundle that can fly", reports=True),
    Row(
        "import",
        "write",
        "turn plans, KML, GeoJSON and official zones into sources",
        reports=True,
        file="import_file",
    ),
    Row("explain", "write", "print what a diagnostic code means, with a bad and a good example"),
    Row("docs", "write", "render skills and policies as one page for review and sign-off", reports=True),
    Row("schema", "write", "print the JSON Schema of a mission specification, for agents"),
    Row("init", "write", "create a project with a policy, a mission, tests and CI", ends_in_order=True),
    Row("lsp", "write", "run the language server for editors"),
    Row("completion", "write", "print a completion script for bash, zsh or fish"),
    Row("demo", "fly", "see four refusals and one flight of the simulated vehicle, in a minute", ends_in_order=True),
    Row("keys", "fly", "create, list, replace and revoke keys, and manage the trust root", ends_in_order=True),
    Row("run", "fly", "fly a bundle on the simulated vehicle, or with --connect on yours"),
    Row("approve", "fly", "approve or refuse a step that requires confirmation", ends_in_order=True),
    Row("recall", "fly", "recall a flight with your signature", fast_path=True),
    Row("operator", "fly", "follow a flight in a terminal, and recall it at once if needed"),
    Row("watch", "fly", "serve a page of a flight on this machine while it flies"),
    Row("replace", "fly", "send a replacement mission to a flight"),
    Row("gateway", "fly", "let MAVLink clients reach a vehicle only through a policy", ends_in_order=True),
    Row("mcp", "fly", "run an MCP server through which agents propose missions"),
    Row("agent-bundle", "fly", "make a plug-in with that server for OpenClaw and Claude"),
    Row("doctor", "fly", "report what a vehicle supports and what would stop a mission"),
    Row(
        "qualify",
        "fly",
        "flight-test an autopilot, and sign the result",
        reports=True,
        ends_in_order=True,
    ),
    Row("sim", "fly", "start the simulated vehicle alone, for any ground station", ends_in_order=True),
    Row("recover", "fly", "close the log of an interrupted flight"),
    Row("witness", "fly", "cosign logs, so that rewriting or cutting them is detected"),
    Row(
        "verify-log",
        "audit",
        "verify integrity, signatures and decisions of a log",
        ends_in_order=True,
    ),
    Row("bind", "audit", "bind the autopilot's own log of a flight to the evidence log"),
    Row("report", "audit", "render flights as pages to look at, and as a logbook", ends_in_order=True),
    Row("prove", "audit", "write a small proof of one record of a log, or of its consistency"),
    Row("verify-proof", "audit", "verify such a proof without the log"),
    Row("archive", "audit", "store many verified logs and query them", ends_in_order=True),
    Row("why", "audit", "explain a decision: what decided, and which values would pass"),
    Row("bench", "audit", "run the published evaluation on this computer", reports=True),
    Row("export", "audit", "write a flight as KML, GPX, GeoJSON, CSV, plan, MCAP or tlog"),
    Row("show", "audit", "print the contents of a bundle, key, trust root or log"),
)

GROUPS = {"write": "Write a mission", "fly": "Fly it", "audit": "Audit it"}

EXAMPLES = (
    ("rtshcua keys init", "once: development keys"),
    ("rtshcua compile missions/short.rts -o short.bundle", "check and sign"),
    ("rtshcua run short.bundle", "fly it in simulation"),
    ("rtshcua verify-log runs/*/log.jsonl", "verify the log"),
)


def find(name: str) -> Row | None:
    """Return the row of the command `name`, or None."""
    return next((row for row in COMMANDS if row.name == name), None)
