"""`rtshcua doctor`: report what a vehicle supports and what would stop a mission, without moving anything."""

import os
import pwd
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Annotated, Final, NamedTuple

import msgspec
import typer

from rtshcua import library
from rtshcua.adapters.boundary import optee, trustzone_m
from rtshcua.adapters.boundary.emulator import EMULATED
from rtshcua.adapters.boundary.home import BoundaryError
from rtshcua.adapters.boundary.process import MISSING, UNBUILT, UNBUILT_HELP, ListeningBoundary, measures_here, program
from rtshcua.adapters.clock import SystemClock
from rtshcua.adapters.doctor.diagnosis import MissionVerdict, VehicleFinding, diagnose, settled, settling, told_apart
from rtshcua.adapters.doctor.examination import ExaminingDriver
from rtshcua.adapters.doctor.identity import standing
from rtshcua.adapters.store.folders import data_folder, state_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.reading import read_regular
from rtshcua.adapters.store.signing import LinkKeyError
from rtshcua.adapters.store.vehicle_records import OwedParameters
from rtshcua.adapters.utc import TimeSources, kernel_error_us, vehicle_counts
from rtshcua.adapters.vehicle import address
from rtshcua.adapters.vehicle.address import Address, AddressError
from rtshcua.adapters.vehicle.connected import ConnectedVehicle
from rtshcua.adapters.vehicle.telemetry import UnknownSource
from rtshcua.adapters.vehicle.transport import open_transport
from rtshcua.app.exit_codes import code_of
from rtshcua.app.fly.connect import record_of, unmet, unopened
from rtshcua.app.fly.link_signing import LinkSigning
from rtshcua.app.fly.replay_check import too_old
from rtshcua.app.fly.verify_bundle import other_kind
from rtshcua.app.programs import compile_sources
from rtshcua.app.wording import many
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import distrust, fail, misaddressed, refuse
from rtshcua.front.cli.options.conflicts import conflict_of
from rtshcua.front.cli.options.flight_options import (
    Connect,
    DecidesIn,
    LinkKey,
    MeantSettings,
    System,
    UnsignedRadio,
    UtcError,
    duration_us,
    mode_of,
    settings_of,
)
from rtshcua.front.cli.stdout import out, out_json
from rtshcua.mavlink.parameters import shown
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Now
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.enforcement.isolated import Caller
from rtshcua.onboard.enforcement.load import EnforcementMode
from rtshcua.wire import cose
from rtshcua.wire.bundle import MAX_BUNDLE, open_bundle
from rtshcua.wire.clock import ClockSource
from rtshcua.wire.trust import MAX_ROOT, TrustRoot, open_root
from rtshcua.wire.untrusted import Untrusted

app = typer.Typer(add_completion=False)

_HEARTBEAT_S = 10.0
_POLL_US = 50_000
_SOFTWARE = "a run with `--mode software` decides in its own process, where an attacker of the process can interfere"
_EXAMPLE = "missions/short.rts"  # its policy reads every shipped signal


MissionBundle = Annotated[Path | None, typer.Argument(help="the bundle to fly (default: check the shipped signals)")]
Seconds = Annotated[float, typer.Option(min=3, max=600, help="listening time")]
AgentUser = Annotated[
    str | None, typer.Option(metavar="USER", help="user of the agent: check that it differs from operators")
]
BoundarySocket = Annotated[
    Path | None, typer.Option(metavar="PATH", help="socket of a listening boundary: check that one")
]
AsJson = Annotated[bool, typer.Option("--json", help="print one JSON object")]


