"""`rtshcua mcp`: an MCP server through which an agent proposes missions to a waiting vehicle."""

import gc
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
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
from rtshcua.front.mcp.greeting import greet
from rtshcua.wire import cose
from rtshcua.wire.bundle import MAX_BUNDLE, envelopes, policy_digest
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.trust import open_root
from rtshcua.wire.untrusted import Untrusted

app = typer.Typer(add_completion=False)
_AGENT = "agent"


Bundle = Annotated[Path, typer.Argument(help="the bundle of `rtshcua run --wait`, whose policy is in force")]
To = Annotated[Path, typer.Option(metavar="SOCKET", help="agent socket of the waiting vehicle")]
With = Annotated[list[Path], typer.Option("--with", help="sources of that policy (repeatable)")]
MissionKey = Annotated[Path | None, typer.Option(help="the agent's mission key [default: the key store's]")]
PassphraseFile = Annotated[Path | None, typer.Option(help="file with the passphrase of the key")]
Http = Annotated[
    int | None,
    typer.Option(metavar="PORT", min=0, max=65_535, help="serve HTTP on this port of 127.0.0.1; 0: any free port"),
]
TokenFile = Annotated[
    Path | None, typer.Option(help="with --http: file of the token that hosts must send; created if missing")
]


@app.command()
def mcp(
    context: typer.Context,
    bundle: Bundle,
    to: To,
    with_: With,
    mission_key: MissionKey = None,
    passphrase_file: PassphraseFile = None,
    http: Http = None,
    token_file: TokenFile = None,
) -> ExitCode:
    """Run an MCP server, over the standard streams or HTTP, with tools to check, propose, follow and replace missions.

    The server signs with the agent's mission key and has no other key. It connects only to SOCKET. No tool arms the
    vehicle, sets a parameter, opens a link or accepts a key. Requires the extra `mcp`. Host setup: docs/agents.md.

    With --http, it serves http://127.0.0.1:PORT/mcp to clients that send the token as `Authorization: Bearer`.

    Exit codes: 0 the host ended the session; 2 wrong command line, or the extra is missing; 3 a file cannot be read, or
    the port is in use; 4 the key is not an agent's, or other users can read the token; 74 output cannot be written.
    """
    if find_spec("mcp") is None or find_spec("mcp_types") is None:
        return fail(ExitCode.USAGE, "the MCP server is not installed", 'in the checkout: `pip install ".[mcp]"`')
    problem = conflict_of(context)
    if problem is not None:
        return problem
    found = _agent_key(bundle, mission_key, passphrase_file)
    if isinstance(found, ExitCode):
        return found
    store, key, envelope, digest = found
    for path in with_:
        read_regular(path, 1)

    def make() -> object:
        with _loading():
            from rtshcua.app.propose import Missions
            from rtshcua.front.mcp.flight import Following
            from rtshcua.front.mcp.tools import Signer, Tools

            signer = Signer(key, envelope, digest, lambda policy, mission: check_trusted(store, key, policy, mission))
            offered = Tools(Missions(with_), signer, to, Following(to))
            gc.freeze()
        return offered

    if not to.exists():
        say(f"note: `{to}` does not exist yet; `rtshcua run BUNDLE --wait --agent-socket {to}` creates it")
    if http is None or token_file is None:
        with breakable():
            _over_streams(make)
        return ExitCode.OK
    return _over_http(http, token_file, make)


def _over_streams(make: Callable[[], object]) -> None:
    """Serve the standard streams. The host's greeting is answered while the SDK and the compiler load."""
    loading = threading.Thread(target=_load, daemon=True)
    loading.start()
    begun = greet(0, 1)
    loading.join()
    from rtshcua.front.mcp.server import serve

    serve(make, begun)


def _load() -> None:
    """Load the modules of the server and its tools. Errors are reported where the modules are used."""
    with _loading(), suppress(ImportError):
        import rtshcua.front.mcp.server
        import rtshcua.front.mcp.tools  # noqa: F401  loaded for those who use them


def _over_http(port: int, token_file: Path, make: Callable[[], object]) -> ExitCode:
    """Listen on a port of this machine, and serve clients that send the token."""
    try:
        token = token_of(token_file)
    except BadToken as error:
        return fail(ExitCode.UNTRUSTED, str(error), f"run `chmod 600 {token_file}` and replace the token")
    with socket.socket() as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((HOST, port))
            listener.listen()
        except OSError as error:
            return fail(ExitCode.INPUT, f"cannot listen at {HOST}:{port}: {words_of(error)}", "choose another port")
        say(f"serving http://{HOST}:{listener.getsockname()[1]}{PATH} to clients that send the token in `{token_file}`")
        with breakable():
            _load()
            from rtshcua.front.mcp.server import serve_http

            serve_http(make, listener, token)
    return ExitCode.OK


def _agent_key(
    bundle: Path, mission_key: Path | None, passphrase_file: Path | None
) -> tuple[KeyStore, SigningKey, bytes, bytes] | ExitCode:
    """Return the key store, the agent's key, and the policy of a bundle with its digest."""
    store = KeyStore(data_folder())
    try:
        envelope, _ = envelopes(read_bundle(bundle))
        digest = policy_digest(cose.unverified(envelope, limit=MAX_BUNDLE).payload)
        key = unlock(store, Duty.MISSION, path=mission_key, passphrase_file=passphrase_file, whose=_AGENT)
        sources = _sources(store, key)
    except Untrusted as error:
        return distrust(error)
    if sources != (_AGENT,):
        return _not_for_agents(key, sources)
    return store, key, envelope, digest


def _not_for_agents(key: SigningKey, sources: tuple[str, ...]) -> ExitCode:
    what = f"is for {', '.join(sources)}" if sources else "is not a mission key in the key store's trust root"
    text = f"key {key.kid.hex()} {what}; the MCP server requires a key for agents only"
    help = "use `--mission-key mission-agent.key`, with the trust root (not secret) in the key store beside it"
    return fail(ExitCode.UNTRUSTED, text, help)


@contextmanager
def _loading() -> Iterator[None]:
    """Disable garbage collection while modules load: the objects stay, and collecting takes 10 % of the start."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()


def _sources(store: KeyStore, key: SigningKey) -> tuple[str, ...]:
    """Return the sources that the key store's trust root binds to the key; empty if the root does not name the key.

    Raises `KeyStoreError` if there is no root.
    """
    named = open_root(store.root(), pinned=store.pin(), now_us=0).keys_for(Duty.MISSION).get(key.kid)
    return () if named is None else named.sources
