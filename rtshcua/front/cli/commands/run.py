"""`rtshcua run`: fly a bundle on the simulated vehicle or on a connected one."""

import grp
import os
import pwd
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer

from rtshcua.adapters.store.folders import data_folder, state_folder
from rtshcua.adapters.vehicle import address
from rtshcua.adapters.vehicle.address import Address, AddressError, LinkCarrier
from rtshcua.adapters.vehicle.transport import Transport, open_transport
from rtshcua.app.fly.witnesses import addresses
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.console import say_refused
from rtshcua.front.cli.faults import fail, misaddressed
from rtshcua.front.cli.options import flight_options as options
from rtshcua.front.cli.options.conflicts import conflict_of
from rtshcua.front.cli.options.flight_options import duration_us, mode_of, settings_of, simulator_words
from rtshcua.onboard.enforcement.load import EnforcementMode

if TYPE_CHECKING:
    from rtshcua.app.fly.dry_run import FlightRehearsal
    from rtshcua.app.fly.incidents import Incidents
    from rtshcua.simulation.config import AutopilotKind

app = typer.Typer(add_completion=False)

#: up to this speed-up, the validity of a permit for parameters leaves the machine enough time
_FASTEST_SET = 5
#: the defaults of `--wait-for` and `--idle`
_WAIT_US = 3_600_000_000
_IDLE_US = 300_000_000


@app.command()
def run(
    context: typer.Context, bundle: options.Bundle, connect: options.OtherVehicle = None,
    mode: options.DecidesIn = None, boundary_user: options.BoundaryUser = None,
    boundary_socket: options.BoundarySocket = None, speed: options.Speed = 1.0, flavour: options.Flavour = None,
    battery: options.Battery = None, wind: options.Wind = None, fault: options.Faults = None,
    seed: options.Seed = None, vehicle: options.Identity = None, root: options.Roots = None,
    log_key: options.LogKey = None, boundary_key: options.BoundaryKeyFile = None,
    passphrase_file: options.PassphraseFile = None, signing_key: options.LinkKey = None,
    unsigned_radio: options.UnsignedRadio = False, system: options.System = None, runs: options.Runs = Path("runs"),
    state_dir: options.StateFolder = None, fresh_state: options.FreshState = False, no_fence: options.NoFence = False,
    set_: options.Settings = None, utc_error: options.UtcError = None, agent_socket: options.AgentSocketPath = None,
    operator_socket: options.OperatorSocket = None, agent_group: options.AgentGroup = None,
    witness: options.Witnesses = None, scenario: options.ScenarioName = None, wait: options.Wait = False,
    wait_for: options.WaitFor = None, live: options.Live = False, idle: options.Idle = None,
    rehearsal: options.DryRun = False, plain: options.Plain = False, as_json: options.AsJson = False,
) -> ExitCode:  # fmt: skip
    """Fly a bundle, once. Each step is decided before it is sent, monitored while it flies, and recorded.

    Without `--connect`, the command starts a simulated vehicle. Ctrl-C triggers a fallback and lands the vehicle first.
    With `--wait`, BUNDLE provides only the policy: an agent submits one mission, which is admitted like BUNDLE's.
    """
    words = simulator_words(flavour=flavour, battery=battery, wind=wind, faults=fault, seed=seed)
    if isinstance(link := _links(context, connect, witness), ExitCode):
        return link
    decides_in, unbuilt = mode_of(
        mode, own=connect is None, named=boundary_user is not None or boundary_socket is not None
    )
    user, group = _boundary_user(boundary_user, decides_in), _group(agent_socket, operator_socket, agent_group)
    address_, witnesses = link
    too_fast = _too_fast(address_, speed, sets=bool(set_) and not rehearsal)
    misused = _misused(user, group, witnesses, too_fast)
    if misused is not None or isinstance(witnesses, AddressError):
        return misused or ExitCode.USAGE
    with ExitStack() as stack:
        # open the port before the slow imports: the system then buffers the first heartbeat
        transport = _listening(address_, stack)
        from rtshcua.app.fly.flight_request import FlightRequest
        from rtshcua.app.fly.stages import fly
        from rtshcua.front.cli.console import TerminalConsole

        state = state_dir or state_folder()
        if fresh_state:
            state = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="rtshcua-")))
        incidents = None if scenario is None else _incidents(scenario, flavour, seed)
        if isinstance(incidents, Refusal):
            return say_refused(incidents, as_json=as_json)
        request = FlightRequest(
            bundle=bundle, link=address_, mode=decides_in, data=data_folder(), state=state, runs=runs,
            simulator=words if incidents is None else incidents.options, speed=speed, vehicle=vehicle,
            roots=tuple(root or ()), log_key=log_key, fence=not no_fence and not rehearsal, signing_key=signing_key,
            unsigned_radio=unsigned_radio, agent_socket=agent_socket, operator_socket=operator_socket,
            agent_group=group if isinstance(group, int) else None, dry_run=rehearsal, system=system,
            witnesses=witnesses, incidents=incidents, utc_error_us=duration_us(utc_error), settings=settings_of(set_),
            wait_s=(duration_us(wait_for) or _WAIT_US) / 1_000_000 if wait else None,
            boundary_user=user if isinstance(user, tuple) else None, unbuilt=unbuilt, boundary_key=boundary_key,
            boundary_socket=boundary_socket, idle_us=(duration_us(idle) or _IDLE_US) if live else None,
        )  # fmt: skip
        console = TerminalConsole(_style(plain=plain, as_json=as_json), request.data, passphrase_file)
        ended = fly(request, console, transport)
    return _ended(ended, as_json=as_json)


