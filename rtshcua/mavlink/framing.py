"""The shape of a MAVLink 2 frame on the wire, see https://mavlink.io/en/guide/serialization.html."""

from binascii import crc_hqx
from struct import Struct
from typing import Final

MARKER = 0xFD
HEAD: Final = Struct("<BBBBBBBHB")
"""Marker, length, incompatibility and compatibility flags, sequence, system, component, message (16 bits, and 8)."""
HEADER = 10
CHECKSUM = 2
SIGNATURE = 13
FLAGS = 2
"""Where the incompatibility flags stand."""
FLAG_SIGNED = 0x01
"""The only incompatibility flag that is defined; a frame with another one cannot be understood."""

MIRROR: Final = bytes(int(f"{octet:08b}"[::-1], 2) for octet in range(256))


def frame_length(data: bytes, start: int) -> int:
    """The length in bytes of the frame whose header begins at `start`, as the header claims it."""
    signature = SIGNATURE if data[start + 2] & FLAG_SIGNED else 0
    return HEADER + data[start + 1] + CHECKSUM + signature


def message_id(data: bytes, start: int) -> int:
    """The message's number, from the frame's header."""
    return data[start + 7] | data[start + 8] << 8 | data[start + 9] << 16


def checksum(octets: bytes, start: int = 0xFFFF) -> int:
    """CRC-16/MCRF4XX, which MAVLink takes over all between marker and checksum, and the message's extra octet.

    It is the CRC of `crc_hqx` (same polynomial, 0x1021) with every octet, and the result, mirrored.
    """
    crc = crc_hqx(octets.translate(MIRROR), start)
    return MIRROR[crc >> 8] | MIRROR[crc & 0xFF] << 8


def octets_of_checksum(octets: bytes) -> bytes:
    """`checksum` as it stands in a frame."""
    return crc_hqx(octets.translate(MIRROR), 0xFFFF).to_bytes(CHECKSUM, "big").translate(MIRROR)


def with_flags(frame: bytes, flags: int) -> bytes:
    """A frame without a signature, with other incompatibility flags and the checksum that belongs to them.

    The checksum is linear, so that what a changed octet does to it depends on that octet and on where it stands alone:
    neither the rest of the frame nor the message's extra octet is needed, and a wrong checksum stays wrong.
    """
    changed = frame[FLAGS] ^ flags
    end = HEADER + frame[1]
    # from behind the marker to the extra octet there are `end` octets; of these the second changes
    crc = int.from_bytes(frame[end : end + CHECKSUM], "little") ^ checksum(bytes([0, changed]) + bytes(end - 2), 0)
    return frame[:FLAGS] + bytes([flags]) + frame[FLAGS + 1 : end] + crc.to_bytes(CHECKSUM, "little")


def unsigned(frame: bytes) -> bytes:
    """A frame without its signature."""
    return with_flags(frame, 0) if frame[FLAGS] & FLAG_SIGNED else frame
