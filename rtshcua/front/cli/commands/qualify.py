"""`rtshcua qualify`: flight-test an autopilot and sign a record of the result."""

import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Final

import msgspec
import typer

from rtshcua.adapters.qualification.sortie import Sortie
from rtshcua.adapters.store.folders import data_folder, state_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.app.exit_codes import exit_code, untrusted
from rtshcua.app.fly.flight_request import FlightRequest
from rtshcua.app.fly.sorties import QualificationResult, Qualifying, plan_sorties
from rtshcua.app.fly.verify_bundle import IDENTITY_HELP
from rtshcua.app.programs import compile_sources
from rtshcua.app.signing_keys import check_trusted
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.console import TerminalConsole, say_refused
from rtshcua.front.cli.faults import fail
from rtshcua.front.cli.options.addresses import address_of
from rtshcua.front.cli.options.conflicts import conflict_of
from rtshcua.front.cli.options.flight_options import (
    Connect,
    LinkKey,
    NoFence,
    System,
    UnsignedRadio,
    UtcError,
    duration_us,
)
from rtshcua.front.cli.render.findings import Findings
from rtshcua.front.cli.render.showing.qualification import described, told
from rtshcua.front.cli.stdout import out, out_json
from rtshcua.front.cli.unlock import unlock_for
from rtshcua.onboard.enforcement.load import EnforcementMode
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.untrusted import Untrusted

app = typer.Typer(add_completion=False)

_CONSENT_HELP: Final = (
    "`--sitl`: a simulation, which a second ground station takes over; `--pilot NAME`: a real vehicle, and this pilot "
    "consents and holds the mode switch"
)


Source = Annotated[Path, typer.Argument(help="a source with a mission (.rts), under whose policy the sorties fly")]
Vehicle = Annotated[str, typer.Option(metavar="IDENTITY", help="identity of this vehicle, as in its policy")]
Sitl = Annotated[bool, typer.Option("--sitl", help="the vehicle is simulated: a second ground station takes over")]
Pilot = Annotated[
    str | None, typer.Option(metavar="NAME", help="the vehicle is real: this pilot consents and holds the switch")
]
Takeover = Annotated[bool, typer.Option("--takeover", help="with --pilot: ask the pilot to take over, and wait")]
Only = Annotated[list[str] | None, typer.Option(metavar="SORTIE", help="fly only this sortie (repeatable)")]
Mission = Annotated[str | None, typer.Option(help="the mission to use if the source has several")]
Speed = Annotated[float, typer.Option(min=0.1, max=50, help="speed-up of the simulated flight")]
PassphraseFile = Annotated[Path | None, typer.Option(help="file with the passphrase of the keys")]
Runs = Annotated[Path, typer.Option(help="folder in which the folders of the sorties are created")]
AsJson = Annotated[bool, typer.Option("--json", help="print one JSON object per event, the record last")]


