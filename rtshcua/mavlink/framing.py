"""The layout of a MAVLink frame on the wire, see https://mavlink.io/en/guide/serialization.html.

Without a further word a frame is one of MAVLink 2. Those of MAVLink 1 are only found and named here.
"""

from binascii import crc_hqx
from collections.abc import Iterator
from struct import Struct
from typing import Final

MARKER = 0xFD
HEAD: Final = Struct("<BBBBBBBHB")
"""Marker, length, incompatibility and compatibility flags, sequence, system, component, message (16 bits, and 8)."""
HEADER = 10
CHECKSUM = 2
SIGNATURE = 13
FLAGS = 2
"The offset of the incompatibility flags."
FLAG_SIGNED = 0x01
"The only incompatibility flag that is defined; a frame with another one cannot be decoded."
OLD_MARKER = 0xFE
OLD_HEADER = 6
"Of MAVLink 1: marker, length, sequence, system, component, message."

MIRROR: Final = bytes(int(f"{octet:08b}"[::-1], 2) for octet in range(256))


def frame_length(data: bytes, start: int) -> int:
    """The length in bytes of the frame whose header begins at `start`, according to the header."""
    signature = SIGNATURE if data[start + 2] & FLAG_SIGNED else 0
    return HEADER + data[start + 1] + CHECKSUM + signature


def message_id(data: bytes, start: int) -> int:
    """The message's number, from the frame's header."""
    return data[start + 7] | data[start + 8] << 8 | data[start + 9] << 16


def whole_length(data: bytes, start: int) -> int | None:
    """The length of the frame, of either version, that begins here; None if none does, or it ends after the data."""
    left = len(data) - start
    if data[start] == MARKER and left >= HEADER + CHECKSUM:
        length = frame_length(data, start)
    elif data[start] == OLD_MARKER and left >= OLD_HEADER + CHECKSUM:
        length = OLD_HEADER + data[start + 1] + CHECKSUM
    else:
        return None
    return length if length <= left else None


def frames_in(datagram: bytes) -> Iterator[bytes]:
    """Each frame, of either version, of a datagram of whole frames; what is none, is yielded as the last one."""
    start = 0
    while start < len(datagram):
        length = whole_length(datagram, start) or len(datagram)
        yield datagram[start : start + length]
        start += length


def number_of(data: bytes, start: int = 0) -> int:
    """The message's number in a whole frame of either version."""
    return message_id(data, start) if data[start] == MARKER else data[start + 5]


def sender_of(frame: bytes) -> tuple[int, int]:
    """System and component of the sender of a whole frame of either version."""
    at = 5 if frame[0] == MARKER else 3
    return frame[at], frame[at + 1]


def checksum(octets: bytes, start: int = 0xFFFF) -> int:
    """CRC-16/MCRF4XX over everything after the marker up to the checksum, and the message's extra octet.

    It equals the CRC of `crc_hqx` (same polynomial, 0x1021) with every octet, and the result, bit-reversed.
    """
    crc = crc_hqx(octets.translate(MIRROR), start)
    return MIRROR[crc >> 8] | MIRROR[crc & 0xFF] << 8


def octets_of_checksum(octets: bytes) -> bytes:
    """`checksum` in its octet order in a frame."""
    return crc_hqx(octets.translate(MIRROR), 0xFFFF).to_bytes(CHECKSUM, "big").translate(MIRROR)


def with_flags(frame: bytes, flags: int) -> bytes:
    """A frame without a signature, with other incompatibility flags and the matching checksum.

    The checksum is linear, so the effect of a changed octet depends only on that octet and its place. Neither the
    rest of the frame nor the message's extra octet is needed, and a wrong checksum stays wrong.
    """
    changed = frame[FLAGS] ^ flags
    end = HEADER + frame[1]
    # there are `end` octets from after the marker to the extra octet, and the second of them changes
    crc = int.from_bytes(frame[end : end + CHECKSUM], "little") ^ checksum(bytes([0, changed]) + bytes(end - 2), 0)
    return frame[:FLAGS] + bytes([flags]) + frame[FLAGS + 1 : end] + crc.to_bytes(CHECKSUM, "little")


def unsigned(frame: bytes) -> bytes:
    """A frame without its signature."""
    return with_flags(frame, 0) if frame[FLAGS] & FLAG_SIGNED else frame
