"""MAVLink 2 messages to frames and back, around pymavlink's generated codec (never `mavutil`)."""

from collections.abc import Container
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega

from rtshcua.mavlink.framing import FLAG_SIGNED, HEADER, MARKER, frame_length, message_id

Message = Any
"""An instance of a generated `MAVLink_..._message` class; pymavlink ships no types."""

# pymavlink lets an environment variable switch the checksum off. Nothing here may.
ardupilotmega.MAVLINK_IGNORE_CRC = 0


@dataclass(frozen=True, slots=True)
class Received:
    """A good frame: its checksum is right and its message is of the dialect."""

    message: Message
    name: str
    system: int
    component: int
    sequence: int
    signed: bool
    """Whether the frame carries a signature. Whether the signature is right is not checked here."""
    frame: bytes
    """The frame as it came, for the raw log."""


class Codec:
    """One end of a link: packs messages as (system, component), parses what the other end sent.

    `only`, if given, holds the system ids that are listened to; frames of others are dropped and counted in `foreign`.
    `damaged` counts stretches of bytes that were no good frame, `unknown` counts frames of messages that the dialect
    does not have and whose checksum therefore cannot be verified.
    """

    def __init__(self, system: int, component: int, only: Container[int] | None = None) -> None:
        self.damaged = 0
        self.unknown = 0
        self.foreign = 0
        self._only = only
        self._sender = ardupilotmega.MAVLink(None, system, component)
        self._receiver = ardupilotmega.MAVLink(None)

    def pack(self, message: Message) -> bytes:
        """The message's frame, with the next sequence number."""
        frame: bytes = message.pack(self._sender)
        self._sender.seq = (self._sender.seq + 1) % 256
        return frame

    def parse(self, datagram: bytes) -> list[Received]:
        """The good frames in a datagram, in order; never raises, whatever the bytes.

        A frame does not span datagrams, so nothing is kept from one call to the next.
        """
        good: list[Received] = []
        start = 0
        in_garbage = False
        while start < len(datagram):
            end = _frame_end(datagram, start)
            received = self._decode(datagram[start:end]) if end else None
            if received is not None:
                if self._only is None or received.system in self._only:
                    good.append(received)
                else:
                    self.foreign += 1
                start, in_garbage = end, False
            elif end and message_id(datagram, start) not in ardupilotmega.mavlink_map and _at_boundary(datagram, end):
                # Its checksum cannot be verified, but it is framed like the rest: skip it whole, lest something
                # that its payload holds be taken for a frame of its own.
                self.unknown += 1
                start, in_garbage = end, False
            else:
                self.damaged += not in_garbage
                next_marker = datagram.find(MARKER, start + 1)
                start, in_garbage = (next_marker if next_marker >= 0 else len(datagram)), True
        return good

    def _decode(self, frame: bytes) -> Received | None:
        if message_id(frame, 0) not in ardupilotmega.mavlink_map:
            return None
        try:
            message = self._receiver.decode(bytearray(frame))
        except ardupilotmega.MAVError:
            return None
        signed = bool(frame[2] & FLAG_SIGNED)
        return Received(message, message.get_type(), frame[5], frame[6], frame[4], signed, frame)


def _frame_end(datagram: bytes, start: int) -> int:
    """Where the frame that begins at `start` ends; 0 if no whole frame that can be understood begins there."""
    if datagram[start] != MARKER or len(datagram) < start + HEADER or datagram[start + 2] & ~FLAG_SIGNED:
        return 0
    end = start + frame_length(datagram, start)
    return end if end <= len(datagram) else 0


def _at_boundary(datagram: bytes, end: int) -> bool:
    return end == len(datagram) or datagram[end] == MARKER
