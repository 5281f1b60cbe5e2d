"""The options of flights, of the vehicle that flies and of the simulated one, as several commands share them."""

import re
from collections.abc import Sequence
from decimal import ROUND_CEILING, Decimal
from pathlib import Path
from typing import Annotated, Final

import typer

from rtshcua.adapters.boundary_process import program
from rtshcua.mavlink.parameters import bits_of
from rtshcua.model.faults import WindStep
from rtshcua.onboard.enforcement.load import EnforcementMode
from rtshcua.onboard.enforcement.preparation import unsettable
from rtshcua.simulation.config import AutopilotKind
from rtshcua.simulation.fault_syntax import OF_VEHICLE, parse_fault

_TIME = re.compile(r"(?P<number>[0-9]{1,9}(?:\.[0-9]{1,6})?) ?(?P<unit>ms|s|min)", re.ASCII)
_US = {"ms": 1_000, "s": 1_000_000, "min": 60_000_000}


def duration_text(text: str | None) -> str | None:
    """The option's value, checked."""
    if text is not None and not _TIME.fullmatch(text):
        raise typer.BadParameter(f"`{text}` is no time, such as 500ms or 2s")
    return text


Connect = Annotated[
    str,
    typer.Option(
        metavar="ADDRESS",
        help="the vehicle: `serial:/dev/ttyAMA0:921600`, or `tcp:`, `tcpin:`, `udpin:`, `udpout:HOST:PORT`",
    ),
]
LinkKey = Annotated[
    Path | None, typer.Option(metavar="FILE", help="the link's key: sign what is sent, believe nothing unsigned")
]
UnsignedRadio = Annotated[
    bool, typer.Option("--unsigned-radio", help="with a key: RADIO_STATUS unsigned, the worst of the last seconds")
]
System = Annotated[
    int | None, typer.Option(min=1, max=255, help="the vehicle's MAVLink system id, where there are several")
]
NoFence = Annotated[
    bool, typer.Option("--no-fence", help="leave the vehicle's own geofence as it is; else it becomes the airspace")
]
DecidesIn = Annotated[
    EnforcementMode | None,
    typer.Option(
        help="where decisions are made: in a process of their own (default with --connect, where its program was "
        "built) or in this one; `none` enforces nothing, in simulation",
    ),
]
UtcError = Annotated[
    str | None,
    typer.Option(
        metavar="TIME", callback=duration_text, help="how far UTC is off here, if neither kernel nor vehicle says"
    ),
]


def mode_of(mode: EnforcementMode | None, *, own: bool, named: bool) -> tuple[EnforcementMode, bool]:
    """Where decisions are made, and whether that is in this process only because there is no program of the boundary.
    `own`: the vehicle is our simulated one; `named`: a boundary was asked for in another way than by `mode`.
    """
    if mode is not None or (own and not named):
        return mode or EnforcementMode.SOFTWARE, False
    unbuilt = program() is None and not named
    return (EnforcementMode.SOFTWARE if unbuilt else EnforcementMode.PROCESS), unbuilt


def duration_us(text: str | None) -> int | None:
    """`500ms`, `1.5s` or `2min` in us, rounded up; None for no text. It was checked before."""
    found = None if text is None else _TIME.fullmatch(text)
    if found is None:
        return None
    return int((Decimal(found["number"]) * _US[found["unit"]]).to_integral_value(ROUND_CEILING))


# ---------------------------------------------------------------- parameters of the autopilot


def settings_text(texts: list[str] | None) -> list[str] | None:
    """The option's values, checked: each a parameter that may be set, to a value that it may be set to, and none
    twice.
    """
    named: set[str] = set()
    for text in texts or ():
        name, bits = _read(text)
        if bits is None:
            raise typer.BadParameter(f"`{text}` is not NAME=VALUE, with a number, such as FENCE_RADIUS=300")
        problem = unsettable(name, bits)
        if problem is not None:
            raise typer.BadParameter(problem)
        if name in named:
            raise typer.BadParameter(f"`{name}` is given twice")
        named.add(name)
    return texts


Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="NAME=VALUE", callback=settings_text,
        help="set a parameter of the autopilot for this flight, and put it back after it; repeatable",
    ),
]  # fmt: skip

MeantSettings = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="NAME=VALUE", callback=settings_text,
        help="judge it as `run` with the same would fly it; nothing is set here",
    ),
]  # fmt: skip


def settings_of(texts: Sequence[str] | None) -> dict[str, int]:
    """The values by name, as the 32 bits of a float; they were checked before."""
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
    """The wind as the simulated vehicle takes it, without units; a number without one is in m/s or degrees."""
    if text is None:
        return None
    parts = text.split(",")
    try:
        if not 2 <= len(parts) <= 3 or any(part.startswith("-") for part in parts):
            raise ValueError("two or three numbers that are not below zero are needed")
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
    """The callback of an option for a release: it is two numbers."""
    if text is not None and not _RELEASE.fullmatch(text):
        raise typer.BadParameter(f"`{text}` is no release, such as 1.18")
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


