"""The MAVLink dialect as the checker sees it: a value that the caller brings, since the dialect is a layer above.

`UNITS` says which of the dialect's units each dimension of the language can be read from, `DATUM` what the altitudes of
well-known fields are measured from: the dialect's XML says that in prose only.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Protocol

from rtshcua.model.quantity import Datum, Dimension


class Field(Protocol):
    """One field of a message: its element type, array length (0: no array), unit and enumeration."""

    @property
    def type(self) -> str: ...

    @property
    def length(self) -> int: ...

    @property
    def unit(self) -> str: ...

    @property
    def enum(self) -> str | None: ...


class Message(Protocol):
    """One message: its fields by name."""

    @property
    def fields(self) -> Mapping[str, Field]: ...


class Dialect(Protocol):
    """Messages by name, and enumerations as entry names with their values."""

    @property
    def messages(self) -> Mapping[str, Message]: ...

    @property
    def enums(self) -> Mapping[str, Mapping[str, int]]: ...


#: unit of a field -> numerator and denominator of canonical units in one of it; rad is 180/pi to 15 digits
UNITS: Mapping[Dimension, Mapping[str, tuple[int, int]]] = MappingProxyType(
    {
        Dimension.LENGTH: {
            "mm": (1, 1),
            "cm": (10, 1),
            "dm": (100, 1),
            "m": (1000, 1),
            "dam": (10_000, 1),
        },
        Dimension.SPEED: {
            "mm/s": (1, 1),
            "cm/s": (10, 1),
            "dm/s": (100, 1),
            "m/s": (1000, 1),
            "m/s*5": (200, 1),
        },
        Dimension.DURATION: {
            "ns": (1, 1000),
            "us": (1, 1),
            "ms": (1000, 1),
            "cs": (10_000, 1),
            "ds": (100_000, 1),
            "s": (1_000_000, 1),
        },
        Dimension.ANGLE: {
            "degE7": (1, 1),
            "degE5": (100, 1),
            "cdeg": (100_000, 1),
            "deg": (10_000_000, 1),
            "deg/2": (20_000_000, 1),
            "rad": (572_957_795_130_823, 1_000_000),
        },
        Dimension.RATIO: {"%": (100, 1), "d%": (10, 1), "c%": (1, 1)},
        Dimension.COUNT: {"": (1, 1)},
    }
)

#: what an altitude in a field is measured from, by message and field (common.xml, in its descriptions)
DATUM: Mapping[tuple[str, str], Datum] = MappingProxyType(
    {
        ("GLOBAL_POSITION_INT", "relative_alt"): Datum.HOME,
        ("GLOBAL_POSITION_INT", "alt"): Datum.SEA,
        ("GLOBAL_POSITION_INT_COV", "relative_alt"): Datum.HOME,
        ("GLOBAL_POSITION_INT_COV", "alt"): Datum.SEA,
        ("GPS_RAW_INT", "alt"): Datum.SEA,
        ("GPS2_RAW", "alt"): Datum.SEA,
        ("VFR_HUD", "alt"): Datum.SEA,
        ("HOME_POSITION", "altitude"): Datum.SEA,
        ("ALTITUDE", "altitude_amsl"): Datum.SEA,
        ("ALTITUDE", "altitude_relative"): Datum.HOME,
        ("HIGH_LATENCY2", "altitude"): Datum.SEA,
    }
)