def _ended(ended: "ExitCode | FlightRehearsal | Refusal", *, as_json: bool) -> ExitCode:
    """Show how a flight or a rehearsal ended, if it did not tell that itself."""
    if isinstance(ended, Refusal):
        return say_refused(ended, as_json=as_json)
    if isinstance(ended, ExitCode):
        return ended
    from rtshcua.front.cli.render.showing.rehearsed import show_rehearsal  # shows what would pass as `why` does

    return show_rehearsal(ended, as_json=as_json)


def _misused(
    user: tuple[int, int] | str | None, group: int | str | None, witnesses: tuple[Address, ...] | AddressError,
    too_fast: tuple[str, str] | None,
) -> ExitCode | None:  # fmt: skip
    """Report the first problem of the options; None if there is none."""
    problem = next((each for each in (user, group) if isinstance(each, str)), None)
    if problem is not None:
        return fail(ExitCode.USAGE, problem)
    if isinstance(witnesses, AddressError):
        return misaddressed("--witness", witnesses)
    return None if too_fast is None else fail(ExitCode.USAGE, *too_fast)


def _links(
    context: typer.Context, connect: str | None, witness: list[str] | None
) -> tuple[Address | None, tuple[Address, ...] | AddressError] | ExitCode:
    """Return the addresses of the vehicle and of the witnesses, or the exit code of a reported conflict."""
    problem = conflict_of(context, only=options.OF_SIMULATOR)
    if problem is not None:
        return problem
    try:
        link = None if connect is None else address.parse(connect)
    except AddressError as error:
        return misaddressed("--connect", error)
    problem = conflict_of(context)
    if problem is not None:
        return problem
    try:
        return link, addresses(witness or ())
    except AddressError as error:
        return link, error


def _listening(link: Address | None, stack: ExitStack) -> Transport | None:
    """Open the UDP port of the vehicle until the stack is closed; None if it cannot be opened.

    In that case the flight tries again and reports the error.
    """
    if link is None or link.way is not LinkCarrier.UDP_IN:
        return None
    try:
        transport = open_transport(link)
    except OSError:
        return None
    stack.callback(transport.close)
    return transport


def _incidents(text: str, flavour: "AutopilotKind | None", seed: int | None) -> "Incidents | Refusal":
    from rtshcua.app.fly.incidents import plan_incidents
    from rtshcua.front.cli.scenario_option import chosen  # compiles sources, which no other run does

    flight = chosen(text, time.time_ns() // 1_000)
    return flight if isinstance(flight, Refusal) else plan_incidents(flight, flavour, seed)


def _too_fast(link: Address | None, speed: float, *, sets: bool) -> tuple[str, str] | None:
    """Return the message and the help if the vehicle cannot fly at this speed; None if it can."""
    inherited = link is not None and link.way is LinkCarrier.INHERITED  # whether it is simulated, the vehicle reports
    if link is not None and speed != 1 and not link.is_loopback and not inherited:
        text = f"`--speed` requires a simulated vehicle on this machine, not one at `{link}`"
        return text, "start `rtshcua sim --speed N` and use `--connect udpin:127.0.0.1:14550`"
    if sets and speed > _FASTEST_SET:
        text = f"`--set` requires a `--speed` of at most {_FASTEST_SET}"
        return text, "a permit to set a parameter lasts 30 s of flight time, which is too short at a higher speed"
    return None


def _boundary_user(name: str | None, mode: EnforcementMode) -> tuple[int, int] | str | None:
    """Return the user and group ids for the boundary's process, None, or an error message."""
    if mode is not EnforcementMode.PROCESS:
        return None if name is None else "`--boundary-user` requires `--mode process`"
    if name is None:
        return None
    try:
        found = pwd.getpwnam(name)
    except KeyError:
        return f"unknown user `{name}`"
    if os.geteuid() != 0:
        return "`--boundary-user` requires root: only root can start a process as another user"
    return found.pw_uid, found.pw_gid


def _group(agent_socket: Path | None, operator_socket: Path | None, name: str | None) -> int | str | None:
    """Return the id of the group that may open the agent socket, None, or an error message."""
    if agent_socket is not None and agent_socket == operator_socket:
        return "`--agent-socket` and `--operator-socket` must be different paths"
    if name is not None and agent_socket is None:
        return "`--agent-group` requires `--agent-socket`"
    try:
        return None if name is None else grp.getgrnam(name).gr_gid
    except KeyError:
        return f"unknown group `{name}`"


def _style(*, plain: bool, as_json: bool) -> Literal["screen", "lines", "json"]:
    if as_json:
        return "json"
    terminal = sys.stdout is not None and sys.stdout.isatty() and os.environ.get("TERM", "dumb") != "dumb"
    return "screen" if terminal and not plain else "lines"
