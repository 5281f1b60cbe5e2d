"""The tlog format: for each frame, 8 bytes big-endian microseconds since the epoch, then the raw MAVLink 2 frame."""

from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import BinaryIO

from rtshcua.mavlink.framing import HEADER, MARKER, frame_length

STAMP = 8


@dataclass(frozen=True, slots=True)
class TlogEntry:
    """A frame and when it was received, in microseconds since the Unix epoch."""

    at_us: int
    frame: bytes


class DamagedTlog(ValueError):
    """The data at `offset` is not a complete entry: the file was truncated, or is not a tlog."""

    def __init__(self, offset: int) -> None:
        super().__init__(f"no complete tlog entry at byte {offset}")
        self.offset = offset


def encode(at_us: int, frame: bytes) -> bytes:
    """The bytes of one entry."""
    return at_us.to_bytes(STAMP, "big") + frame


def read(data: bytes) -> Iterator[TlogEntry]:
    """The entries of a tlog, in order. Frames are measured but not checked.

    Raises `DamagedTlog` at the first incomplete entry, after yielding all entries before it.
    """
    yield from stream(BytesIO(data))


def stream(file: BinaryIO) -> Iterator[TlogEntry]:
    """As `read`, from a file that need not fit into memory."""
    offset = 0
    while head := file.read(STAMP + HEADER):
        if len(head) < STAMP + HEADER or head[STAMP] != MARKER:
            raise DamagedTlog(offset)
        length = frame_length(head, STAMP)
        frame = head[STAMP:] + file.read(length - HEADER)
        if len(frame) < length:
            raise DamagedTlog(offset)
        yield TlogEntry(int.from_bytes(head[:STAMP], "big"), frame)
        offset += STAMP + length
