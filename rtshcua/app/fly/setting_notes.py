"""What is told of the parameters of the autopilot that a flight sets."""

from collections.abc import Container, Iterable, Mapping
from typing import Final

from rtshcua.mavlink.parameters import shown

_CALLED: Final = {"px4": "PX4", "ardupilot": "ArduPilot"}
#: of those that may be set; the others are ArduPilot's
_OF_PX4: Final = ("GF_ACTION", "GF_MAX_HOR_DIST", "GF_MAX_VER_DIST", "RTL_RETURN_ALT")


def would_set(settings: Mapping[str, int]) -> list[str]:
    """What a rehearsal tells of what a flight would set."""
    listed = ", ".join(f"{name} to {shown(bits)}" for name, bits in settings.items())
    return [f"a flight would set {listed}, and is judged so; nothing is set here"] if listed else []


def untold(names: Iterable[str], told: Container[str], flavour: str) -> str | None:
    """That a vehicle of this flavour does not tell some of the parameters that are to be set; None where it does."""
    missing = [name for name in names if name not in told]
    if not missing:
        return None
    said = f"the vehicle does not report `{'`, `'.join(missing)}`, which is to be set"
    return "; ".join([said, *foreign(missing, flavour)])


def foreign(names: Iterable[str], flavour: str) -> list[str]:
    """Of which of these parameters it is known that another autopilot has them, in words."""
    return [
        f"`{name}` is a parameter of {_CALLED[kind]}, and this is {_CALLED[flavour]}"
        for name in names
        if (kind := "px4" if name in _OF_PX4 else "ardupilot") != flavour
    ]
