"""The options of a connection to a vehicle, as `run`, `qualify` and `doctor` share them."""

import re
from decimal import ROUND_CEILING, Decimal
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.adapters.boundary_process import program
from rtshcua.onboard.enforcement.load import EnforcementMode

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
