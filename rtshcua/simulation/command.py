"""One type for COMMAND_LONG and COMMAND_INT."""

from math import isfinite
from typing import NamedTuple

from rtshcua.codec.frames import Message, ReceivedFrame
from rtshcua.mavlink.enums import NO_PLACE


class VehicleCommand(NamedTuple):
    """A command: parameters 1 to 4, latitude and longitude in 1e-7 degree (None if absent), altitude in m or NaN."""

    number: int
    p1: float
    p2: float
    p3: float
    p4: float
    latitude: float | None
    longitude: float | None
    altitude: float
    frame: int | None
    """MAV_FRAME of a COMMAND_INT; None for COMMAND_LONG."""
    sender: tuple[int, int]


def from_message(received: ReceivedFrame) -> VehicleCommand:
    """Return the command in a COMMAND_LONG or COMMAND_INT."""
    m: Message = received.message
    sender = (received.system, received.component)
    if received.name == "COMMAND_INT":
        x = None if m.x == NO_PLACE else float(m.x)
        y = None if m.y == NO_PLACE else float(m.y)
        return VehicleCommand(m.command, m.param1, m.param2, m.param3, m.param4, x, y, m.z, m.frame, sender)
    x = m.param5 * 1e7 if isfinite(m.param5) else None
    y = m.param6 * 1e7 if isfinite(m.param6) else None
    return VehicleCommand(m.command, m.param1, m.param2, m.param3, m.param4, x, y, m.param7, None, sender)


def whole(value: float) -> int:
    """Return a parameter as an integer, or -1 (no valid id, mode or flag) if it is not finite or too large."""
    return int(value) if isfinite(value) and abs(value) < 2**53 else -1
