"""`rtshcua run`: fly a bundle, on the simulated vehicle or on another one."""

import grp
import os
import pwd
import sys
import tempfile
import time
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from rtshcua.adapters.store.folders import data_folder, state_folder
from rtshcua.adapters.vehicle import address
from rtshcua.adapters.vehicle.address import Address, AddressError, LinkCarrier
from rtshcua.adapters.vehicle.transport import Transport, open_transport
from rtshcua.app.fly import witnesses as witnessed
from rtshcua.app.fly.refused import Refused
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import simulated
from rtshcua.front.cli.configured import Settings, settings_of
from rtshcua.front.cli.connection import (
    DecidesIn,
    LinkKey,
    NoFence,
    System,
    UnsignedRadio,
    UtcError,
    duration_text,
    duration_us,
    mode_of,
)
from rtshcua.front.cli.faults import fail, misaddressed
from rtshcua.front.cli.refused import say_refused
from rtshcua.onboard.enforcement.load import EnforcementMode
from rtshcua.simulation.config import AutopilotKind

if TYPE_CHECKING:
    from rtshcua.app.fly.incidents import Incidents

app = typer.Typer(add_completion=False)


@app.command()
def run(
    bundle: Annotated[Path, typer.Argument(help="what `rtshcua compile` made")],
    connect: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="another vehicle: `serial:/dev/ttyAMA0:921600`, or `tcp:`, `tcpin:`, `udpin:`, `udpout:HOST:PORT`",
        ),
    ] = None,
    mode: DecidesIn = None,
    boundary_user: Annotated[
        str | None, typer.Option(metavar="USER", help="with `--mode process`: the user that it runs as; needs root")
    ] = None,
    boundary_socket: Annotated[
        Path | None,
        typer.Option(metavar="PATH", help="with --connect: there a boundary listens, which has the keys"),
    ] = None,
    speed: Annotated[float, typer.Option(min=0.1, max=50, help="seconds of flight in a second; in simulation")] = 1.0,
    flavour: simulated.Flavour = None,
    battery: simulated.Battery = None,
    wind: simulated.Wind = None,
    fault: simulated.Faults = None,
    seed: simulated.Seed = None,
    vehicle: Annotated[str | None, typer.Option(metavar="IDENTITY", help="who this vehicle is (as the bundle says)")]
    = None,
    root: Annotated[
        list[Path] | None,
        typer.Option(help="the signed trust root, after those that lead to it (the key store's; repeatable)"),
    ] = None,
    log_key: Annotated[Path | None, typer.Option(help="the key that signs the log (the key store's)")] = None,
    boundary_key: Annotated[
        Path | None, typer.Option(help="the key that the enforcement boundary signs with (the key store's)")
    ] = None,
    passphrase_file: Annotated[Path | None, typer.Option(help="a file with the passphrase of these keys")] = None,
    signing_key: LinkKey = None,
    unsigned_radio: UnsignedRadio = False,
    system: System = None,
    runs: Annotated[Path, typer.Option(help="where the run's folder is made")] = Path("runs"),
    state_dir: Annotated[Path | None, typer.Option(help="where it is kept which bundles flew (the data folder)")]
    = None,
    fresh_state: Annotated[bool, typer.Option("--fresh-state", help="forget which bundles flew; simulation only")]
    = False,
    no_fence: NoFence = False,
    set_: Settings = None,
    utc_error: UtcError = None,
    agent_socket: Annotated[
        Path | None, typer.Option(metavar="PATH", help="a local socket: records go out, signed documents come in")
    ] = None,
    operator_socket: Annotated[
        Path | None, typer.Option(metavar="PATH", help="another one, for operators: no agent holds up a recall there")
    ] = None,
    agent_group: Annotated[
        str | None, typer.Option(metavar="GROUP", help="users of this group may open the agent socket too")
    ] = None,
    witness: Annotated[
        list[str] | None,
        typer.Option(metavar="udpout:HOST:PORT", help="a `rtshcua witness` that is shown the log; repeatable"),
    ] = None,
    scenario: Annotated[
        str | None, typer.Option(metavar="FILE[:NAME]", help="let go wrong what a scenario says; simulation only")
    ] = None,
    wait: Annotated[
        bool, typer.Option("--wait", help="connect, and fly nothing until a bundle is handed in at the agent socket")
    ] = False,
    wait_for: Annotated[
        str | None,
        typer.Option(metavar="TIME", callback=duration_text, help="with --wait: how long at most [default: 60min]"),
    ] = None,
    rehearsal: Annotated[
        bool, typer.Option("--dry-run", help="decide every step against the present state; send no motion")
    ] = False,
    plain: Annotated[bool, typer.Option("--plain", help="one line an event, in a terminal too")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object an event, the summary last")] = False,
) -> ExitCode:  # fmt: skip
    """Fly a bundle, once. Every step is decided before it is sent, watched while it flies, and recorded.

    Without `--connect` a simulated vehicle is started for it. Ctrl-C falls back and lands first. With `--wait` BUNDLE
    says the policy alone: the mission that flies is handed in by an agent, once, and admitted as BUNDLE would be.
    """
    words = simulated.arguments(flavour=flavour, battery=battery, wind=wind, faults=fault, seed=seed)
    own = connect is None
    if not own and words:
        return fail(ExitCode.USAGE, "options of the simulated vehicle do not go with `--connect`", _SIM_HELP)
    try:
        link = None if connect is None else address.parse(connect)
    except AddressError as error:
        return misaddressed("--connect", error)
    if not own and vehicle is None:
        return fail(ExitCode.USAGE, "`--connect` needs `--vehicle`: which vehicle is it?", _VEHICLE_HELP)
    if not own and scenario is not None:
        return fail(ExitCode.USAGE, "`--scenario` is for the simulated vehicle, and does not go with `--connect`")
    if scenario is not None and (battery is not None or wind or fault or rehearsal):
        return fail(ExitCode.USAGE, "`--scenario` says how the vehicle starts and what goes wrong", _SCENARIO_HELP)
    misplaced = _misplaced(
        wait=wait, timed=wait_for is not None, socket=agent_socket is not None, never=rehearsal or scenario is not None
    )
    given = {
        "--signing-key": signing_key, "--boundary-user": boundary_user, "--log-key": log_key, "--set": set_,
        "--boundary-key": boundary_key, "--passphrase-file": passphrase_file, "--dry-run": rehearsal,
        _UTC_ERROR: utc_error,
    }  # fmt: skip
    alone = "" if boundary_socket is None else _not_with_socket(given, own=own, mode=mode)
    lonely = misplaced or alone or (_LONELY[system is not None, utc_error is not None] if own else "")
    if lonely:
        return fail(ExitCode.USAGE, lonely)
    if fresh_state and (state_dir is not None or not own):
        return fail(ExitCode.USAGE, "`--fresh-state` is for the simulated vehicle, and without `--state-dir`")
    if unsigned_radio and signing_key is None and boundary_socket is None:
        return fail(ExitCode.USAGE, "`--unsigned-radio` goes with `--signing-key`: without a key nothing is signed")
    mode, unbuilt = mode_of(mode, own=own, named=boundary_user is not None or boundary_socket is not None)
    user = _boundary_user(boundary_user, mode)
    group = _group(agent_socket, operator_socket, agent_group)
    if isinstance(user, str) or isinstance(group, str):
        return fail(ExitCode.USAGE, user if isinstance(user, str) else str(group))
    try:
        witnesses = witnessed.addresses(witness or ())
    except AddressError as error:
        return misaddressed("--witness", error)
    too_fast = _too_fast(link, speed, sets=bool(set_) and not rehearsal)
    if too_fast is not None:
        return fail(ExitCode.USAGE, *too_fast)
    with ExitStack() as stack:
        # what comes from now on is kept by the system: a heartbeat need not be waited for once all is loaded
        transport = _listening(link, stack)
        from rtshcua.front.cli.launch import Launch, launch

        state = state_dir or state_folder()
        if fresh_state:
            state = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="rtshcua-")))
        try:
            incidents = None if scenario is None else _incidents(scenario, flavour, seed)
        except Refused as refused:
            return say_refused(refused, as_json=as_json)
        order = Launch(
            bundle=bundle,
            link=link,
            transport=transport,
            simulator=words if incidents is None else incidents.words,
            mode=mode,
            unbuilt=unbuilt,
            boundary_user=user,
            boundary_socket=boundary_socket,
            speed=speed,
            vehicle=vehicle,
            roots=tuple(root or ()),
            log_key=log_key,
            boundary_key=boundary_key,
            passphrase_file=passphrase_file,
            data=data_folder(),
            state=state,
            runs=runs,
            style=_style(plain=plain, as_json=as_json),
            signing_key=signing_key,
            unsigned_radio=unsigned_radio,
            agent_socket=agent_socket,
            operator_socket=operator_socket,
            agent_group=group,
            dry_run=rehearsal,
            fence=not no_fence and not rehearsal,
            system=system,
            witnesses=witnesses,
            incidents=incidents,
            utc_error_us=duration_us(utc_error),
            settings=settings_of(set_),
            wait_s=(duration_us(wait_for) or _WAIT_US) / 1_000_000 if wait else None,
        )
        try:
            return launch(order)
        except Refused as refused:
            return say_refused(refused, as_json=as_json)