@app.command()
def qualify(
    context: typer.Context,
    source: Source,
    connect: Connect,
    vehicle: Vehicle,
    sitl: Sitl = False,
    pilot: Pilot = None,
    takeover: Takeover = False,
    only: Only = None,
    mission: Mission = None,
    speed: Speed = 1.0,
    passphrase_file: PassphraseFile = None,
    signing_key: LinkKey = None,
    unsigned_radio: UnsignedRadio = False,
    system: System = None,
    no_fence: NoFence = False,
    utc_error: UtcError = None,
    runs: Runs = Path("runs"),
    as_json: AsJson = False,
) -> ExitCode:  # fmt: skip
    """Fly a short test of whether the autopilot meets the assumptions of its adapter, and sign a record of the result.

    The vehicle flies, so consent is required: `--sitl` or `--pilot NAME`. Exit codes: 0 every check passed; 13 a check
    failed.
    """
    problem = _unconsented(sitl=sitl, pilot=pilot) or conflict_of(context)
    if problem is not None:
        return problem
    link = address_of(connect)
    if isinstance(link, ExitCode):
        return link
    if sitl and not link.is_loopback:
        what = f"`--sitl` requires a loopback address: the vehicle at `{link}` may be real"
        return fail(ExitCode.USAGE, what, "forward the simulation's port to this machine, or use `--pilot NAME`")
    if speed != 1 and not sitl:
        return fail(ExitCode.USAGE, "`--speed` requires a simulated vehicle: `--sitl`")
    plan = _sorties(only or (), sitl=sitl, takeover=takeover, keyed=signing_key is not None)
    if isinstance(plan, ExitCode):
        return plan
    planned, missing = plan
    found = Findings(json=as_json)
    compiled, sources = compile_sources([source], mission=mission, issued_at_us=time.time_ns() // 1_000)
    if found.report(compiled.diagnostics, sources) or compiled.policy is None or compiled.mission is None:
        return found.finish(exit_code(compiled.diagnostics))
    if compiled.policy.vehicle.identity != vehicle:
        text = f"the policy is for `{compiled.policy.vehicle.identity}`, this vehicle is `{vehicle}`"
        return fail(ExitCode.REFUSED, text, IDENTITY_HELP, slug="wrong-vehicle")
    sorties = Qualifying(
        source, compiled.policy, compiled.mission, planned, missing, pilot=pilot or "", data=data_folder()
    )
    request = FlightRequest(
        bundle=Path(), link=link, mode=EnforcementMode.SOFTWARE, data=data_folder(), state=state_folder(), runs=runs,
        speed=speed, vehicle=vehicle, fence=not no_fence, signing_key=signing_key, unsigned_radio=unsigned_radio,
        system=system, utc_error_us=duration_us(utc_error),
    )  # fmt: skip
    console = TerminalConsole("json" if as_json else "lines", request.data, passphrase_file)
    if isinstance(result := _qualify(sorties, request, console), Refusal):
        return say_refused(result, as_json=as_json)
    _show(result, as_json=as_json)
    return result.code


def _unconsented(*, sitl: bool, pilot: str | None) -> ExitCode | None:
    """Report that nobody consented to the flight; None if somebody did."""
    if sitl and pilot is not None:
        return fail(ExitCode.USAGE, "`qualify` requires consent: `--sitl` or `--pilot NAME`, not both", _CONSENT_HELP)
    if sitl == (pilot is not None) or (pilot is not None and not pilot.strip()):
        return fail(ExitCode.USAGE, "`qualify` requires consent: either `--sitl` or `--pilot NAME`", _CONSENT_HELP)
    return None


def _sorties(
    only: Sequence[str], *, sitl: bool, takeover: bool, keyed: bool
) -> tuple[list[Sortie], dict[str, str]] | ExitCode:
    """Return the sorties that are flown, and why each other is not."""
    planned, missing = plan_sorties(sitl=sitl, takeover=takeover, keyed=keyed)
    named = {each.name: each for each in planned}
    unknown = sorted(set(only) - named.keys())
    if unknown:
        return fail(ExitCode.USAGE, f"unknown sortie `{unknown[0]}`", f"accepted: {', '.join(named)}")
    if not only:
        return planned, missing
    missing |= {name: "not flown (`--only`)" for name in named if name not in only}
    return [each for each in planned if each.name in only], missing


def _qualify(plan: Qualifying, request: FlightRequest, console: TerminalConsole) -> QualificationResult | Refusal:
    found = plan.choose_leg()
    if isinstance(found, Refusal):
        return found
    if found is not None:
        Findings(json=False).report(found.diagnostics, found.sources)
        text = f"`{plan.policy.name}` permits none of the candidate legs; the findings on the first one are above"
        return Refusal("not-permitted", text, _PERMIT_HELP, ExitCode.REFUSED)
    store, keys = KeyStore(request.data), dict[Duty, SigningKey]()
    try:
        for duty in (Duty.POLICY, Duty.LOG):
            keys[duty] = console.unlock(duty, None)
        keys[Duty.MISSION] = unlock_for(store, plan.mission, passphrase_file=console.passphrase_file)
        check_trusted(store, keys[Duty.MISSION], plan.policy, plan.mission)
    except Untrusted as error:
        return untrusted(error)

    def announce(sortie: Sortie) -> None:
        if console.as_json:
            console.emit({"event": "sortie", "name": sortie.name, "about": sortie.about})
        else:
            out(f"sortie {sortie.name}: {sortie.about}", flush=True)

    with tempfile.TemporaryDirectory(prefix="rtshcua-") as folder:
        refusal = plan.fly(replace(request, bundle=Path(folder)), console, keys, announce)
    return refusal or plan.judge(keys[Duty.LOG])


def _show(result: QualificationResult, *, as_json: bool) -> None:
    """Print the results and the path of the record."""
    record, broken_off, path, code = result
    if as_json:
        about = {"record": None if path is None else str(path), "exit_code": int(code)}
        out_json(msgspec.json.encode({"event": "qualification"} | described(record) | about).decode())
        return
    out(*told(record, broken_off))
    if path is not None:
        out(f"the record is in {path}")
    elif broken_off is None:
        out("no record was written; the record of the last complete qualification stays")


_PERMIT_HELP: Final = "permit takeoff to 6 or 10 m, goto 30 or 50 m from home at 2 to 5 m/s, hover, return and landing"
