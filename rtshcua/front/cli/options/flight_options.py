"""Options shared by the commands that fly: of the flight, the vehicle and the simulated vehicle."""

import re
from collections.abc import Sequence
from decimal import ROUND_CEILING, Decimal
from pathlib import Path
from typing import Annotated, Final

import typer

from rtshcua.adapters.boundary.process import program
from rtshcua.mavlink.parameters import bits_of
from rtshcua.model.faults import WindStep
from rtshcua.onboard.enforcement.load import EnforcementMode
from rtshcua.onboard.enforcement.preparation import unsettable
from rtshcua.simulation.config import AutopilotKind
from rtshcua.simulation.fault_syntax import OF_VEHICLE, parse_fault

_TIME = re.compile(r"(?P<number>[0-9]{1,9}(?:\.[0-9]{1,6})?) ?(?P<unit>ms|s|min)", re.ASCII)
_US = {"ms": 1_000, "s": 1_000_000, "min": 60_000_000}


def duration_text(text: str | None) -> str | None:
    """Validate the value of a duration option."""
    if text is not None and not _TIME.fullmatch(text):
        raise typer.BadParameter(f"`{text}` is not a duration, such as 500ms or 2s")
    return text


Connect = Annotated[
    str,
    typer.Option(
        metavar="ADDRESS",
        help="the vehicle's address: `serial:/dev/ttyAMA0:921600`, or `tcp:`, `tcpin:`, `udpin:`, `udpout:HOST:PORT`",
    ),
]
LinkKey = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="key of the link: sign outbound frames, ignore unsigned inbound frames"),
]
UnsignedRadio = Annotated[
    bool,
    typer.Option(
        "--unsigned-radio", help="with --signing-key: accept unsigned RADIO_STATUS, and use the worst recent value"
    ),
]
System = Annotated[
    int | None, typer.Option(min=1, max=255, help="MAVLink system id of the vehicle, if there are several")
]
NoFence = Annotated[bool, typer.Option("--no-fence", help="do not upload the airspace as the vehicle's geofence")]
DecidesIn = Annotated[
    EnforcementMode | None,
    typer.Option(
        help="where decisions are made: in a separate process (default with --connect if its program is built) or in "
        "this one; `trustzone-m`, `optee`: in an emulated secure world; `none` enforces nothing, simulation only",
    ),
]
UtcError = Annotated[
    str | None,
    typer.Option(
        metavar="TIME",
        callback=duration_text,
        help="bound on the UTC error of this machine, if neither kernel nor vehicle reports one",
    ),
]


def mode_of(mode: EnforcementMode | None, *, own: bool, named: bool) -> tuple[EnforcementMode, bool]:
    """Return where decisions are made, and whether this process decides only because the boundary is not built.

    `own`: the run starts the simulated vehicle; `named`: an option other than `--mode` requires a boundary process.
    """
    if mode is not None or (own and not named):
        return mode or EnforcementMode.SOFTWARE, False
    unbuilt = program() is None and not named
    return (EnforcementMode.SOFTWARE if unbuilt else EnforcementMode.PROCESS), unbuilt


def duration_us(text: str | None) -> int | None:
    """Return a validated duration (`500ms`, `1.5s`, `2min`) in us, rounded up; None for None."""
    found = None if text is None else _TIME.fullmatch(text)
    if found is None:
        return None
    return int((Decimal(found["number"]) * _US[found["unit"]]).to_integral_value(ROUND_CEILING))


# ---------------------------------------------------------------- parameters of the autopilot


def settings_text(texts: list[str] | None) -> list[str] | None:
    """Validate the values of `--set`: each is a settable parameter with an accepted value, and none occurs twice."""
    named: set[str] = set()
    for text in texts or ():
        name, bits = _read(text)
        if bits is None:
            raise typer.BadParameter(f"`{text}` is not NAME=NUMBER, such as FENCE_RADIUS=300")
        problem = unsettable(name, bits)
        if problem is not None:
            raise typer.BadParameter(problem)
        if name in named:
            raise typer.BadParameter(f"`{name}` occurs twice")
        named.add(name)
    return texts


Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="NAME=VALUE", callback=settings_text,
        help="set an autopilot parameter for this flight and restore it afterwards (repeatable)",
    ),
]  # fmt: skip