@app.command()
def doctor(
    context: typer.Context,
    connect: Connect,
    bundle: MissionBundle
    = None,
    seconds: Seconds = 10.0,
    signing_key: LinkKey = None,
    unsigned_radio: UnsignedRadio = False,
    system: System = None,
    agent_user: AgentUser = None,
    set_: MeantSettings = None,
    utc_error: UtcError = None,
    boundary_socket: BoundarySocket = None,
    mode: DecidesIn = None,
    as_json: AsJson = False,
) -> ExitCode:  # fmt: skip
    """Report what a vehicle supports and what would stop a mission. Arms, moves, sets and uploads nothing.

    Exit codes: 0 nothing would stop a mission; 5 something would; 8 no vehicle answered.
    """
    try:
        link = address.parse(connect)
    except AddressError as error:
        return misaddressed("--connect", error)
    problem = conflict_of(context)
    if problem is not None:
        return problem
    decides, _ = mode_of(mode, own=False, named=boundary_socket is not None)
    try:
        agents = [] if agent_user is None else [told_apart(agent_user, pwd.getpwnam(agent_user).pw_uid, os.geteuid())]
    except KeyError:
        return fail(ExitCode.USAGE, f"unknown user `{agent_user}`")
    clock = SystemClock()
    try:
        wanted = _wanted(bundle, clock.now().utc_us)
    except Untrusted as error:
        return distrust(error)
    if isinstance(wanted, Refusal):
        return refuse(wanted)
    how = VehicleExamination(
        link, seconds, signing_key, unsigned_radio, system, settings_of(set_), duration_us(utc_error), boundary_socket,
        decides,
    )  # fmt: skip
    findings = _examine(wanted, how, agents, clock)
    if isinstance(findings, Refusal):
        return refuse(findings)
    code = ExitCode.REFUSED if any(each.verdict is MissionVerdict.STOP for each in findings) else ExitCode.OK
    if as_json:
        out_json(msgspec.json.encode({"exit_code": int(code), "findings": findings}).decode())
    else:
        _print(findings)
    return code


class VehicleExamination(NamedTuple):
    """How a vehicle is examined: at which link, for how long, with which key, and where a run would decide."""

    link: Address
    seconds: float
    signing_key: Path | None
    unsigned_radio: bool
    system: int | None
    settings: Mapping[str, int]
    utc_error_us: int | None
    boundary_socket: Path | None
    decides: EnforcementMode


def _examine(
    wanted: tuple[Policy, Mission | None, TrustRoot | None], how: VehicleExamination, agents: list[VehicleFinding],
    clock: SystemClock,
) -> list[VehicleFinding] | Refusal:  # fmt: skip
    """Listen to the vehicle, and return what was found."""
    policy, mission, root = wanted
    frames = FrameSession()
    with ExitStack() as stack:
        try:
            signing = LinkSigning(
                how.signing_key, policy, frames, state_folder(), clock, unsigned_radio=how.unsigned_radio
            )
        except LinkKeyError as error:
            return Refusal(f"link-key-{error.slug}", str(error), error.help or "", code_of(error.slug))
        stack.callback(signing.close)
        try:
            steps = () if mission is None else mission.invocations
            vehicle = ExaminingDriver(policy, clock, frames, signing.verifier, how.system, steps, how.settings)
        except UnknownSource as error:
            return Refusal("refused", str(error), "", ExitCode.REFUSED)
        try:
            socket = ConnectedVehicle(open_transport(how.link), vehicle, clock, lambda _utc_us, _frame: None)
        except OSError as error:
            return unopened(how.link, error)._replace(code=ExitCode.LINK)
        stack.callback(socket.close)
        if not _listen(socket, vehicle, clock, how.seconds):
            silent = unmet(f"a vehicle at `{how.link}`", _HEARTBEAT_S, how.system, signing.rejected, socket.silence)
            return silent._replace(code=ExitCode.LINK)
        keyed = how.signing_key is not None
        time_of_day = _time_of_day(how.boundary_socket, how.utc_error_us, keyed=keyed, apart=how.decides.apart)
        findings = _boundary(how.decides, how.boundary_socket) + agents + _settle(socket, vehicle, clock)
        findings += list(
            diagnose(
                vehicle, policy, mission, keyed=keyed,
                time=time_of_day,
                unheard=signing.unheard, named=how.system is not None,
                qualified=None if root is None else partial(
                    standing, record_of(policy.vehicle.identity, root, clock.now().utc_us)
                ),
            )
        )  # fmt: skip
    if mission is not None:
        findings += _expired(policy, mission, clock.now(), time_of_day)
        findings += _owed(OwedParameters(state_folder(), policy.vehicle.identity))
    return findings


