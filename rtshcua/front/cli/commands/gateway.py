"""`rtshcua gateway`: let MAVLink clients reach a vehicle only through the contracts of a policy."""

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import as_json as saying_json
from rtshcua.front.cli.faults import distrust, fail, refuse
from rtshcua.front.cli.options import flight_options as flight
from rtshcua.front.cli.options.flight_options import duration_us, simulator_words
from rtshcua.front.cli.stdout import out, out_json, out_source
from rtshcua.wire.untrusted import Untrusted

app = typer.Typer(add_completion=False)

_LENGTH = re.compile(r"(?P<number>[0-9]{1,6}(?:\.[0-9]{1,3})?) ?(?P<unit>mm|cm|m|km)?", re.ASCII)
_UNITS = {"mm": 1, "cm": 10, "m": 1_000, "km": 1_000_000}
_UTC_ERROR_US = 500_000
_IDENTITY = "gateway-01"

Config = Annotated[list[str] | None, typer.Argument(metavar="CONFIG", help="a configuration, `gateway.toml`")]
Allow = Annotated[
    str | None, typer.Option(metavar="SKILLS", help="write the policy: permit these, such as takeoff,goto,land")
]
Below = Annotated[str | None, typer.Option(metavar="HEIGHT", help="with --allow: the highest altitude, such as 30 m")]
Inside = Annotated[
    str | None,
    typer.Option(metavar="FILE[#NAME]", help="with --allow: the area, a polygon of a KML or GeoJSON file"),
]
Save = Annotated[
    Path | None, typer.Option(metavar="FOLDER", help="with --allow: keep the policy and the configuration there")
]
Client = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=ADDRESS[,role=R]",
        help="a client's own address, its role and limits: rank=N, requests=A+B, rate=N, peers=N (repeatable)",
    ),
]
Pilot = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="the pilot's ground station, which has full passage")
]
Policy = Annotated[list[Path] | None, typer.Option("--policy", metavar="FILE", help="a source of the policy")]
SignedBundle = Annotated[Path | None, typer.Option("--bundle", help="a bundle that was signed under this policy")]
Sessions = Annotated[int | None, typer.Option(min=1, metavar="N", help="end after so many flights")]


@app.command()
def gateway(
    config: Config = None, allow: Allow = None, below: Below = None, inside: Inside = None, save: Save = None,
    connect: flight.OtherVehicle = None, client: Client = None, pilot: Pilot = None, policy: Policy = None,
    bundle: SignedBundle = None, vehicle: flight.Identity = None, system: flight.System = None,
    signing_key: flight.LinkKey = None, unsigned_radio: flight.UnsignedRadio = False,
    utc_error: flight.UtcError = None, set_: flight.Settings = None, flavour: flight.Flavour = None,
    battery: flight.Battery = None, wind: flight.Wind = None, fault: flight.Faults = None, seed: flight.Seed = None,
    runs: Annotated[Path | None, typer.Option(help="folder of the runs")] = None,
    state_dir: flight.StateFolder = None, operator_socket: flight.OperatorSocket = None,
    passphrase_file: flight.PassphraseFile = None, sessions: Sessions = None, as_json: flight.AsJson = False,
) -> ExitCode:  # fmt: skip
    """Stand between a vehicle and its MAVLink clients: a client's command becomes a step that the policy must permit.

    In one minute, without a file: `rtshcua gateway --allow takeoff,goto,land --below 30 m --inside field.kml`. Without
    `--connect` it starts the simulated vehicle, without `--client` it serves udp ports 14550 and 14540 and tcp 5770.

    Exit codes: 0 stopped by Ctrl-C while nothing flew, or the last flight of --sessions succeeded; 1 the policy has
    errors; 2 wrong command line; 3 a file cannot be read; 4 a key is not trusted; 5 the vehicle cannot be flown under
    the policy; 8 an address cannot be opened, or no vehicle answers; 130 stopped by Ctrl-C in flight, after a landing.
    """
    with saying_json(wanted=as_json):
        from rtshcua.app.gateway.configuration import Misconfigured

        typed = _Typed(
            config or [], allow, below, inside, save, client or [], pilot, policy or [], bundle,
            {
                "connect": connect, "identity": vehicle, "system": system, "signing_key": signing_key,
                "unsigned_radio": unsigned_radio, "utc_error": utc_error, "settings": tuple(set_ or ()),
            },
            runs, state_dir,
        )  # fmt: skip
        try:
            request = _request(typed)
        except Misconfigured as error:
            return refuse(error.refusal, ExitCode.USAGE if error.refusal.slug == "usage" else None)
        if isinstance(request, Refusal):
            return refuse(request)
        simulated = request.configuration.vehicle.connect is None
        words = simulator_words(flavour=flavour, battery=battery, wind=wind, faults=fault, seed=seed)
        if words and not simulated:
            text = "options of the simulated vehicle cannot be combined with `--connect`"
            return fail(ExitCode.USAGE, text, "if you connect to `rtshcua sim`, pass them to `rtshcua sim`")
        request = replace(
            request, simulator=words, flavour=flavour or request.flavour, sessions=sessions,
            utc_error_us=duration_us(utc_error) or _UTC_ERROR_US, operator_socket=operator_socket,
            passphrase_file=passphrase_file,
        )  # fmt: skip
        return _run(request, as_json=as_json)


