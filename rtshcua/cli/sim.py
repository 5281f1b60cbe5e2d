"""`rtshcua sim`: the simulated vehicle alone, for any ground station that speaks MAVLink."""

import json
from typing import Annotated

import typer

from rtshcua.adapters.simulator import Simulator, SimulatorError
from rtshcua.adapters.vehicle import address
from rtshcua.cli import simulated
from rtshcua.cli.faults import fail
from rtshcua.diagnostics.exits import ExitCode

PORT = 14_550

app = typer.Typer(add_completion=False)


@app.command()
def sim(
    flavour: simulated.Flavour = None,
    port: Annotated[int | None, typer.Option(min=1, max=65_535, help=f"UDP port to send to ({PORT})")] = None,
    connect: Annotated[str | None, typer.Option(metavar="udpout:HOST:PORT", help="the same, written as a link")] = None,
    speed: Annotated[float, typer.Option(min=0.1, max=200, help="seconds of flight in a second")] = 1.0,
    battery: simulated.Battery = None,
    wind: simulated.Wind = None,
    fault: simulated.Faults = None,
    seed: simulated.Seed = None,
    home: simulated.Home = None,
    as_json: Annotated[bool, typer.Option("--json", help="say what was started as one JSON object")] = False,
) -> ExitCode:
    """Start the simulated vehicle, until Ctrl-C. It sends to a UDP port of this machine and obeys what answers."""
    if port is not None and connect is not None:
        return fail(ExitCode.USAGE, "`--port` and `--connect` say the same thing: give one")
    if connect is not None:
        try:
            link = address.parse(connect)
        except ValueError as error:
            return fail(ExitCode.USAGE, str(error))
        if link.way != "udpout" or not link.is_loopback:
            return fail(
                ExitCode.USAGE,
                f"`{connect}` is not for the simulated vehicle",
                "it speaks to this machine alone: `udpout:127.0.0.1:PORT`",
            )
        port = link.port
    port = port or PORT
    words = simulated.arguments(flavour=flavour, battery=battery, wind=wind, faults=fault, seed=seed)
    if home is not None:
        words.append(f"--home={home}")
    try:
        vehicle = Simulator(["--port", str(port), "--speed", f"{speed:g}", *words])
    except SimulatorError as error:
        return fail(ExitCode.LINK, str(error))
    with vehicle:
        ready = vehicle.ready
        if as_json:
            print(json.dumps(ready), flush=True)
        else:
            print(f"a simulated {ready['flavour']} vehicle, system {ready['system']}, sends to udp port {port}")
            print(f"  fly it   rtshcua run BUNDLE --connect udpin:127.0.0.1:{port} --vehicle IDENTITY")
            print("  end it   Ctrl-C", flush=True)
        try:
            code = vehicle.wait()
        except KeyboardInterrupt:
            return ExitCode.OK
    return fail(ExitCode.FAULT, f"the simulated vehicle ended by itself, with code {code}")
