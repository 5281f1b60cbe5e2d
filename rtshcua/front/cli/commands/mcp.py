"""`rtshcua mcp`: an agent proposes missions to a vehicle that waits, over the Model Context Protocol."""

import gc
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.reading import read_regular
from rtshcua.app.documents import read_bundle
from rtshcua.app.exit_codes import words_of
from rtshcua.app.signing_keys import check_trusted
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.faults import distrust, fail, say
from rtshcua.front.cli.interrupts import breakable
from rtshcua.front.cli.options.conflicts import conflict_of
from rtshcua.front.cli.unlock import unlock
from rtshcua.front.mcp.access import HOST, PATH, BadToken, token_of
from rtshcua.wire import cose
from rtshcua.wire.bundle import MAX_BUNDLE, envelopes, policy_digest
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.trust import open_root
from rtshcua.wire.untrusted import Untrusted

app = typer.Typer(add_completion=False)
_AGENT = "agent"


@app.command()
def mcp(
    context: typer.Context,
    bundle: Annotated[Path, typer.Argument(help="the bundle that `rtshcua run --wait` has: its policy is in force")],
    to: Annotated[Path, typer.Option(metavar="SOCKET", help="the agent socket of the vehicle that waits")],
    with_: Annotated[list[Path], typer.Option("--with", help="the sources of that policy (repeatable)")],
    mission_key: Annotated[Path | None, typer.Option(help="the agent's mission key [default: the key store's]")] = None,
    passphrase_file: Annotated[Path | None, typer.Option(help="a file with the key's passphrase")] = None,
    http: Annotated[
        int | None,
        typer.Option(metavar="PORT", min=0, max=65_535, help="serve HTTP on this machine alone, 0: any port"),
    ] = None,
    token_file: Annotated[
        Path | None, typer.Option(help="the token that a host has to send, made where missing")
    ] = None,
) -> ExitCode:
    """Serve an agent's host (MCP), over the standard streams or HTTP: check and propose missions, follow them, replan.

    It signs with one key, the agent's mission key, and has no other. It reaches nothing but SOCKET, and no tool arms,
    sets a parameter, opens a link or takes a key. Needs the extra `mcp`. docs/agents.md says how to set hosts up.

    With --http it answers at http://127.0.0.1:PORT/mcp whoever sends the token in the file as `Authorization: Bearer`.

    Ends with 0 with the host, 2 where the command line is wrong or the extra is missing, 3 where a file cannot be read
    or the port is taken, 4 for a key that is not an agent's, or a token that others may read, 74 where nothing can be
    written.
    """
    try:
        with _loading():
            from rtshcua.front.mcp.server import serve, serve_http
    except ModuleNotFoundError as missing:
        if (missing.name or "").partition(".")[0] not in ("mcp", "anyio"):
            raise
        return fail(ExitCode.USAGE, "the MCP server is not installed", 'in the checkout: `pip install ".[mcp]"`')
    problem = conflict_of(context)
    if problem is not None:
        return problem
    store = KeyStore(data_folder())
    try:
        envelope, _ = envelopes(read_bundle(bundle))
        digest = policy_digest(cose.unverified(envelope, limit=MAX_BUNDLE).payload)
        key = unlock(store, Duty.MISSION, path=mission_key, passphrase_file=passphrase_file, whose=_AGENT)
        sources = _sources(store, key)
    except Untrusted as error:
        return distrust(error)
    if sources != (_AGENT,):
        speaks = f"may speak for {', '.join(sources)}" if sources else "is no mission key of the key store's trust root"
        text = f"key {key.kid.hex()} {speaks}, and an agent's host gets an agent's key alone"
        help = "`--mission-key mission-agent.key`; the trust root, which is no secret, lies in the key store beside it"
        return fail(ExitCode.UNTRUSTED, text, help)
    for path in with_:
        read_regular(path, 1)

    with _loading():  # before the host is greeted: it may call a tool at once, and that has 100 ms
        from rtshcua.app.propose import Missions
        from rtshcua.front.mcp.flight import Following
        from rtshcua.front.mcp.tools import Signer, Tools

    def make() -> Tools:
        signer = Signer(key, envelope, digest, lambda policy, mission: check_trusted(store, key, policy, mission))
        with _loading():
            offered = Tools(Missions(with_), signer, to, Following(to))
            gc.freeze()
        return offered

    if not to.exists():
        say(f"note: `{to}` does not exist yet: `rtshcua run BUNDLE --wait --agent-socket {to}` makes it")
    if http is None or token_file is None:
        with breakable():
            serve(make)
        return ExitCode.OK
    try:
        token = token_of(token_file)
    except BadToken as error:
        return fail(ExitCode.UNTRUSTED, str(error), f"`chmod 600 {token_file}`, and a new token")
    with socket.socket() as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((HOST, http))
            listener.listen()
        except OSError as error:
            return fail(ExitCode.INPUT, f"cannot listen at {HOST}:{http}: {words_of(error)}", "choose another port")
        say(f"serves http://{HOST}:{listener.getsockname()[1]}{PATH} to whoever sends the token in `{token_file}`")
        with breakable():
            serve_http(make, listener, token)
    return ExitCode.OK


@contextmanager
def _loading() -> Iterator[None]:
    """While something is loaded that stays: to look through it for garbage takes a tenth of the start."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()


def _sources(store: KeyStore, key: SigningKey) -> tuple[str, ...]:
    """For whom the key may speak, by the key store's trust root; nothing where that does not name it.

    Raises `KeyStoreError` where there is no root: then nobody can tell.
    """
    named = open_root(store.root(), pinned=store.pin(), now_us=0).keys_for(Duty.MISSION).get(key.kid)
    return () if named is None else named.sources