MeantSettings = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="NAME=VALUE", callback=settings_text,
        help="assume that `run` sets this parameter; doctor sets nothing (repeatable)",
    ),
]  # fmt: skip


def settings_of(texts: Sequence[str] | None) -> dict[str, int]:
    """Return the validated values by parameter name, each as the 32 bits of a float."""
    found = dict(map(_read, texts or ()))
    return {name: bits for name, bits in found.items() if bits is not None}


def _read(text: str) -> tuple[str, int | None]:
    name, _, value = text.partition("=")
    try:
        return name.strip(), bits_of(float(value))
    except ValueError:
        return name, None


# ---------------------------------------------------------------- the simulated vehicle

_BARE = re.compile(r"\d+(\.\d+)?", re.ASCII)
_WIND = ("speed", "m/s"), ("from", "deg"), ("gust", "m/s")
_RELEASE = re.compile(r"\d{1,2}\.\d{1,2}", re.ASCII)
_HOME = re.compile(r"-?\d+(\.\d+)?,-?\d+(\.\d+)?,-?\d+(\.\d+)?", re.ASCII)


def _wind(text: str | None) -> str | None:
    """Return the wind in the form of the simulated vehicle, without units; plain numbers are m/s and degrees."""
    if text is None:
        return None
    parts = text.split(",")
    try:
        if not 2 <= len(parts) <= 3 or any(part.startswith("-") for part in parts):
            raise ValueError("expected two or three non-negative numbers")
        words = (
            f"{name}={part}{unit if _BARE.fullmatch(part) else ''}"
            for (name, unit), part in zip(_WIND, parts, strict=False)
        )
        wind = parse_fault(",".join(("wind,at=0s", *words)))
    except ValueError as error:
        raise typer.BadParameter(f"`{text}` is not SPEED,FROM[,GUST], as in 6m/s,270deg,2m/s: {error}") from None
    assert isinstance(wind, WindStep)
    return f"{wind.speed_mm_s / 1000:g},{wind.from_deg},{wind.gust_mm_s / 1000:g}"


def release(text: str | None) -> str | None:
    """Validate the value of a release option: two numbers."""
    if text is not None and not _RELEASE.fullmatch(text):
        raise typer.BadParameter(f"`{text}` is not a release, such as 1.18")
    return text


def _home(text: str | None) -> str | None:
    if text is not None and not _HOME.fullmatch(text):
        raise typer.BadParameter(f"`{text}` is not LAT,LON,AMSL in degrees, degrees and metres")
    return text


def _faults(texts: list[str] | None) -> list[str] | None:
    for text in texts or []:
        try:
            parse_fault(text)
        except ValueError as error:
            raise typer.BadParameter(str(error)) from None
    return texts


Flavour = Annotated[AutopilotKind | None, typer.Option(help="autopilot of the simulated vehicle (default: px4)")]
Battery = Annotated[
    float | None, typer.Option(min=0, max=100, metavar="PERCENT", help="charge at the start (default: 100)")
]
Wind = Annotated[
    str | None,
    typer.Option(
        metavar="SPEED,FROM[,GUST]", callback=_wind, help="mean wind, its direction and gusts, such as 6m/s,270deg,2m/s"
    ),
]
Faults = Annotated[
    list[str] | None,
    typer.Option(
        "--fault", metavar="KIND,at=TIME,...", callback=_faults,
        help=f"inject a fault, such as battery,at=30s,level=20% (repeatable); kinds: {', '.join(OF_VEHICLE)}",
    ),
]  # fmt: skip
Home = Annotated[
    str | None,
    typer.Option(metavar="LAT,LON,AMSL", callback=_home, help="start position in degrees, degrees and metres"),
]
Seed = Annotated[int | None, typer.Option(help="seed of its noise and gusts (default: 1)")]


#: the options of the simulated vehicle
OF_SIMULATOR: Final = ("--flavour", "--battery", "--wind", "--fault", "--seed")


