"""`rtshcua agent-bundle`: make a plug-in for agent hosts with the MCP server, a skill and a hook."""

import json
import os
import shlex
import sys
from pathlib import Path
from typing import Annotated, Final

import typer

from rtshcua import __version__
from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.laying import lay
from rtshcua.adapters.store.reading import read_regular
from rtshcua.app.documents import read_bundle
from rtshcua.app.exit_codes import words_of
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.faults import distrust, fail
from rtshcua.front.cli.stdout import out, out_json
from rtshcua.library import root
from rtshcua.wire import cose
from rtshcua.wire.bundle import MAX_BUNDLE, envelopes, policy_digest, policy_payload
from rtshcua.wire.untrusted import Untrusted

app = typer.Typer(add_completion=False)

#: the name of the plug-in and its server; hosts prefix the tool names with it
NAME: Final = "rtshcua"
#: files copied unchanged from `examples/agent`
COPIED: Final = (f"skills/{NAME}/SKILL.md", "hooks/keep_out.py")
#: tools of a host that can access files
_REACHING: Final = "Bash|Read|Edit|Write|NotebookEdit"
_DATA: Final = "RTSHCUA_DATA_DIR"
#: environment variables that set the user's data directory; hosts do not pass them to the servers that they start
_CHOOSING: Final = (_DATA, "XDG_DATA_HOME")


@app.command("agent-bundle")
def agent_bundle(
    directory: Annotated[Path, typer.Argument(help="folder of the new plug-in")],
    bundle: Annotated[Path, typer.Option(help="the bundle of `rtshcua run --wait`, whose policy is in force")],
    to: Annotated[Path, typer.Option(metavar="SOCKET", help="agent socket of the waiting vehicle")],
    with_: Annotated[list[Path], typer.Option("--with", help="sources of that policy (repeatable)")],
    mission_key: Annotated[Path | None, typer.Option(help="the agent's mission key [default: the key store's]")] = None,
    passphrase_file: Annotated[Path | None, typer.Option(help="file with the passphrase of the key")] = None,
    force: Annotated[bool, typer.Option("--force", help="replace existing files of the plug-in")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object on standard output")] = False,
) -> ExitCode:
    """Make a plug-in for agent hosts (OpenClaw, Claude): the MCP server, a skill that explains it, and a hook that
    blocks the model's access to the key store and the socket.

    The plug-in refers to BUNDLE, SOCKET, the sources and the key by absolute paths, and contains no key, passphrase or
    bundle. Installation: docs/agents.md. The sources must compile to exactly the policy of BUNDLE.

    Exit codes: 0 created; 3 a file cannot be read or is damaged, the policy differs, or files of these names exist; 74
    the files cannot be written.
    """
    from rtshcua.app.propose import Missions, NoPolicy

    try:
        envelope, _ = envelopes(read_bundle(bundle))
        signed = policy_digest(cose.unverified(envelope, limit=MAX_BUNDLE).payload)
    except Untrusted as error:
        return distrust(error)
    for path in (*with_, *(each for each in (mission_key, passphrase_file) if each is not None)):
        read_regular(path, 1)
    try:
        policy = Missions(with_).policy
    except NoPolicy as error:
        return fail(ExitCode.INPUT, str(error), "run `rtshcua check` on them", slug="no-policy")
    if policy_digest(policy_payload(policy)) != signed:
        text = f"the policy of the sources, `{policy.name}@{policy.version}`, differs from the policy of `{bundle}`"
        return fail(ExitCode.INPUT, text, "compile BUNDLE from these sources", slug="wrong-policy")
    words = ["mcp", _whole(bundle), "--to", _whole(to), *(word for path in with_ for word in ("--with", _whole(path)))]
    for option, key in (("--mission-key", mission_key), ("--passphrase-file", passphrase_file)):
        words += [] if key is None else [option, _whole(key)]
    files = plugin(words, _whole(to), f"{policy.name}@{policy.version}", policy.vehicle.name)
    try:
        taken = lay(files, directory, replace=force)
    except OSError as error:
        return fail(ExitCode.FULL, f"cannot write to `{directory}`: {words_of(error)}")
    if taken is not None:
        there = ", ".join(f"`{path}`" for path in taken.paths)
        return fail(
            ExitCode.INPUT,
            f"no file was created, because these exist: {there}",
            "use `--force` to replace them",
            slug="exists",
        )
    if as_json:
        out_json(json.dumps({"folder": _whole(directory), "files": [*files]}, ensure_ascii=False))
        return ExitCode.OK
    out(f"created a plug-in for {policy.vehicle.name} under {policy.name}@{policy.version} in {directory.absolute()}")
    out(f"Claude Code: claude --plugin-dir {shlex.quote(_whole(directory))}")
    out(f"OpenClaw:    openclaw plugins install {shlex.quote(_whole(directory))}")
    return ExitCode.OK


def plugin(words: list[str], socket: str, policy: str, vehicle: str) -> dict[str, bytes]:
    """Return the files of a plug-in by their relative paths; `words`: the arguments of its server."""
    script = Path(sys.executable).parent / NAME
    command = [str(script)] if script.is_file() else [sys.executable, "-P", "-m", "rtshcua"]
    server: dict[str, object] = {"command": command[0], "args": [*command[1:], *words]}
    if any(map(os.environ.get, _CHOOSING)):
        server["env"] = {_DATA: _whole(data_folder())}
    manifest = {
        "name": NAME,
        "version": __version__,
        "description": f"Propose missions to {vehicle} under {policy}, and follow them; the vehicle decides each step.",
        "author": {"name": NAME},
        "keywords": ["drone", "mavlink", "mcp"],
    }
    places = " ".join(shlex.quote(place) for place in (_whole(data_folder()), socket))
    guard = f'{shlex.quote(sys.executable)} -P "${{CLAUDE_PLUGIN_ROOT}}/hooks/keep_out.py" {places}'
    hooks = {"PreToolUse": [{"matcher": _REACHING, "hooks": [{"type": "command", "command": guard, "timeout": 10}]}]}
    shipped = root() / "examples" / "agent"
    return {
        ".claude-plugin/plugin.json": _json(manifest),
        ".mcp.json": _json({"mcpServers": {NAME: server}}),
        "hooks/hooks.json": _json({"description": "limits the model to the tools of the server", "hooks": hooks}),
        **{name: (shipped / name).read_bytes() for name in COPIED},
    }


def _json(what: object) -> bytes:
    return (json.dumps(what, ensure_ascii=False, indent=2) + "\n").encode()


def _whole(path: Path) -> str:
    return str(path.absolute())
