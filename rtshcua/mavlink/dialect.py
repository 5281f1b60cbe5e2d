"""What the MAVLink dialect says of each message and enumeration, as a plain value.

The value is read from `dialect.json`, a table that `rtshcua.codec.build_dialect` derives from pymavlink's generated
module `ardupilotmega` (which includes `common`). Reading it takes about two milliseconds; importing pymavlink takes
tens, which the checker would pay on every start.
"""

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Generic, TypeVar

from rtshcua.model.quantity import Datum

TABLE = Path(__file__).with_name("dialect.json")

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

V = TypeVar("V")


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a message."""

    type: str
    """The element's type as in the XML, without a length: `int8_t`, `float`, `char`, ..."""
    length: int
    """How many elements an array has; 0 for a field that is no array."""
    unit: str
    """The unit as in the XML: `mm`, `cm/s`, `degE7`, `%`, ...; empty if it has none."""
    enum: str | None
    """The enumeration that names the field's values, if there is one."""


@dataclass(frozen=True, slots=True)
class Message:
    """One message: its number on the wire and its fields, in the order of the XML."""

    id: int
    fields: Mapping[str, Field]


class _Lazy(Mapping[str, V], Generic[V]):
    """A read-only mapping that builds each value from the table's row when it is first asked for."""

    def __init__(self, rows: dict[str, Any], build: Callable[[Any], V]) -> None:
        self._rows = rows
        self._build = build
        self._built: dict[str, V] = {}

    def __getitem__(self, name: str) -> V:
        value = self._built.get(name)
        if value is None:
            value = self._built[name] = self._build(self._rows[name])
        return value

    def __contains__(self, name: object) -> bool:
        return name in self._rows

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)


@dataclass(frozen=True, slots=True)
class Dialect:
    """The messages by name (`GPS_RAW_INT`), and the enumerations: by name, each entry's name and value."""

    messages: Mapping[str, Message]
    enums: Mapping[str, Mapping[str, int]]


def _message(row: list[Any]) -> Message:
    number, fields = row
    return Message(number, {name: Field(*field) for name, field in fields.items()})


def from_table(table: Mapping[str, Any]) -> Dialect:
    """The dialect that a table as in `dialect.json` describes."""
    return Dialect(_Lazy(table["messages"], _message), _Lazy(table["enums"], MappingProxyType))


@cache
def load() -> Dialect:
    """The dialect from the table that ships with the package; read once in a process."""
    return from_table(json.loads(TABLE.read_bytes()))
