"""What ground stations ask beyond commands: the list of modes, files, logs. What is not there is refused at once.

QGroundControl asks for all of them when it connects, and waits seconds for each answer that does not come.
"""

import struct
from collections.abc import Callable, Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Message, Received
from rtshcua.simulation.autopilot import Autopilot
from rtshcua.simulation.modes import Mode

AVAILABLE_MODES = 435
"""The message is not in the dialect: https://mavlink.io/en/messages/common.html#AVAILABLE_MODES."""
_LAYOUT = struct.Struct("<IIBBB35s")

CURRENT_MODE = 436
"""Neither is this one: https://mavlink.io/en/messages/common.html#CURRENT_MODE."""
_CURRENT_MODE_LAYOUT = struct.Struct("<IIB")

_STANDARD: Mapping[Mode, int] = {
    Mode.POSITION: 1, Mode.ALTITUDE: 4, Mode.RETURN: 5, Mode.MISSION: 6, Mode.LAND: 7, Mode.TAKEOFF: 8
}  # fmt: skip
"""MAV_STANDARD_MODE; others have none (0)."""

_NAK, _UNKNOWN_COMMAND = 129, 7
"""MAV_FTP_OPCODE and MAV_FTP_ERR."""
_FTP_SIZE = 251


class _Packed(mavlink.MAVLink_message):  # type: ignore[misc]
    """A message that the dialect does not have, packed by hand."""

    id: int
    name: str
    extra: int

    def __init__(self, payload: bytes) -> None:
        super().__init__(self.id, self.name)
        self._bytes = payload

    def pack(self, mav: Message, force_mavlink1: bool = False) -> Message:
        """The frame."""
        return self._pack(mav, self.extra, self._bytes, force_mavlink1=force_mavlink1)


class _AvailableModes(_Packed):
    id, name, extra = AVAILABLE_MODES, "AVAILABLE_MODES", 134


class _CurrentMode(_Packed):
    id, name, extra = CURRENT_MODE, "CURRENT_MODE", 193


def available_modes(a: Autopilot, number: int) -> bool:
    """Queues the mode of this number, counted from 1, or all of them for 0; False if there is none of that number."""
    modes = a.flavour.modes
    listed = list(modes.numbers.items())
    if not 0 <= number <= len(listed):
        return False
    for index, (mode, custom) in enumerate(listed, start=1):
        if number in (0, index):
            name = modes.name(mode).encode()
            payload = _LAYOUT.pack(custom, 0, len(listed), index, _STANDARD.get(mode, 0), name)
            a.send(_AvailableModes(payload))
    return True


def current_mode(a: Autopilot) -> Message:
    """CURRENT_MODE."""
    mode = a.vehicle.mode
    number = a.flavour.modes.numbers[mode]
    payload = _CURRENT_MODE_LAYOUT.pack(number, number, _STANDARD.get(mode, 0))
    return _CurrentMode(payload)


def _file(a: Autopilot, received: Received) -> None:
    """FILE_TRANSFER_PROTOCOL: there are no files."""
    m = received.message
    sequence, session, opcode = struct.unpack_from("<HBB", bytes(m.payload))
    head = struct.pack("<HBBBBBBIB", (sequence + 1) % 65_536, session, _NAK, 1, opcode, 0, 0, 0, _UNKNOWN_COMMAND)
    payload = list(head.ljust(_FTP_SIZE, b"\0"))
    a.send(mavlink.MAVLink_file_transfer_protocol_message(0, received.system, received.component, payload))


def _logs(a: Autopilot, _: Received) -> None:
    """LOG_REQUEST_LIST: there are no logs."""
    a.send(mavlink.MAVLink_log_entry_message(0, 0, 0, 0, 0))


HANDLERS: Mapping[str, Callable[[Autopilot, Received], None]] = {
    "FILE_TRANSFER_PROTOCOL": _file,
    "LOG_REQUEST_LIST": _logs,
}
