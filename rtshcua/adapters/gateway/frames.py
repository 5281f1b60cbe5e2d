"""Frames in datagrams, as the relay needs them: whole or not, their message numbers, and frames of MAVLink 1."""

from collections.abc import Collection, Sequence
from typing import Final

from rtshcua.codec.frames import kind_of
from rtshcua.mavlink.enums import MAV_CMD_REQUEST_OPERATOR_CONTROL, MAV_COMP_ID_AUTOPILOT1
from rtshcua.mavlink.framing import (
    CHECKSUM,
    FLAG_SIGNED,
    FLAGS,
    HEAD,
    HEADER,
    MARKER,
    OLD_HEADER,
    OLD_MARKER,
    SIGNATURE,
    frames_in,
    number_of,
    octets_of_checksum,
    sender_of,
    whole_length,
)
from rtshcua.mavlink.layouts import COMMAND_INT, COMMAND_LONG

#: the offsets of the command and its target in the payload of COMMAND_LONG and COMMAND_INT
_COMMAND_AT, _TARGET_AT = 28, 30
_REQUEST_CONTROL: Final = MAV_CMD_REQUEST_OPERATOR_CONTROL.to_bytes(2, "little")
#: the most octets of a datagram that several frames share: none is fragmented on Ethernet or Wi-Fi
MOST_SHARED: Final = 1_400


def numbers_in(datagram: bytes) -> Sequence[int] | None:
    """The message number of each frame in a datagram that consists of whole frames; None for any other datagram."""
    size = len(datagram)
    if size < HEADER + CHECKSUM or datagram[0] != MARKER:
        return _walked(datagram)
    length = datagram[1] + (HEADER + CHECKSUM + SIGNATURE if datagram[FLAGS] & FLAG_SIGNED else HEADER + CHECKSUM)
    if length == size:  # nearly always
        return (datagram[7] | datagram[8] << 8 | datagram[9] << 16,)
    return _walked(datagram)


def _walked(datagram: bytes) -> Sequence[int] | None:
    numbers, start = [], 0
    while start < len(datagram):
        length = whole_length(datagram, start)
        if length is None:
            return None
        numbers.append(number_of(datagram, start))
        start += length
    return numbers or None


def asks_for_control(frame: bytes, system: int = 0) -> bool:
    """Whether a frame is a command REQUEST_OPERATOR_CONTROL to the autopilot of a system, by default to anything. The
    command and its target have one place in both kinds of commands.
    """
    if frame[0] != MARKER or number_of(frame) not in (COMMAND_INT, COMMAND_LONG):
        return False
    payload = frame[HEADER : HEADER + frame[1]].ljust(_TARGET_AT + 2, b"\0")  # trailing zeros are not sent
    if payload[_COMMAND_AT : _COMMAND_AT + 2] != _REQUEST_CONTROL:
        return False
    to_system, to_component = payload[_TARGET_AT : _TARGET_AT + 2]
    return not system or (to_system in (0, system) and to_component in (0, MAV_COMP_ID_AUTOPILOT1))


def without(datagram: bytes, numbers: Collection[int], sender: tuple[int, int] | None = None) -> bytes:
    """A datagram of whole frames without those of these messages, of all senders or one. It may be empty."""
    return b"".join(
        frame
        for frame in frames_in(datagram)
        if number_of(frame) not in numbers or sender not in (None, sender_of(frame))
    )


def parcels(datagrams: Sequence[bytes]) -> Sequence[bytes]:
    """The same frames in as few datagrams as they fit into, in order. One that is small enough stays as it is."""
    if len(datagrams) == 1 and len(datagrams[0]) <= MOST_SHARED:
        return datagrams
    shared: list[bytes] = []
    waiting: list[bytes] = []
    size = 0
    for datagram in datagrams:
        for piece in (datagram,) if len(datagram) <= MOST_SHARED else frames_in(datagram):
            size += len(piece)
            if size > MOST_SHARED and waiting:
                shared.append(b"".join(waiting))
                waiting, size = [], len(piece)
            waiting.append(piece)
    if waiting:
        shared.append(b"".join(waiting))
    return shared


def good_frames(datagram: bytes) -> tuple[list[bytes], int]:
    """The frames of a client's datagram before the first one with a wrong checksum, and how many octets remain: all of
    them, if it does not consist of whole frames. The checksum of a message that is not in the dialect cannot be
    verified: such a frame is returned.
    """
    if numbers_in(datagram) is None:
        return [], len(datagram)
    good: list[bytes] = []
    end = 0
    for frame in frames_in(datagram):
        if not _is_good(frame):
            break
        good.append(upgraded(frame))
        end += len(frame)
    return good, len(datagram) - end


def _is_good(frame: bytes) -> bool:
    old = frame[0] == OLD_MARKER
    if not old and frame[FLAGS] & ~FLAG_SIGNED:
        return False  # nobody could decode it
    kind, header = kind_of(number_of(frame)), OLD_HEADER if old else HEADER
    if kind is None:
        return not old
    end = header + frame[1]
    return octets_of_checksum(frame[1:end] + kind.extra) == frame[end : end + CHECKSUM]


def upgraded(frame: bytes) -> bytes:
    """A frame of MAVLink 1, of a message in the dialect, as one of MAVLink 2; any other frame as it is.

    A client begins with MAVLink 1 until it hears MAVLink 2 (pymavlink does).
    """
    kind = kind_of(frame[5]) if frame[0] == OLD_MARKER else None
    if kind is None:
        return frame
    payload = frame[OLD_HEADER : OLD_HEADER + frame[1]].rstrip(b"\0") or b"\0"
    head = HEAD.pack(MARKER, len(payload), 0, 0, frame[2], frame[3], frame[4], frame[5], 0)
    return head + payload + octets_of_checksum(head[1:] + payload + kind.extra)
