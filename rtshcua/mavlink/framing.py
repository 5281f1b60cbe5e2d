"""The layout of a MAVLink 2 frame on the wire, see https://mavlink.io/en/guide/serialization.html."""

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
"The offset of the incompatibility flags."
FLAG_SIGNED = 0x01
"The only incompatibility flag that is defined; a frame with another one cannot be decoded."

MIRROR: Final = bytes(int(f"{octet:08b}"[::-1], 2) for octet in range(256))


def frame_length(data: bytes, start: int) -> int:
    """The length in bytes of the frame whose header begins at `start`, according to the header."""
    signature = SIGNATURE if data[start + 2] & FLAG_SIGNED else 0
    return HEADER + data[start + 1] + CHECKSUM + signature


def message_id(data: bytes, start: int) -> int:
    """The message's number, from the frame's header."""
    return data[start + 7] | data[start + 8] << 8 | data[start + 9] << 16


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