def _boundary(mode: EnforcementMode, socket: Path | None = None) -> list[VehicleFinding]:
    """Return findings about where a run decides, and which isolation measures its boundary process lacks."""
    slug = "boundary/process"
    if mode is EnforcementMode.NONE:
        text, help = "a run with `--mode none` flies only the simulated vehicle", "leave out `--mode`"
        return [VehicleFinding(slug, MissionVerdict.STOP, text, "a separate process", help)]
    if mode is EnforcementMode.SOFTWARE:
        built = program() is not None
        text, help = (_SOFTWARE, "leave out `--mode`") if built else (UNBUILT, UNBUILT_HELP)
        return [VehicleFinding(slug, MissionVerdict.WARN, text, "a separate process", help)]
    if mode.emulated:
        application = mode is EnforcementMode.OPTEE
        lacking = optee.missing_packages() if application else trustzone_m.missing_packages()
        if lacking is not None:
            return [VehicleFinding(slug, MissionVerdict.STOP, str(lacking), "its emulator and programs", lacking.help)]
        home = "an emulated OP-TEE" if application else "the secure world of an emulated Cortex-M33"
        found = [
            VehicleFinding(slug, MissionVerdict.OK, f"a run decides in {home} (`run --mode {mode}`)"),
            VehicleFinding("boundary/hardware", MissionVerdict.WARN, f"the boundary would run without {EMULATED}"),
        ]
        if application:
            text = f"the boundary would be a model for development: {optee.DEVELOPMENT}"
            found.append(VehicleFinding("boundary/development", MissionVerdict.WARN, text))
        return found
    try:
        if socket is None:
            here, where = measures_here(None), "a run decides in a separate process (`run --mode process`)"
        else:
            listening = ListeningBoundary(socket)
            listening.close()
            here, where = listening.measures, f"a boundary listens at `{socket}`"
    except BoundaryError as error:
        return [VehicleFinding(slug, MissionVerdict.STOP, str(error), "a separate process", error.help)]
    found = [VehicleFinding(slug, MissionVerdict.OK, where)]
    for measure, text in MISSING.items():
        if measure not in here:
            name = f"boundary/{str(measure.name).lower().replace('_', '-')}"
            found.append(VehicleFinding(name, MissionVerdict.WARN, f"the boundary process would run without {text}"))
    return found


def _time_of_day(socket: Path | None, stated_us: int | None, *, keyed: bool, apart: bool) -> TimeSources:
    """Return the time sources of a run: of its own boundary (`apart`: a separate process), or of the listening one."""
    if socket is None:
        return TimeSources(kernel_error_us(), vehicle_counts(apart=apart, keyed=keyed), stated_us)
    try:
        listening = ListeningBoundary(socket)
    except BoundaryError:  # `_boundary` has reported it
        return TimeSources(kernel_error_us(), listens=True)
    try:
        has_key = listening.link_name is not None
        said = Caller(listening.call, signs=has_key).time(settle=True)
    finally:
        listening.close()
    if isinstance(said, Refusal) or said.source is ClockSource.SHARED:  # it has no clock: the run's applies
        return TimeSources(kernel_error_us(), listens=True)
    error_us, counts = said.now.utc_error_us, vehicle_counts(apart=True, keyed=has_key)
    return TimeSources(
        error_us if said.source is ClockSource.KERNEL else None, counts,
        error_us if said.source is ClockSource.OPERATOR else None, listens=True,
    )  # fmt: skip


def _expired(policy: Policy, mission: Mission, now: Now, time: TimeSources) -> list[VehicleFinding]:
    """Return a finding if the mission has expired, as far as this machine's time is known."""
    error_us = time.stated_us if time.machine_us is None else time.machine_us
    known = Now(now.monotonic_us, now.utc_us, UTC_UNKNOWN_US if error_us is None else error_us)
    late = too_old(policy, mission.invocations, known)
    if late is None:
        return []
    return [VehicleFinding("mission/expired", MissionVerdict.STOP, late.text, "a mission that is fresh", late.help)]


def _owed(debts: OwedParameters) -> list[VehicleFinding]:
    """Return a finding about parameters that an interrupted run has not restored."""
    slug = "settings/owed"
    if debts.trouble is not None:
        return [
            VehicleFinding(
                slug, MissionVerdict.WARN, debts.trouble, "", "inspect the file; if it is deleted, nothing is restored"
            )
        ]
    listed = ", ".join(f"{name} from {shown(each.value)} to {shown(each.before)}" for name, each in debts.left.items())
    found = f"an interrupted run left changed parameters, which the next run restores: {listed}"
    return [VehicleFinding(slug, MissionVerdict.WARN, found)] if listed else []