Flavour = Annotated[AutopilotKind | None, typer.Option(help="which autopilot the simulated vehicle is (px4)")]
Battery = Annotated[float | None, typer.Option(min=0, max=100, metavar="PERCENT", help="its charge at the start (100)")]
Wind = Annotated[
    str | None,
    typer.Option(
        metavar="SPEED,FROM[,GUST]", callback=_wind, help="such as 6m/s,270deg,2m/s: the mean, from where, gusts"
    ),
]
Faults = Annotated[
    list[str] | None,
    typer.Option(
        "--fault", metavar="KIND,at=TIME,...", callback=_faults,
        help=f"what goes wrong (repeatable): {', '.join(OF_VEHICLE)}; such as battery,at=30s,level=20%",
    ),
]  # fmt: skip
Home = Annotated[
    str | None, typer.Option(metavar="LAT,LON,AMSL", callback=_home, help="where it stands: degrees, degrees, metres")
]
Seed = Annotated[int | None, typer.Option(help="of its noise and gusts: the same seed, the same vehicle (1)")]


#: the options that say what the simulated vehicle is
OF_SIMULATOR: Final = ("--flavour", "--battery", "--wind", "--fault", "--seed")


def simulator_words(
    *,
    flavour: AutopilotKind | None,
    battery: float | None,
    wind: str | None,
    faults: list[str] | None,
    seed: int | None,
) -> list[str]:
    """The command line of the simulation's process; options left out keep its own defaults."""
    words: list[str] = []
    for name, value in (("flavour", flavour), ("battery", battery), ("wind", wind), ("seed", seed)):
        if value is not None:
            words += [f"--{name}", str(value)]
    for fault in faults or []:
        words += ["--fault", fault]
    return words


# ---------------------------------------------------------------- a run

Bundle = Annotated[Path, typer.Argument(help="what `rtshcua compile` made")]
OtherVehicle = Annotated[
    str | None,
    typer.Option(
        "--connect", metavar="ADDRESS",
        help="another vehicle: `serial:/dev/ttyAMA0:921600`, or `tcp:`, `tcpin:`, `udpin:`, `udpout:HOST:PORT`",
    ),
]  # fmt: skip
BoundaryUser = Annotated[
    str | None, typer.Option(metavar="USER", help="with `--mode process`: the user that it runs as; needs root")
]
BoundarySocket = Annotated[
    Path | None, typer.Option(metavar="PATH", help="with --connect: there a boundary listens, which has the keys")
]
Speed = Annotated[float, typer.Option(min=0.1, max=50, help="seconds of flight in a second; in simulation")]
Identity = Annotated[str | None, typer.Option(metavar="IDENTITY", help="who this vehicle is (as the bundle says)")]
Roots = Annotated[
    list[Path] | None,
    typer.Option("--root", help="the signed trust root, after those that lead to it (the key store's; repeatable)"),
]
LogKey = Annotated[Path | None, typer.Option(help="the key that signs the log (the key store's)")]
BoundaryKeyFile = Annotated[
    Path | None, typer.Option(help="the key that the enforcement boundary signs with (the key store's)")
]
PassphraseFile = Annotated[Path | None, typer.Option(help="a file with the passphrase of these keys")]
Runs = Annotated[Path, typer.Option(help="where the run's folder is made")]
StateFolder = Annotated[Path | None, typer.Option(help="where it is kept which bundles flew (the data folder)")]
FreshState = Annotated[bool, typer.Option("--fresh-state", help="forget which bundles flew; simulation only")]
AgentSocketPath = Annotated[
    Path | None, typer.Option(metavar="PATH", help="a local socket: records go out, signed documents come in")
]
OperatorSocket = Annotated[
    Path | None, typer.Option(metavar="PATH", help="another one, for operators: no agent holds up a recall there")
]
AgentGroup = Annotated[
    str | None, typer.Option(metavar="GROUP", help="users of this group may open the agent socket too")
]
Witnesses = Annotated[
    list[str] | None,
    typer.Option("--witness", metavar="udpout:HOST:PORT", help="a `rtshcua witness` that is shown the log; repeatable"),
]
ScenarioName = Annotated[
    str | None, typer.Option(metavar="FILE[:NAME]", help="let go wrong what a scenario says; simulation only")
]
Wait = Annotated[
    bool, typer.Option("--wait", help="connect, and fly nothing until a bundle is handed in at the agent socket")
]
WaitFor = Annotated[
    str | None,
    typer.Option(metavar="TIME", callback=duration_text, help="with --wait: how long at most [default: 60min]"),
]
DryRun = Annotated[bool, typer.Option("--dry-run", help="decide every step against the present state; send no motion")]
Plain = Annotated[bool, typer.Option("--plain", help="one line an event, in a terminal too")]
AsJson = Annotated[bool, typer.Option("--json", help="one JSON object an event, the summary last")]
