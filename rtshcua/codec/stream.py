"""Frames out of a stream of octets, where they begin anywhere and other octets may stand between them: serial and TCP.

Octets that belong to no frame are counted, by what they seem to be, so that a person can be told why nothing is heard.
"""

from typing import Final, NamedTuple

from rtshcua.codec.frames import kind_of
from rtshcua.mavlink.framing import (
    CHECKSUM,
    FLAG_SIGNED,
    FLAGS,
    HEADER,
    MARKER,
    frame_length,
    message_id,
    octets_of_checksum,
)

#: a frame of MAVLink 1: marker, length, sequence, system, component, message; then payload and checksum
_OLD_MARKER: Final = 0xFE
_OLD_HEADER: Final = 6
_MARKERS: Final = (MARKER, _OLD_MARKER)


class StreamCounts(NamedTuple):
    """What came: octets in all, whole frames, octets that belong to no frame, and frames of MAVLink 1."""

    octets: int = 0
    frames: int = 0
    garbage: int = 0
    old: int = 0


class FrameStream:
    """Cuts what comes into frames. What is not whole yet is kept for the next call; at most one frame's octets are.

    A frame counts where its checksum is right. That of a message which the dialect does not have cannot be verified;
    it is left out, whole, if another frame follows it at once.
    """

    def __init__(self) -> None:
        self.counts = StreamCounts()
        self._kept = b""

    def feed(self, octets: bytes) -> list[bytes]:
        """The frames that are whole now, in their order."""
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
                break  # the rest of it is still to come
            frame = data[start : start + length]
            if not length or not _is_good(frame, data[start + length : start + length + 1]):
                if length and _is_unknown(frame) and start + length == len(data):
                    break  # what follows it decides
                garbage += 1
                start += 1
                continue
            start += length
            old += frame[0] == _OLD_MARKER
            if frame[0] == MARKER and not _is_unknown(frame):
                frames.append(frame)
        self._kept = data[start:]
        counts = self.counts
        self.counts = StreamCounts(
            counts.octets + len(octets), counts.frames + len(frames), counts.garbage + garbage, counts.old + old
        )
        return frames


def _length(data: bytes, start: int) -> int | None:
    """How long the frame is that begins here; 0 where none can, None where its header is not whole yet."""
    if data[start] == _OLD_MARKER:
        return _OLD_HEADER + data[start + 1] + CHECKSUM if start + 1 < len(data) else None
    if start + FLAGS < len(data) and data[start + FLAGS] & ~FLAG_SIGNED:
        return 0
    return frame_length(data, start) if start + HEADER <= len(data) else None


def _is_unknown(frame: bytes) -> bool:
    return frame[0] == MARKER and kind_of(message_id(frame, 0)) is None


def _is_good(frame: bytes, following: bytes) -> bool:
    """Whether its checksum is right, or cannot be verified and another frame follows."""
    if frame[0] == _OLD_MARKER:
        kind, header = kind_of(frame[5]), _OLD_HEADER
    else:
        kind, header = kind_of(message_id(frame, 0)), HEADER
    if kind is None:
        return frame[0] == MARKER and following[:1] == bytes([MARKER])
    end = header + frame[1]
    return octets_of_checksum(frame[1:end] + kind.extra) == frame[end : end + CHECKSUM]
