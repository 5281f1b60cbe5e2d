"""Parameters of the autopilot as an operator configures them on a command line: `--set FENCE_RADIUS=300`."""

from collections.abc import Container, Iterable, Mapping, Sequence
from typing import Annotated, Final

import typer

from rtshcua.mavlink.parameters import bits_of, shown
from rtshcua.onboard.enforcement.preparation import unsettable

_CALLED: Final = {"px4": "PX4", "ardupilot": "ArduPilot"}
#: of those that may be set; the others are ArduPilot's
_OF_PX4: Final = ("GF_ACTION", "GF_MAX_HOR_DIST", "GF_MAX_VER_DIST", "RTL_RETURN_ALT")


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


def would_set(settings: Mapping[str, int]) -> list[str]:
    """What a rehearsal tells of what a flight would set."""
    listed = ", ".join(f"{name} to {shown(bits)}" for name, bits in settings.items())
    return [f"a flight would set {listed}, and is judged so; nothing is set here"] if listed else []


def untold(names: Iterable[str], told: Container[str], flavour: str) -> str | None:
    """That a vehicle of this flavour does not tell some of the parameters that are to be set; None where it does."""
    missing = [name for name in names if name not in told]
    if not missing:
        return None
    said = f"it does not tell `{'`, `'.join(missing)}`, which is to be set"
    return "; ".join([said, *foreign(missing, flavour)])


def foreign(names: Iterable[str], flavour: str) -> list[str]:
    """Of which of these parameters it is known that another autopilot has them, in words."""
    return [
        f"`{name}` is a parameter of {_CALLED[kind]}, and this is {_CALLED[flavour]}"
        for name in names
        if (kind := "px4" if name in _OF_PX4 else "ardupilot") != flavour
    ]


def _read(text: str) -> tuple[str, int | None]:
    name, _, value = text.partition("=")
    try:
        return name.strip(), bits_of(float(value))
    except ValueError:
        return name, None
