"""The messages and enumerations of the MAVLink dialect, as a plain value.

The value is read from `dialect.json`, a table that `rtshcua.codec.build_dialect` generates from pymavlink's module
`ardupilotmega` (which includes `common`). Reading it takes some milliseconds; importing pymavlink takes tens,
which would delay every start of the checker.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from rtshcua.model.quantity import Datum

TABLE = Path(__file__).with_name("dialect.json")

#: the datum of the altitudes, by message and field (common.xml, in its descriptions)
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


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a message."""

    type: str
    """The element's type as in the XML, without a length: `int8_t`, `float`, `char`, ..."""
    length: int
    "The number of elements of an array; 0 for other fields."
    unit: str
    """The unit as in the XML: `mm`, `cm/s`, `degE7`, `%`, ...; empty if it has none."""
    enum: str | None
    "The enumeration of the field's values, if there is one."
    label: str = ""
    "What a parameter of a command is: `Altitude`; empty for fields of messages."


@dataclass(frozen=True, slots=True)
class Message:
    """One message: its number on the wire and its fields, in the order of the XML."""

    id: int
    fields: Mapping[str, Field]


@dataclass(frozen=True, slots=True)
class Dialect:
    """The messages by name (`GPS_RAW_INT`), the enumerations: by name, each entry's name and value, and the commands.

    Of a command (MAV_CMD) it has the parameters with a meaning: `param1` .. `param7`, floats with a unit as in
    COMMAND_LONG, latitude and longitude in degrees. The commands' numbers are in the enumeration.
    """

    messages: Mapping[str, Message]
    enums: Mapping[str, Mapping[str, int]]
    commands: Mapping[str, Mapping[str, Field]]


def from_table(table: Mapping[str, Any]) -> Dialect:
    """The dialect in a table as in `dialect.json`."""
    messages = {
        name: Message(number, {field: Field(*row) for field, row in fields.items()})
        for name, (number, fields) in table["messages"].items()
    }
    enums = {name: MappingProxyType(entries) for name, entries in table["enums"].items()}
    commands = {
        name: {each: Field("float", 0, unit, enum, label) for each, (label, unit, enum) in parameters.items()}
        for name, parameters in table["commands"].items()
    }
    return Dialect(MappingProxyType(messages), MappingProxyType(enums), MappingProxyType(commands))


@cache
def load() -> Dialect:
    """The dialect from the shipped table; read once in a process."""
    return from_table(json.loads(TABLE.read_bytes()))
