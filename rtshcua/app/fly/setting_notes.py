"""Notes about autopilot parameters that a flight sets."""

from collections.abc import Container, Iterable, Mapping
from typing import Final

from rtshcua.mavlink.parameters import shown

_CALLED: Final = {"px4": "PX4", "ardupilot": "ArduPilot"}
#: the settable parameters of PX4; the others are ArduPilot's
_OF_PX4: Final = ("GF_ACTION", "GF_MAX_HOR_DIST", "GF_MAX_VER_DIST", "RTL_RETURN_ALT")


def would_set(settings: Mapping[str, int]) -> list[str]:
    """The note of a rehearsal about parameters that a flight would set."""
    listed = ", ".join(f"{name} to {shown(bits)}" for name, bits in settings.items())
    return [f"a flight would set {listed}; this rehearsal assumes those values and sets nothing"] if listed else []


def untold(names: Iterable[str], reported: Container[str], flavour: str) -> str | None:
    """A text if the vehicle does not report some of the parameters to set; None if it reports all."""
    missing = [name for name in names if name not in reported]
    if not missing:
        return None
    text = f"the vehicle does not report `{'`, `'.join(missing)}`, which is to be set"
    return "; ".join([text, *foreign(missing, flavour)])


def foreign(names: Iterable[str], flavour: str) -> list[str]:
    """A text for each parameter that belongs to another autopilot."""
    return [
        f"`{name}` is a parameter of {_CALLED[kind]}, and this is {_CALLED[flavour]}"
        for name in names
        if (kind := "px4" if name in _OF_PX4 else "ardupilot") != flavour
    ]
