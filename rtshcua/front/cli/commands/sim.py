"""`rtshcua sim`: start the simulated vehicle alone, for any MAVLink ground station."""

import json
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from rtshcua.adapters.boundary.process import program
from rtshcua.adapters.simulator import Simulator, SimulatorError
from rtshcua.adapters.store.signing import LinkKeyError, read_link_key
from rtshcua.adapters.utc import kernel_error_us, vehicle_counts
from rtshcua.adapters.vehicle.address import LinkCarrier
from rtshcua.app.exit_codes import code_of
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.faults import fail
from rtshcua.front.cli.options import flight_options as simulated
from rtshcua.front.cli.options.addresses import address_of
from rtshcua.front.cli.stdout import out, out_json
from rtshcua.simulation.config import Answers, AutopilotKind, Boot, Estimate

PORT = 14_550
_FIRST_STEPS = {
    AutopilotKind.PX4: ("arm throttle", "long NAV_TAKEOFF -1 0 0 nan nan nan nan", "long NAV_RETURN_TO_LAUNCH"),
    AutopilotKind.ARDUPILOT: ("mode GUIDED", "arm throttle", "takeoff 10", "mode RTL"),
}
"""Commands for a first flight in MAVProxy. With PX4, `takeoff 10` means 10 m above sea level, so the vehicle would not
climb; and MAVProxy cannot encode PX4's modes (`mode RTL`)."""

app = typer.Typer(add_completion=False)


Port = Annotated[int | None, typer.Option(min=1, max=65_535, help=f"UDP port to send to (default: {PORT})")]
Connect = Annotated[str | None, typer.Option(metavar="udpout:HOST:PORT", help="the port to send to, as a link address")]
Speed = Annotated[float, typer.Option(min=0.1, max=200, help="speed-up of the simulation")]
System = Annotated[int, typer.Option(min=1, max=255, help="MAVLink system id")]
BootTime = Annotated[Boot, typer.Option(help="sensor start-up: 1 s, or as recorded (PX4 5 s, ArduCopter 42 s)")]
AnswerTime = Annotated[Answers, typer.Option(help="response delays: none, or as recorded")]
EstimateKind = Annotated[
    Estimate, typer.Option(help="position estimate: within centimetres, or as with a real receiver")
]
SigningKey = Annotated[
    Path | None, typer.Option(metavar="FILE", help="accept only frames signed with this key (see `keys link`)")
]
Stock = Annotated[
    bool, typer.Option("--stock", help="only GPS, barometer and battery: no radio, range finder, wind or voltage")
]
Parameter = Annotated[
    list[str] | None, typer.Option(metavar="NAME=VALUE", help="set an autopilot parameter (repeatable)")
]
Camera = Annotated[bool, typer.Option("--camera", help="with a camera: on PX4 component 100, else the autopilot's")]
Gimbal = Annotated[bool, typer.Option("--gimbal", help="with a gimbal that carries the camera: on PX4 component 154")]
Usb = Annotated[bool, typer.Option("--usb", help="treat the link as USB, where ArduCopter accepts unsigned commands")]
Release = Annotated[
    str | None,
    typer.Option(
        metavar="MAJOR.MINOR",
        callback=simulated.release,
        help="firmware release to simulate: PX4 1.16 (no signing), 1.17 or 1.18",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="print one JSON object about the started vehicle")]