def _listening(link: Address | None, stack: ExitStack) -> Transport | None:
    """The port at which a vehicle is heard, until the stack is closed, if it can be had; else whoever flies opens it,
    and says why not.
    """
    if link is None or link.way is not LinkCarrier.UDP_IN:
        return None
    try:
        transport = open_transport(link)
    except OSError:
        return None
    stack.callback(transport.close)
    return transport


def _incidents(text: str, flavour: AutopilotKind | None, seed: int | None) -> "Incidents":
    from rtshcua.app.fly.incidents import Incidents
    from rtshcua.front.cli.scenario_option import chosen  # compiles sources, which no other run does

    return Incidents(chosen(text, time.time_ns() // 1_000), flavour, seed)


#: up to this many times as fast as life, what a permit for parameters lasts leaves the machine enough
_FASTEST_SET = 5
#: how long `--wait` waits, where nobody says
_WAIT_US = 3_600_000_000
_SCENARIO_HELP = "with it go `--flavour` and `--seed`; `--battery`, `--wind`, `--fault` and `--dry-run` do not"
_SYSTEM = "`--system` goes with `--connect`: the simulated vehicle is alone"
_UTC = "`--utc-error` goes with `--connect`: a simulation has this machine's time"
#: what is wrong without `--connect`, by whether `--system` and `--utc-error` are given
_LONELY = {(False, False): "", (True, False): _SYSTEM, (True, True): _SYSTEM, (False, True): _UTC}
_VEHICLE_HELP = "its identity, as its policy says it: a bundle for another vehicle is refused then"
_UTC_ERROR = "--utc-error"
_OWN_TIME = "the boundary there tells the time itself; it is told in its own command line, `--utc-error US`"
_OWN = "the boundary there has keys of its own, sets no parameters, and rehearses nothing"
_SIM_HELP = "`rtshcua sim` takes them, where it is the vehicle that you connect to"


def _too_fast(link: Address | None, speed: float, *, sets: bool) -> tuple[str, str] | None:
    """Why nothing flies at this speed, and what helps."""
    if link is not None and speed != 1 and not link.is_loopback:
        text = f"`--speed` requires a simulated vehicle on this machine: at `{link}` a second is a second"
        return text, "`rtshcua sim --speed N`, and `--connect udpin:127.0.0.1:14550`"
    if sets and speed > _FASTEST_SET:
        text = f"`--set` goes with a `--speed` of {_FASTEST_SET} at most"
        return text, "a permit to set something lasts 30 s of flight: too short for this machine at a higher speed"
    return None


def _misplaced(*, wait: bool, timed: bool, socket: bool, never: bool) -> str | None:
    """What is wrong about `--wait` on a command line."""
    if timed and not wait:
        return "`--wait-for` goes with `--wait`"
    if wait and not socket:
        return "`--wait` needs `--agent-socket`: where is the bundle handed in?"
    if wait and never:
        return "`--wait` does not go with `--dry-run` and `--scenario`, which know the mission before"
    return None


def _not_with_socket(given: Mapping[str, object], *, own: bool, mode: EnforcementMode | None) -> str:
    """What is wrong about `--boundary-socket` on a command line with these options; empty for nothing."""
    if own:
        return "`--boundary-socket` goes with `--connect`"
    if mode not in (None, EnforcementMode.PROCESS):
        return f"`--boundary-socket` goes with `--mode process`, not with `{mode}`"
    found = next((name for name, value in given.items() if value), None)
    if found is None:
        return ""
    return f"`{found}` does not go with `--boundary-socket`: {_OWN_TIME if found == _UTC_ERROR else _OWN}"


def _boundary_user(name: str | None, mode: EnforcementMode) -> tuple[int, int] | str | None:
    """The ids of the user and group that the boundary's process runs as; what is wrong, in words."""
    if mode is not EnforcementMode.PROCESS:
        return None if name is None else "`--boundary-user` goes with `--mode process`"
    if name is None:
        return None
    try:
        found = pwd.getpwnam(name)
    except KeyError:
        return f"there is no user `{name}`"
    if os.geteuid() != 0:
        return "`--boundary-user` needs root: only root may start what runs as somebody else"
    return found.pw_uid, found.pw_gid


def _group(agent_socket: Path | None, operator_socket: Path | None, name: str | None) -> int | str | None:
    """The id of the group whose users may open the agent socket, if there is one; a text where that makes no sense."""
    if agent_socket is not None and agent_socket == operator_socket:
        return "agents and operators have a socket each: give `--operator-socket` another path"
    if name is not None and agent_socket is None:
        return "`--agent-group` goes with `--agent-socket`"
    try:
        return None if name is None else grp.getgrnam(name).gr_gid
    except KeyError:
        return f"there is no group `{name}`"


def _style(*, plain: bool, as_json: bool) -> Literal["screen", "lines", "json"]:
    if as_json:
        return "json"
    terminal = sys.stdout is not None and sys.stdout.isatty() and os.environ.get("TERM", "dumb") != "dumb"
    return "screen" if terminal and not plain else "lines"
