"""A MAVLink 2 frame as octets, read by the boundary itself: it shares no parser with the adapters that it checks."""

from typing import Any, NamedTuple

from rtshcua.mavlink.framing import CHECKSUM, HEAD, HEADER, MARKER
from rtshcua.mavlink.layouts import LAYOUTS


class Frame(NamedTuple):
    """One whole frame. `fields` are in the order of the wire; `target` is (system, component) where it has one."""

    system: int
    component: int
    message: int
    fields: tuple[Any, ...]
    target: tuple[int, int] | None


_frame = tuple.__new__  # the constructor that a named tuple is given is a function more
_head, _layout = HEAD.unpack_from, LAYOUTS.get  # bound once: every frame that is heard comes by here
_TARGETS = {number: layout.at("target_system") for number, layout in LAYOUTS.items()}


def read_frame(octets: bytes) -> Frame | None:
    """The frame that these octets are; None unless they are one whole unsigned frame of a message in `LAYOUTS`.

    The checksum is the receiver's to check: a frame whose checksum is wrong moves nothing.
    """
    if len(octets) < HEADER or octets[0] != MARKER:
        return None
    _, length, incompatible, compatible, _, system, component, low, high = _head(octets)
    message = low | high << 16
    layout = _layout(message)
    if layout is None or incompatible or compatible or len(octets) != HEADER + length + CHECKSUM:
        return None
    if length > layout.fields.size:
        return None
    fields, target = layout.read(octets), _TARGETS[message]
    return _frame(Frame, (system, component, message, fields, None if target < 0 else fields[target : target + 2]))