def _wanted(bundle: Path | None, utc_us: int) -> tuple[Policy, Mission | None, TrustRoot | None] | Refusal:
    """Return the policy whose signals are checked, the mission to fly, and its trust root.

    Raises Untrusted and OSError.
    """
    if bundle is None:
        compiled, _ = compile_sources([library.root() / _EXAMPLE], mission=None, issued_at_us=utc_us)
        assert compiled.policy is not None
        return compiled.policy, None, None
    data = read_regular(bundle, MAX_BUNDLE)
    mistaken = other_kind(bundle)
    if mistaken is not None:
        return mistaken
    signed = KeyStore(data_folder()).root()
    root = open_root(signed, pinned=cose.unverified(signed, limit=MAX_ROOT).kid, now_us=utc_us)
    opened = open_bundle(data, root=root, vehicle=None, now_us=utc_us)
    return opened.policy, opened.mission, root


#: extra time for a vehicle that has just been switched on
_SETTLES_S: Final = 60.0


def _settle(socket: ConnectedVehicle, vehicle: ExaminingDriver, clock: SystemClock) -> list[VehicleFinding]:
    """Wait for a condition that resolves itself, such as a GPS fix, and return a finding about it."""
    what = settling(vehicle)
    if what is None:
        return []
    if sys.stderr is not None:
        print(f"waiting for {what}, at most {_SETTLES_S:.0f} s", file=sys.stderr, flush=True)
    begun = time.monotonic()
    still: str | None = what
    while still is not None and time.monotonic() < begun + _SETTLES_S:
        socket.poll(clock.now().monotonic_us, _POLL_US)
        still = settling(vehicle)
    return [settled(what, round(time.monotonic() - begun), still)]


def _listen(socket: ConnectedVehicle, vehicle: ExaminingDriver, clock: SystemClock, seconds: float) -> bool:
    """Wait for a heartbeat, then listen for `seconds`; return whether there was a heartbeat."""
    begun = time.monotonic()
    until = begun + _HEARTBEAT_S
    heard = False
    while time.monotonic() < until:
        socket.poll(clock.now().monotonic_us, _POLL_US)
        if not heard and vehicle.flavour is not None:
            heard, begun = True, time.monotonic()
            until = begun + seconds
        _progress(time.monotonic() - begun, seconds if heard else _HEARTBEAT_S, heard=heard)
    _progress(None, 0, heard=heard)
    return heard


def _progress(passed: float | None, whole: float, *, heard: bool) -> None:
    if sys.stderr is None or not sys.stderr.isatty():
        return
    what = "listening" if heard else "waiting for a heartbeat"
    text = "" if passed is None else f"{what}: {passed:.0f} of {whole:.0f} s"
    print(f"\r\x1b[K{text}", end="", file=sys.stderr, flush=True)


_MARKS = {
    MissionVerdict.OK: "ok",
    MissionVerdict.WARN: "warn",
    MissionVerdict.STOP: "STOP",
    MissionVerdict.UNKNOWN: "?",
}


def _print(findings: Sequence[VehicleFinding]) -> None:
    """Print one line for each finding; for problems also what is needed and what to do."""
    width = max(len(each.slug) for each in findings)
    for each in findings:
        out(f"{_MARKS[each.verdict]:<5} {each.slug:<{width}}  {each.found}")
        for label, text in (("needed", each.needed), ("help", each.advice)):
            if text and each.verdict is not MissionVerdict.OK:
                out(f"{'':<5} {'':<{width}}  {label}: {text}")
    stops = sum(each.verdict is MissionVerdict.STOP for each in findings)
    warns = sum(each.verdict is MissionVerdict.WARN for each in findings)
    end = f"{many(stops, 'problem')} would stop a mission" if stops else "no problem would stop a mission"
    unknown = sum(each.verdict is MissionVerdict.UNKNOWN for each in findings)
    if unknown and not stops:
        end = "no problem was found that would stop a mission"
    out(f"{end}; {many(warns, 'warning')}" + (f"; {many(unknown, 'check')} without an answer" if unknown else ""))