@app.command()
def sim(
    flavour: simulated.Flavour = None,
    port: Port = None,
    connect: Connect = None,
    speed: Speed = 1.0,
    system: System = 1,
    battery: simulated.Battery = None,
    wind: simulated.Wind = None,
    fault: simulated.Faults = None,
    seed: simulated.Seed = None,
    home: simulated.Home = None,
    boot: BootTime = (Boot.FAST),
    answers: AnswerTime = Answers.RECORDED,
    estimate: EstimateKind = Estimate.CLOSE,
    signing_key: SigningKey = None,
    stock: Stock = False,
    camera: Camera = False,
    gimbal: Gimbal = False,
    parameter: Parameter = None,
    usb: Usb = False,
    release: Release = None,
    as_json: AsJson = False,
) -> ExitCode:
    """Run the simulated vehicle until Ctrl-C. It sends to a UDP port of this machine and obeys its peer there."""
    if port is not None and connect is not None:
        return fail(ExitCode.USAGE, "`--port` and `--connect` cannot be combined: both set the port")
    if connect is not None:
        if isinstance(link := address_of(connect, ways=(LinkCarrier.UDP_OUT,)), ExitCode):
            return link
        if not link.is_loopback:
            help = "the simulated vehicle accepts only `udpout:127.0.0.1:PORT`"
            return fail(ExitCode.USAGE, f"`{connect}` is not on this machine", help)
        port = link.port
    port = port or PORT
    words = simulated.simulator_words(flavour=flavour, battery=battery, wind=wind, faults=fault, seed=seed)
    if home is not None:
        words.append(f"--home={home}")
    if signing_key is not None:
        if (unread := _unread(signing_key)) is not None:
            return unread
        words.append(f"--signing-key={signing_key}")
    words += [f"--parameter={each}" for each in parameter or ()]
    words += _flags(usb=usb, stock=stock, camera=camera, gimbal=gimbal)
    words += [f"--release={release}"] if release is not None else []
    words += [f"--boot={boot}", f"--answers={answers}", f"--estimate={estimate}"]
    try:
        vehicle = Simulator(["--port", str(port), "--speed", f"{speed:g}", "--system", str(system), *words])
    except SimulatorError as error:
        return fail(ExitCode.USAGE if error.usage else ExitCode.LINK, str(error))
    with vehicle:
        if as_json:
            out_json(json.dumps(vehicle.ready), flush=True)
        else:
            out(*_introduction(vehicle.ready, port, signing_key, speed), flush=True)
        try:
            code = vehicle.wait()
        except KeyboardInterrupt:
            return ExitCode.OK
    return fail(ExitCode.FAULT, f"the simulated vehicle ended unexpectedly with code {code}")


def _flags(**given: bool) -> list[str]:
    return [f"--{name}" for name, on in given.items() if on]


def _unread(path: Path) -> ExitCode | None:
    """Report a link key that cannot be read; None if it can."""
    try:
        read_link_key(path)
    except LinkKeyError as error:
        return fail(code_of(error.slug), str(error), error.help, slug=f"link-key-{error.slug}")
    except OSError as error:
        return fail(ExitCode.INPUT, str(error))
    return None


def _options(signing_key: Path | None, speed: float) -> str:
    """Return the options that `run` needs to fly this vehicle, other than its address.

    The vehicle shares this machine's clock, so `--utc-error` is needed only at normal speed and if neither the kernel
    nor the vehicle bounds the error.
    """
    words = [] if signing_key is None else [f"--signing-key {shlex.quote(str(signing_key))} --unsigned-radio"]
    if speed != 1:
        words.append(f"--speed {speed:g}")
    elif not vehicle_counts(apart=program() is not None, keyed=signing_key is not None) and kernel_error_us() is None:
        words.append("--utc-error 500ms")
    return " ".join(words)


def _introduction(ready: Mapping[str, Any], port: int, signing_key: Path | None, speed: float) -> list[str]:
    """Return the introduction: the started vehicle, and the commands to fly it."""
    flavour = AutopilotKind(ready["flavour"])
    more = _options(signing_key, speed)
    finds = "start it; it listens on this port"
    adds = f"Application Settings, Comm Links, Add: type UDP, port {port}"
    return [
        f"a simulated {flavour} vehicle, system {ready['system']}, sends to udp port {port}",
        f"  fly it           rtshcua run BUNDLE --connect udpin:127.0.0.1:{port} \\",
        f"                     --vehicle IDENTITY{' ' if more else ''}{more}",
        f"  QGroundControl   {finds if port == PORT else adds}",
        f"  MAVProxy         mavproxy.py --master=udpin:127.0.0.1:{port}",
        f"                   then: {', '.join(f'`{step}`' for step in _FIRST_STEPS[flavour])}",
        f"  MAVSDK           udpin://127.0.0.1:{port}",
        "  stop it          Ctrl-C",
    ]