def simulator_words(
    *,
    flavour: AutopilotKind | None,
    battery: float | None,
    wind: str | None,
    faults: list[str] | None,
    seed: int | None,
) -> list[str]:
    """Return the command line arguments of the simulation process; omitted options keep its defaults."""
    words: list[str] = []
    for name, value in (("flavour", flavour), ("battery", battery), ("wind", wind), ("seed", seed)):
        if value is not None:
            words += [f"--{name}", str(value)]
    for fault in faults or []:
        words += ["--fault", fault]
    return words


# ---------------------------------------------------------------- a run

Bundle = Annotated[Path, typer.Argument(help="a bundle from `rtshcua compile`")]
OtherVehicle = Annotated[
    str | None,
    typer.Option(
        "--connect", metavar="ADDRESS",
        help="fly this vehicle: `serial:/dev/ttyAMA0:921600`, or `tcp:`, `tcpin:`, `udpin:`, `udpout:HOST:PORT`",
    ),
]  # fmt: skip
BoundaryUser = Annotated[
    str | None, typer.Option(metavar="USER", help="with `--mode process`: run the boundary as this user; requires root")
]
BoundarySocket = Annotated[
    Path | None, typer.Option(metavar="PATH", help="with --connect: socket of a listening boundary, which has the keys")
]
Speed = Annotated[float, typer.Option(min=0.1, max=50, help="speed-up of the simulated flight")]
Identity = Annotated[
    str | None, typer.Option(metavar="IDENTITY", help="identity of this vehicle (default: the bundle's)")
]
Roots = Annotated[
    list[Path] | None,
    typer.Option("--root", help="signed trust root, after its predecessors (repeatable; default: the key store's)"),
]
LogKey = Annotated[Path | None, typer.Option(help="key that signs the log (default: the key store's)")]
BoundaryKeyFile = Annotated[
    Path | None, typer.Option(help="key of the enforcement boundary (default: the key store's)")
]
PassphraseFile = Annotated[Path | None, typer.Option(help="file with the passphrase of these keys")]
Runs = Annotated[Path, typer.Option(help="folder in which the folder of the run is created")]
StateFolder = Annotated[
    Path | None, typer.Option(help="folder that records which bundles have flown (default: the data folder)")
]
FreshState = Annotated[bool, typer.Option("--fresh-state", help="ignore which bundles have flown; simulation only")]
AgentSocketPath = Annotated[
    Path | None,
    typer.Option(metavar="PATH", help="create a local socket that sends records and receives signed documents"),
]
OperatorSocket = Annotated[
    Path | None,
    typer.Option(metavar="PATH", help="create a separate one for operators, where agents cannot delay a recall"),
]
AgentGroup = Annotated[str | None, typer.Option(metavar="GROUP", help="let users of this group open the agent socket")]
Witnesses = Annotated[
    list[str] | None,
    typer.Option(
        "--witness",
        metavar="udpout:HOST:PORT",
        help="send the log's checkpoints to this `rtshcua witness` (repeatable)",
    ),
]
ScenarioName = Annotated[
    str | None, typer.Option(metavar="FILE[:NAME]", help="fly with the faults of this scenario; simulation only")
]
Wait = Annotated[
    bool, typer.Option("--wait", help="connect, then wait until a bundle is submitted at the agent socket")
]
WaitFor = Annotated[
    str | None,
    typer.Option(metavar="TIME", callback=duration_text, help="with --wait: longest wait [default: 60min]"),
]
Live = Annotated[
    bool,
    typer.Option(
        "--live", help="hold after the last step and wait for replacements, which may supersede the running step"
    ),
]
Idle = Annotated[
    str | None,
    typer.Option(metavar="TIME", callback=duration_text, help="with --live: longest wait in the air [default: 5min]"),
]
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="decide each step on the present state; send no motion command")
]
Plain = Annotated[bool, typer.Option("--plain", help="print one line per event, also in a terminal")]
AsJson = Annotated[bool, typer.Option("--json", help="print one JSON object per event, the summary last")]