def _run(request: Any, *, as_json: bool) -> ExitCode:
    from rtshcua.adapters.store.keystore import KeyStore
    from rtshcua.app.gateway.policy_in_force import Unlock
    from rtshcua.app.gateway.starting import start_gateway
    from rtshcua.front.cli.unlock import unlock

    def unlocking(store: KeyStore) -> Unlock:
        return lambda duty, whose: unlock(store, duty, whose=whose, passphrase_file=request.passphrase_file)

    try:
        ended = start_gateway(request, _Console(as_json=as_json), unlocking)
    except Untrusted as error:
        return distrust(error)
    return refuse(ended) if isinstance(ended, Refusal) else ended


# ---------------------------------------------------------------------------------------------------- the command line


@dataclass(frozen=True)
class _Typed:
    """What the command line says."""

    config: list[str]
    allow: str | None
    below: str | None
    inside: str | None
    save: Path | None
    clients: list[str]
    pilot: str | None
    policy: list[Path]
    bundle: Path | None
    vehicle: Mapping[str, Any]
    runs: Path | None
    state: Path | None


def _request(typed: _Typed) -> Any:
    """Return the request of a command line. Raises `Misconfigured`."""
    from rtshcua.app.gateway.configuration import GatewayConfiguration, read_configuration

    below, files = _unit_apart(typed.below, typed.config)
    if len(files) > 1:
        return Refusal("usage", f"`{files[1]}`: one configuration at a time", "quote values with spaces: '30 m'")
    read = read_configuration(Path(files[0])) if files else GatewayConfiguration()
    return read if isinstance(read, Refusal) else _requested(typed, read, below)


def _requested(typed: _Typed, read: Any, below: str | None) -> Any:
    """Return the request of a configuration and the options that replace what it says. Raises `Misconfigured`."""
    from rtshcua.app.gateway.configuration import address_in, client_in, clients_of, distinct, pilot_in
    from rtshcua.app.gateway.starting import GatewayRequest

    given = {key: value for key, value in typed.vehicle.items() if value not in (None, False, ())}
    if "connect" in given:
        address_in(given["connect"], "--connect")
    sides = [client_in(each) for each in typed.clients] + ([] if typed.pilot is None else [pilot_in(typed.pilot)])
    configuration = replace(
        read,
        vehicle=replace(read.vehicle, **given),
        clients=distinct(sides) if sides else read.clients,
        sources=tuple(typed.policy) or read.sources,
        bundle=typed.bundle or read.bundle,
        state=typed.state or read.state,
        runs=typed.runs or read.runs,
    )
    configuration = replace(configuration, clients=clients_of(configuration))
    if typed.allow is None:
        return _with_policy(typed, GatewayRequest(configuration))
    if configuration.sources:
        return Refusal("usage", "`--allow` writes the policy, so it cannot be combined with `--policy` or `sources`")
    quick = _quick(typed, below)
    return quick if isinstance(quick, Refusal) else GatewayRequest(configuration, quick, typed.save)


def _with_policy(typed: _Typed, request: Any) -> Any:
    """Return the request if it has a policy, and no option of the policy that `--allow` writes."""
    for option, value in (("--below", typed.below), ("--inside", typed.inside), ("--save", typed.save)):
        if value is not None:
            return Refusal("usage", f"`{option}` requires `--allow`", "as in `--allow takeoff,goto,land --below 30 m`")
    if not request.configuration.sources:
        help = "for a first try: `rtshcua gateway --allow takeoff,goto,land --below 30 m`; else `--policy FILE`"
        return Refusal("usage", "the gateway has no policy", help)
    return request


