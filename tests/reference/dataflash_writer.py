"""Write ArduPilot logs (DataFlash), as AP_Logger does: each message begins with A3 95 and its number, and a message FMT
(number 128) describes each kind. FMTU, UNIT and MULT give the units.
"""

from collections.abc import Iterable, Mapping, Sequence
from struct import calcsize, pack
from typing import NamedTuple

_CODES = {
    "Q": "Q", "L": "i", "f": "f", "B": "B", "I": "I", "H": "H", "c": "h", "e": "i", "n": "4s", "N": "16s", "Z": "64s",
    "b": "b", "d": "d",
}  # fmt: skip
_HEAD = b"\xa3\x95"
_FMT = 128


class Kind(NamedTuple):
    """A kind of message: its number, the characters of its format, and the names of its fields."""

    number: int
    format: str
    columns: str

    @property
    def layout(self) -> str:
        """The layout for `struct`."""
        return "<" + "".join(_CODES[each] for each in self.format)


#: the kinds, as releases have them
KINDS = {
    "POS": Kind(69, "QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt"),
    "GPS": Kind(70, "QBBIHBcLLeffffB", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U"),
}
OLD_POS = Kind(69, "QLLff", "TimeUS,Lat,Lng,Alt,RelAlt")  # Copter 3.3
OLD_GPS = Kind(70, "QBIHBcLLefffB", "TimeUS,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,U")  # up to 4.0


def message(number: int, body: bytes) -> bytes:
    """A message with its header."""
    return _HEAD + bytes([number]) + body


def described(name: str, kind: Kind, length: int | None = None) -> bytes:
    """The FMT of a kind; `length` is a false one."""
    size = calcsize(kind.layout) + 3 if length is None else length
    body = pack("<BB4s16s64s", kind.number, size, name.encode(), kind.format.encode(), kind.columns.encode())
    return message(_FMT, body)


def dataflash(kinds: Mapping[str, Kind], data: Iterable[tuple[str, Sequence[float]]]) -> bytes:
    """A log with these messages: names and values in the order of the fields."""
    units = Kind(200, "QBNN", "TimeUS,FmtType,UnitIds,MultIds")
    every = {"FMT": Kind(_FMT, "BBnNZ", "Type,Length,Name,Format,Columns"), "FMTU": units, **kinds}
    parts = [described(name, kind) for name, kind in every.items()]
    for kind in kinds.values():
        ids = "".join("#" if name == "I" else "s" if name == "TimeUS" else "-" for name in kind.columns.split(","))
        parts.append(message(200, pack(units.layout, 0, kind.number, ids.encode(), b"F".ljust(len(ids), b"-"))))
    parts += [message(kinds[name].number, pack(kinds[name].layout, *values)) for name, values in data]
    return b"".join(parts)
