"""MAVLink 2 messages to frames and back, over pymavlink's generated messages (never `mavutil`)."""

from binascii import crc_hqx
from collections.abc import Container
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega

from rtshcua.codec.decode import Message as Message
from rtshcua.codec.decode import decode, kind_of
from rtshcua.mavlink.framing import CHECKSUM, FLAG_SIGNED, FLAGS, HEADER, MARKER, MIRROR, SIGNATURE, message_id
from rtshcua.mavlink.signing import Verifier

# pymavlink lets an environment variable switch the checksum off in its own decoder. Nobody here may use it so.
ardupilotmega.MAVLINK_IGNORE_CRC = 0


class Received(NamedTuple):
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


_received = tuple.__new__  # the constructor that a named tuple is given is a function more


class Codec:
    """One end of a link: packs messages as (system, component), parses what the other end sent.

    `only`, if given, holds the system ids that are listened to; frames of others are dropped and counted in `foreign`.
    `damaged` counts stretches of bytes that were no good frame, `unknown` counts frames of messages that the dialect
    does not have and whose checksum therefore cannot be verified, `refused` those that `verifier` did not accept.
    """

    def __init__(
        self, system: int, component: int, only: Container[int] | None = None, verifier: Verifier | None = None
    ) -> None:
        self.damaged = 0
        self.refused = 0
        self.unknown = 0
        self.foreign = 0
        self._only = only
        self._verifier = verifier
        self._sender = ardupilotmega.MAVLink(None, system, component)

    def pack(self, message: Message) -> bytes:
        """The message's frame, with the next sequence number."""
        sender = self._sender
        kind = kind_of(type(message).id)  # of the class: some messages have a field of this name
        if kind is None or kind.values is None:
            frame: bytes = message.pack(sender)
        else:
            # What pymavlink does, in a third of the time. Zeros at the end of a payload are not sent, but for the
            # first octet.
            payload = kind.fields.pack(*kind.values(message))
            if not payload[-1]:
                payload = payload[:1] + payload[1:].rstrip(b"\0")
            head = bytes((len(payload), 0, 0, sender.seq, sender.srcSystem, sender.srcComponent)) + kind.number
            covered = head + payload
            crc = crc_hqx((covered + kind.extra).translate(MIRROR), 0xFFFF)  # as `framing.checksum`
            frame = b"\xfd" + covered + bytes((MIRROR[crc >> 8], MIRROR[crc & 0xFF]))
        sender.seq = (sender.seq + 1) % 256
        return frame

    def parse(self, datagram: bytes, now_us: int = 0) -> list[Received]:
        """The good frames in a datagram, in order; never raises, whatever the bytes.

        A frame does not span datagrams, so nothing is kept from one call to the next. The time is the verifier's.
        """
        good: list[Received] = []
        start = 0
        in_garbage = False
        while start < len(datagram):
            end = _frame_end(datagram, start)
            received = _decode(datagram[start:end]) if end else None
            if received is not None:
                if self._only is not None and received.system not in self._only:
                    self.foreign += 1
                elif self._verifier is not None and not self._verifier.accept(received.frame, now_us):
                    self.refused += 1
                else:
                    good.append(received)
                start, in_garbage = end, False
            elif end and kind_of(message_id(datagram, start)) is None and _at_boundary(datagram, end):
                # Its checksum cannot be verified, but it is framed like the rest: skip it whole, lest something
                # that its payload holds be taken for a frame of its own.
                self.unknown += 1
                start, in_garbage = end, False
            else:
                self.damaged += not in_garbage
                next_marker = datagram.find(MARKER, start + 1)
                start, in_garbage = (next_marker if next_marker >= 0 else len(datagram)), True
        return good


def _decode(frame: bytes) -> Received | None:
    kind = kind_of(frame[7] | frame[8] << 8 | frame[9] << 16)
    message = None if kind is None else decode(frame, kind)
    if kind is None or message is None:
        return None
    signed = frame[FLAGS] == FLAG_SIGNED
    return _received(Received, (message, kind.name, frame[5], frame[6], frame[4], signed, frame))


def _frame_end(datagram: bytes, start: int) -> int:
    """Where the frame that begins at `start` ends; 0 if no whole frame that can be understood begins there."""
    octets = len(datagram)
    if datagram[start] != MARKER or octets < start + HEADER:
        return 0
    flags = datagram[start + FLAGS]
    if flags & ~FLAG_SIGNED:
        return 0
    end = start + HEADER + datagram[start + 1] + CHECKSUM + (SIGNATURE if flags else 0)
    return end if end <= octets else 0


def _at_boundary(datagram: bytes, end: int) -> bool:
    return end == len(datagram) or datagram[end] == MARKER