def _quick(typed: _Typed, below: str | None) -> Any:
    """Return the rules of the policy that `--allow` writes."""
    from rtshcua.app.gateway.outlines import read_outline
    from rtshcua.app.gateway.quick_policy import HIGHEST_MM, LOWEST_MM, QuickRules, allowed_skills

    assert typed.allow is not None
    if below is None:
        return Refusal("usage", "`--allow` requires `--below HEIGHT`", "as in `--below 30 m`")
    skills = allowed_skills(typed.allow)
    if isinstance(skills, Refusal):
        return skills
    found = _LENGTH.fullmatch(below.strip())
    if found is None or found["unit"] is None:
        near = f"did you mean `{found['number']} m`?" if found is not None else "as in `--below 30 m`"
        return Refusal("usage", f"`{below}` in `--below` is not a height", near)
    height = round(float(found["number"]) * _UNITS[found["unit"]])
    if not LOWEST_MM <= height <= HIGHEST_MM:
        nearest = LOWEST_MM if height < LOWEST_MM else HIGHEST_MM
        return Refusal("usage", f"`--below {below}` is out of range", f"the nearest is `{nearest // 1_000} m`")
    if typed.inside is None:
        return QuickRules(skills, height, (), _identity(typed))
    path, _, name = typed.inside.partition("#")
    area = read_outline(Path(path), name or None)
    return area if isinstance(area, Refusal) else QuickRules(skills, height, area, _identity(typed))


def _identity(typed: _Typed) -> str:
    return typed.vehicle["identity"] or _IDENTITY


def _unit_apart(below: str | None, words: list[str]) -> tuple[str | None, list[str]]:
    """Return the height and the other words of `--below 30 m`, where a shell makes two words of it."""
    if below is not None and below.replace(".", "", 1).isdigit() and words and words[0].isalpha():
        return f"{below} {words[0]}", words[1:]
    return below, words


# ---------------------------------------------------------------------------------------------------- the output


class _Console:
    """Prints the events of a gateway."""

    def __init__(self, *, as_json: bool) -> None:
        self._as_json = as_json

    def tell(self, event: Mapping[str, object]) -> None:
        """Print an event: as JSON, or in words."""
        if self._as_json:
            out_json(json.dumps(event, ensure_ascii=False), flush=True)
            return
        shows = _SHOWN.get(str(event["event"]))
        if shows is not None:
            shows(event)


def _policy(event: Mapping[str, Any]) -> None:
    if "why" in event:
        out(f"the policy was renewed: {event['why']}; what changed:", "")
        out_source("\n".join(event["changed"]) + "\n")
        out("", flush=True)
        return
    out("the policy:", "")
    out_source(event["text"])
    out("", flush=True)


def _ready(event: Mapping[str, Any]) -> None:
    lines = [f"{event['vehicle']} under {event['policy']}; clients connect here:"]
    for each in event["clients"]:
        who = "pilot, full passage" if each["pilot"] else f"as {each['role']}"
        lines.append(f"  {each['name']:<10} {each['connect']}  ({who})")
    if any("0.0.0.0" in each["opened"] for each in event["clients"]):
        lines.append("  from another machine, with this one's address in place of 127.0.0.1")
    lines.append(f"  logs in {event['runs']}/; a person recalls a flight with --to {event['operator_socket']}")
    if event["development"]:
        lines.append(f"  development keys without a passphrase, for trying out only: {event['keys']}")
    if event["saved"] is not None:
        lines.append(f"  go on with `rtshcua gateway {event['saved']}/gateway.toml`")
    out(*lines, "  stop it    Ctrl-C", flush=True)


def _client(event: Mapping[str, Any]) -> None:
    """Print one line about a request: who, whether it was permitted, what, and why not."""
    told = dict(event["told"])
    who, effect, more = told.pop("client"), told.pop("effect"), told.pop("left_out", 0)
    arguments = "".join(f" {name} {value}" for name, value in told.get("arguments", {}).items())
    what = " ".join(f"{key} {told[key]}" for key in ("command", "message", "mode", "parameter") if key in told)
    text = told.get("answer") or ": ".join(filter(None, (f"{effect} {told.get('skill', what)}", told.get("reason"))))
    left = f" ({more} more before it)" if more else ""
    out(f"{who}: {text}{arguments}{left}", flush=True)


def _session(event: Mapping[str, Any]) -> None:
    out(f"session ended: {event['ending']} (code {event['exit_code']})", flush=True)
    if event["log"]:
        out(f"  rtshcua verify-log --audit {event['log']} --root {event['root']}", flush=True)


def _note(form: str) -> Callable[[Mapping[str, Any]], None]:
    """Return a function that prints one line of an event."""
    return lambda event: out(form.format_map(event), flush=True)


_SHOWN: Final[Mapping[str, Callable[[Mapping[str, Any]], None]]] = {
    "policy": _policy,
    "examining": _note("asking the vehicle at {vehicle} for its home"),
    "ready": _ready,
    "client-up": _note("{name} connected from {peer}"),
    "client-down": _note("{name} is gone: {why}"),
    "client": _client,
    "session": _session,
    "flight-failed": _note("the flight ended with {exit_code}: {text}"),
    "cancelled": _note("the flight is cancelled: {why}"),
    "interrupted": _note("Ctrl-C: the vehicle is brought down"),
    "note": _note("note: {text}"),
    "summary": _note("the gateway ended; flights: {sessions}"),
}
