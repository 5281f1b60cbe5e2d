"""Parameters of the autopilot as an operator configures them on a command line: `--set FENCE_RADIUS=300`."""

from collections.abc import Sequence
from typing import Annotated

import typer

from rtshcua.mavlink.parameters import bits_of
from rtshcua.onboard.enforcement.preparation import unsettable


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
