"""The shape of a MAVLink 2 frame on the wire, see https://mavlink.io/en/guide/serialization.html."""

MARKER = 0xFD
HEADER = 10
CHECKSUM = 2
SIGNATURE = 13
FLAG_SIGNED = 0x01
"""The only incompatibility flag that is defined; a frame with another one cannot be understood."""


def frame_length(data: bytes, start: int) -> int:
    """The length in bytes of the frame whose header begins at `start`, as the header claims it."""
    signature = SIGNATURE if data[start + 2] & FLAG_SIGNED else 0
    return HEADER + data[start + 1] + CHECKSUM + signature


def message_id(data: bytes, start: int) -> int:
    """The message's number, from the frame's header."""
    return int.from_bytes(data[start + 7 : start + HEADER], "little")
