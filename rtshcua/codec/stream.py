"""Extracts frames from a stream of octets (serial and TCP) in which other octets may lie between them.

Octets outside of frames are counted by their apparent kind, to explain why no messages arrive.
"""

from typing import Final, NamedTuple

from rtshcua.codec.frames import kind_of
from rtshcua.mavlink.framing import (
    CHECKSUM,
    FLAG_SIGNED,
    FLAGS,
    HEADER,
    MARKER,
    OLD_HEADER,
    OLD_MARKER,
    frame_length,
    message_id,
    number_of,
    octets_of_checksum,
)

_MARKERS: Final = (MARKER, OLD_MARKER)


class StreamCounts(NamedTuple):
    """Statistics: octets in all, complete frames, octets outside of frames, and frames of MAVLink 1."""

    octets: int = 0
    frames: int = 0
    garbage: int = 0
    old: int = 0


class FrameStream:
    """Splits a stream into frames. An incomplete frame is kept for the next call.

    A frame is valid if its checksum is right. The checksum of a message that is not in the dialect cannot be
    verified; it is skipped as a whole if another frame follows immediately. With `every`, such frames are returned too,
    as are those of MAVLink 1.
    """

    def __init__(self, *, every: bool = False) -> None:
        self.counts = StreamCounts()
        self._every = every
        self._kept = b""

    @property
    def pending(self) -> bool:
        """Whether octets are kept that may be the beginning of a frame."""
        return bool(self._kept)

    def feed(self, octets: bytes) -> list[bytes]:
        """The frames that are now complete, in order."""
        data = self._kept + octets
        frames: list[bytes] = []
        old = garbage = start = 0
        while start < len(data):
            if data[start] not in _MARKERS:
                ends = [at for at in (data.find(marker, start) for marker in _MARKERS) if at >= 0]
                following = min(ends, default=len(data))
                garbage += following - start
                start = following
                continue
            length = _length(data, start)
            if length is None or (length and start + length > len(data)):
                break  # the rest is still to come
            frame = data[start : start + length]
            if not length or not _is_good(frame, data[start + length : start + length + 1]):
                if length and _is_unknown(frame) and start + length == len(data):
                    break  # the next octets decide
                garbage += 1
                start += 1
                continue
            start += length
            old += frame[0] == OLD_MARKER
            if self._every or (frame[0] == MARKER and not _is_unknown(frame)):
                frames.append(frame)
        self._kept = data[start:]
        counts = self.counts
        self.counts = StreamCounts(
            counts.octets + len(octets), counts.frames + len(frames), counts.garbage + garbage, counts.old + old
        )
        return frames


def _length(data: bytes, start: int) -> int | None:
    """The length of the frame that begins here; 0 if there is none, None if its header is incomplete."""
    if data[start] == OLD_MARKER:
        return OLD_HEADER + data[start + 1] + CHECKSUM if start + 1 < len(data) else None
    if start + FLAGS < len(data) and data[start + FLAGS] & ~FLAG_SIGNED:
        return 0
    return frame_length(data, start) if start + HEADER <= len(data) else None


def _is_unknown(frame: bytes) -> bool:
    return frame[0] == MARKER and kind_of(message_id(frame, 0)) is None


def _is_good(frame: bytes, following: bytes) -> bool:
    """Whether its checksum is right, or cannot be verified and another frame follows."""
    kind, header = kind_of(number_of(frame)), OLD_HEADER if frame[0] == OLD_MARKER else HEADER
    if kind is None:
        return frame[0] == MARKER and following[:1] == bytes([MARKER])
    end = header + frame[1]
    return octets_of_checksum(frame[1:end] + kind.extra) == frame[end : end + CHECKSUM]
