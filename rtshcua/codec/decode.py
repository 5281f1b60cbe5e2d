"""A frame's payload becomes a message: what pymavlink's `decode` does, prepared once for each kind of message.

Telemetry is decoded several times as fast as there. The message is pymavlink's own class with every field; its header
is not filled in, for who sent it stands in `Received`. pymavlink lets an environment variable switch the checksum off;
nothing here looks at it.
"""

from collections.abc import Callable, Iterable
from functools import cache
from operator import attrgetter
from struct import Struct
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega

from rtshcua.mavlink.framing import HEADER, checks

Message = Any
"""An instance of a generated `MAVLink_..._message` class; pymavlink ships no types."""


class Kind(NamedTuple):
    """How messages of one number are decoded."""

    name: str
    extra: bytes
    """The octet that the checksum takes in behind the payload: a digest of the message's layout."""
    fields: Struct
    build: Callable[[tuple[Any, ...]], Message]
    number: bytes
    """As it stands in a frame's header."""
    values: Callable[[Message], Iterable[Any]] | None
    """The numbers of a message in the order of the wire; None where it holds texts."""


@cache
def kind_of(number: int) -> Kind | None:
    """The kind of a message; None for one that the dialect does not have."""
    of = ardupilotmega.mavlink_map.get(number)
    if of is None:
        return None
    extra, octets = bytes([of.crc_extra]), number.to_bytes(3, "little")
    if "char" in of.fieldtypes:
        return Kind(of.msgname, extra, of.unpacker, _any(of), octets, None)
    if all(length == 1 for length in of.lengths) and len(of.lengths) > 1:
        return Kind(of.msgname, extra, of.unpacker, _plain(of), octets, attrgetter(*of.ordered_fieldnames))
    return Kind(of.msgname, extra, of.unpacker, _arrays(of), octets, _flat(of))


def decode(frame: bytes, kind: Kind) -> Message | None:
    """The message in a whole frame, signed or not; None if its checksum is wrong."""
    end = HEADER + frame[1]
    if not checks(frame[1:end] + kind.extra, frame[end], frame[end + 1]):
        return None
    fields = kind.fields
    if frame[1] >= fields.size:  # what is longer than we know comes of a newer dialect
        return kind.build(fields.unpack_from(frame, HEADER))
    return kind.build(fields.unpack(frame[HEADER:end].ljust(fields.size, b"\0")))  # zeros at the end are not sent


def _bare(of: Any) -> dict[str, Any]:
    """What a message holds beside its fields."""
    made = of(*[0] * len(of.fieldnames))
    return {name: value for name, value in vars(made).items() if name not in of.fieldnames}


def _plain(of: Any) -> Callable[[tuple[Any, ...]], Message]:
    """A message of single numbers, without the generated constructor, which takes longer than all the rest."""
    rest, names, new = _bare(of), tuple(of.ordered_fieldnames), of.__new__

    def build(values: tuple[Any, ...]) -> Message:
        message = new(of)
        held = message.__dict__ = rest.copy()
        held.update(zip(names, values, strict=True))
        return message

    return build


def _layout(of: Any) -> tuple[tuple[str, int, int], ...]:
    """Each field in the order of the wire, where it starts among the values, and its length."""
    starts = [sum(of.lengths[:place]) for place in range(len(of.lengths))]
    return tuple(zip(of.ordered_fieldnames, starts, of.lengths, strict=True))


def _arrays(of: Any) -> Callable[[tuple[Any, ...]], Message]:
    """A message with arrays of numbers, without the generated constructor."""
    rest, layout, new = _bare(of), _layout(of), of.__new__
    single = [(name, start) for name, start, length in layout if length == 1]
    arrays = tuple((name, start, start + length) for name, start, length in layout if length > 1)
    names = tuple(name for name, _ in single)
    pick = tuple(start for _, start in single)

    def build(values: tuple[Any, ...]) -> Message:
        message = new(of)
        held = message.__dict__ = rest.copy()
        held.update(zip(names, map(values.__getitem__, pick), strict=True))
        for name, start, end in arrays:
            held[name] = list(values[start:end])
        return message

    return build


def _flat(of: Any) -> Callable[[Message], Iterable[Any]]:
    layout = _layout(of)

    def values(message: Message) -> Iterable[Any]:
        held, found = message.__dict__, []
        for name, _, length in layout:
            if length > 1:
                found += held[name][:length]
            else:
                found.append(held[name])
        return found

    return values


def _any(of: Any) -> Callable[[tuple[Any, ...]], Message]:
    """A message with texts, by the generated constructor."""
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
