"""The recorded telemetry of a flight (tlog), up to its last whole frame.

MAVProxy, Mission Planner and pymavlink read it: 8 octets of UTC in us, big-endian, before each frame.
"""

from typing import Final, NamedTuple

from rtshcua.mavlink.tlog import STAMP, DamagedTlog, read

DATUM: Final = "as the vehicle sent it; each MAVLink field has its own"


class WholeTlog(NamedTuple):
    """The whole entries, their number, and the number of octets after them that are left out."""

    data: bytes
    frames: int
    left_out: int


def whole_tlog(data: bytes) -> WholeTlog:
    """Cut a tlog after its last whole entry. Frames are measured; their checksums are the reader's to check."""
    frames = length = 0
    try:
        for entry in read(data):
            frames += 1
            length += STAMP + len(entry.frame)
    except DamagedTlog:
        pass
    return WholeTlog(data[:length], frames, len(data) - length)
