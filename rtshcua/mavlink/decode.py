"""A frame's payload becomes a message: what pymavlink's `decode` does, prepared once for each kind of message.

Telemetry is decoded several times as fast as there. The message is pymavlink's own class with every field; its header
is not filled in, for who sent it stands in `Received`. pymavlink lets an environment variable switch the checksum off;
nothing here looks at it.
"""

from collections.abc import Callable
from functools import cache
from struct import Struct
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega

from rtshcua.mavlink.framing import CHECKSUM, HEADER, checksum

Message = Any
"""An instance of a generated `MAVLink_..._message` class; pymavlink ships no types."""


class Kind(NamedTuple):
    """How messages of one number are decoded."""

    name: str
    extra: bytes
    """The octet that the checksum takes in behind the payload: a digest of the message's layout."""
    fields: Struct
    build: Callable[[tuple[Any, ...]], Message]
    plain: tuple[str, ...] | None
    """The fields in the order of the wire, if each of them is one number."""


@cache
def kind_of(number: int) -> Kind | None:
    """The kind of a message; None for one that the dialect does not have."""
    of = ardupilotmega.mavlink_map.get(number)
    if of is None:
        return None
    extra = bytes([of.crc_extra])
    if _is_plain(of):
        return Kind(of.msgname, extra, of.unpacker, _plain(of), tuple(of.ordered_fieldnames))
    return Kind(of.msgname, extra, of.unpacker, _any(of), None)


def decode(frame: bytes, kind: Kind) -> Message | None:
    """The message in a whole frame, signed or not; None if its checksum is wrong."""
    end = HEADER + frame[1]
    if checksum(frame[1:end] + kind.extra) != int.from_bytes(frame[end : end + CHECKSUM], "little"):
        return None
    # Zeros at the end are not sent; what is longer than we know comes of a newer dialect.
    size = kind.fields.size
    payload = frame[HEADER : min(end, HEADER + size)].ljust(size, b"\0")
    return kind.build(kind.fields.unpack(payload))


def _is_plain(of: Any) -> bool:
    """Whether all fields are single numbers."""
    return all(length == 1 for length in of.lengths) and "char" not in of.fieldtypes


def _plain(of: Any) -> Callable[[tuple[Any, ...]], Message]:
    """A message without the generated constructor, which takes longer than all the rest."""
    made = of(*[0] * len(of.fieldnames))
    rest = {name: value for name, value in vars(made).items() if name not in of.fieldnames}
    names = tuple(of.ordered_fieldnames)
    new = of.__new__

    def build(values: tuple[Any, ...]) -> Message:
        message = new(of)
        message.__dict__.update(rest)
        message.__dict__.update(zip(names, values, strict=True))
        return message

    return build


def _any(of: Any) -> Callable[[tuple[Any, ...]], Message]:
    """A message with arrays or texts, by the generated constructor."""
    starts = [sum(of.lengths[:place]) for place in range(len(of.lengths))]
    pick = [(starts[place], of.lengths[place]) for place in of.orders]

    def build(values: tuple[Any, ...]) -> Message:
        fields: list[Any] = []
        for start, length in pick:
            value = values[start]
            if isinstance(value, bytes):
                value = value.rstrip(b"\0")
            elif length > 1:
                value = list(values[start : start + length])
            fields.append(value)
        return of(*fields)

    return build
