"""Faults as a command line writes them: `wind,at=20s,speed=12m/s,from=270deg`."""

import re
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields
from decimal import Decimal
from typing import Any

from rtshcua.simulation.effects import message_number
from rtshcua.simulation.faults import (
    BatteryLevel,
    BatteryVoltage,
    Fault,
    Freeze,
    GpsGlitch,
    GpsJump,
    GpsLoss,
    Kill,
    LinkDelay,
    LinkJitter,
    LinkLoss,
    LinkQuality,
    LinkReorder,
    LinkSilence,
    MessageSilence,
    Obstacle,
    Pillar,
    PilotGoto,
    PilotMode,
    PilotPause,
    PilotSticks,
    Stall,
    Way,
    WindStep,
)
from rtshcua.simulation.modes import Mode

KINDS: Mapping[str, type[Fault]] = {
    "battery": BatteryLevel,
    "gps-loss": GpsLoss,
    "battery-voltage": BatteryVoltage,
    "gps-jump": GpsJump,
    "gps-glitch": GpsGlitch,
    "wind": WindStep,
    "link-delay": LinkDelay,
    "link-jitter": LinkJitter,
    "link-reorder": LinkReorder,
    "link-loss": LinkLoss,
    "link-silence": LinkSilence,
    "link-quality": LinkQuality,
    "obstacle": Obstacle,
    "pillar": Pillar,
    "pilot": PilotMode,
    "pilot-mode": PilotMode,
    "pilot-pause": PilotPause,
    "pilot-goto": PilotGoto,
    "pilot-sticks": PilotSticks,
    "kill": Kill,
    "stall": Stall,
    "freeze": Freeze,
    "mute": MessageSilence,
}

# How a field's name ends tells its unit; what may be written, and how many of the field's unit it is.
_UNITS: tuple[tuple[str, Mapping[str, int]], ...] = (
    ("_us", {"us": 1, "ms": 1000, "s": 1_000_000, "min": 60_000_000}),
    ("_mv", {"mV": 1, "V": 1000}),
    ("_mm_s", {"mm/s": 1, "m/s": 1000}),
    ("_mm", {"mm": 1, "m": 1000}),
    ("_deg", {"deg": 1}),
    ("", {"%": 100}),
)
_WORDS: Mapping[str, type[Mode | Way]] = {"mode": Mode, "way": Way}
_QUANTITY = re.compile(r"(-?\d+(?:\.\d+)?)(\D*)", re.ASCII)


def parse_fault(text: str) -> Fault:
    """The fault that a text describes. Raises ValueError, with a message for a person, if it describes none."""
    name, *pairs = text.split(",")
    kind = KINDS.get(name)
    if kind is None:
        raise ValueError(f"no such fault: `{name}`; there are {', '.join(KINDS)}")
    known = {_key(field): field for field in fields(kind)}
    values: dict[str, Any] = {}
    for pair in pairs:
        key, _, value = pair.partition("=")
        if key not in known:
            raise ValueError(f"`{name}` has no `{key}`; it takes {', '.join(known)}")
        values[known[key].name] = _value(known[key], value)
    missing = [key for key, field in known.items() if field.default is MISSING and field.name not in values]
    if missing:
        raise ValueError(f"`{name}` needs {', '.join(missing)}")
    return kind(**values)


def _suffix(field: Field[Any]) -> tuple[str, Mapping[str, int]]:
    return next(unit for unit in _UNITS if field.name.endswith(unit[0]))


def _key(field: Field[Any]) -> str:
    return field.name.removesuffix(_suffix(field)[0])


def _value(field: Field[Any], text: str) -> int | str:
    if field.name in _WORDS:
        if text not in list(_WORDS[field.name]):
            raise ValueError(f"no such {field.name}: `{text}`; there are {', '.join(_WORDS[field.name])}")
        return _WORDS[field.name](text)
    if field.name == "held":
        if text not in ("yes", "no"):
            raise ValueError(f"`held` is yes or no, not `{text}`")
        return text == "yes"
    if field.name == "shuffle":
        if not text.isdecimal():
            raise ValueError(f"`shuffle` is the seed of an order, not `{text}`")
        return int(text)
    if field.name == "message":
        message_number(text)
        return text
    match = _QUANTITY.fullmatch(text)
    units = _suffix(field)[1]
    if match is None or match[2] not in units:
        raise ValueError(f"`{_key(field)}` is a number with its unit ({', '.join(units)}), not `{text}`")
    return round(Decimal(match[1]) * units[match[2]])
