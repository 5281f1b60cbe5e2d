"""Converts MAVLink 2 messages to frames and back, over pymavlink's generated messages (never `mavutil`).

It does the work of pymavlink's `decode` and `pack`, prepared once for each kind of message. The message is of a
class derived from pymavlink's, with every field; its header is empty, because `ReceivedFrame` has the sender.

A fast equivalent of pymavlink's codec. Goal: a flight in virtual time is at least 150 times as fast as real time
(bench/virtual_time.py); on a busy machine 52 times with this codec, 39 with pymavlink's two functions
(docs/adr/0037). tests/unit/codec/test_decode.py checks that both give the same for every kind of message.
"""

from binascii import crc_hqx
from collections.abc import Callable, Container, Mapping
from functools import cache, lru_cache
from struct import Struct
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega

from rtshcua.mavlink.framing import (
    CHECKSUM,
    FLAG_SIGNED,
    FLAGS,
    HEADER,
    MARKER,
    MIRROR,
    SIGNATURE,
    message_id,
    octets_of_checksum,
)
from rtshcua.mavlink.signing import FrameVerifier

# An environment variable can disable the checksum in pymavlink's own decoder, which must not be used here.
ardupilotmega.MAVLINK_IGNORE_CRC = 0

_HEAD = Struct("<BBBBBB3s").pack
_head = Struct("<xBBxBBB3s").unpack_from

Message = Any
"An instance of a generated `MAVLink_..._message` class; pymavlink ships no types."


def is_addressed(message: Message, system: int, component: int) -> bool:
    """Whether a message is for this component: it names it, or all (0), or its kind has no target."""
    systems, components = (0, system), (0, component)
    return getattr(message, "target_system", 0) in systems and getattr(message, "target_component", 0) in components


class MessageKind(NamedTuple):
    """How to decode messages of one number."""

    name: str
    extra: bytes
    "The octet that the checksum includes after the payload: a digest of the message's layout."
    fields: Struct
    build: Callable[..., Message]
    "Makes a message of the values on the wire, in their order."
    number: bytes
    "As it is in a frame's header."
    payload: Callable[[Message], bytes] | None
    "Packs the payload of a message, with trailing zeros; None if it contains texts."


_UNKNOWN = MessageKind("", b"", Struct(""), tuple, b"", None)
"Of messages that are not in the dialect."

_met: dict[bytes, MessageKind] = {}  # the kinds of received messages, by number: at most as many as the dialect has


@lru_cache(maxsize=1024)  # more than the dialect has; a hostile link may send 2^24 numbers
def kind_of(number: int) -> MessageKind | None:
    """The kind of a message; None if it is not in the dialect."""
    of = ardupilotmega.mavlink_map.get(number)
    if of is None:
        return None
    extra, octets = bytes([of.crc_extra]), number.to_bytes(3, "little")
    if "char" in of.fieldtypes:
        return MessageKind(of.msgname, extra, of.unpacker, _any(of), octets, None)
    return MessageKind(of.msgname, extra, of.unpacker, _numbers(of), octets, _payload(of))


def _function(text: str, **known: Any) -> Callable[..., Any]:
    """The function `made` of source text that is composed of pymavlink's own field names.

    Assigning and reading fields by name takes a third of the time of a dictionary.
    """
    exec(text, known)
    made: Callable[..., Any] = known["made"]
    return made


def _bare(of: Any) -> dict[str, Any]:
    """The contents of a message besides its fields."""
    made = of(*[0] * len(of.fieldnames))
    return {name: value for name, value in vars(made).items() if name not in of.fieldnames}


def _layout(of: Any) -> tuple[tuple[str, int, int], ...]:
    """Each field in the order of the wire, its start among the values, and its length."""
    starts = [sum(of.lengths[:place]) for place in range(len(of.lengths))]
    return tuple(zip(of.ordered_fieldnames, starts, of.lengths, strict=True))


@cache
def _filled(of: Any) -> Any:
    """The class of a message with the values that are the same in all instances."""
    return type(of.__name__, (of,), _bare(of))


def _making(of: Any, takes: str, fields: Mapping[str, str], **known: Any) -> Callable[..., Message]:
    """A function with the parameters `takes` that makes a message with each field's value, without the generated
    constructor.
    """
    set_all = "\n".join(f"    message.{name} = {value}" for name, value in fields.items())
    text = f"def made({takes}):\n    message = new(of)\n{set_all}\n    return message"
    return _function(text, new=object.__new__, of=_filled(of), **known)


def _numbers(of: Any) -> Callable[..., Message]:
    """A constructor of a message without texts, from the values on the wire."""
    takes = [f"value{place}" for place in range(sum(of.lengths))]
    fields = {
        name: takes[start] if length == 1 else f"[{', '.join(takes[start : start + length])}]"
        for name, start, length in _layout(of)
    }
    return _making(of, ", ".join(takes), fields)


def maker(of: Any) -> Callable[..., Message]:
    """A constructor of a message without texts, with the arguments of the generated one."""
    defaults = of.__init__.__defaults__ or ()
    given = len(of.fieldnames) - len(defaults)
    takes = [f"value{place}" + f"=defaults[{place - given}]" * (place >= given) for place in range(len(of.fieldnames))]
    fields = {name: f"value{place}" for place, name in enumerate(of.fieldnames)}
    return _making(of, ", ".join(takes), fields, defaults=defaults)


def _payload(of: Any) -> Callable[[Message], bytes]:
    """A function that packs the values of a message, in the order of the wire."""
    values = [f"message.{name}" if length == 1 else f"*message.{name}[:{length}]" for name, _, length in _layout(of)]
    return _function(f"def made(message): return pack({', '.join(values)})", pack=of.unpacker.pack)


def _any(of: Any) -> Callable[..., Message]:
    """A message with texts, made by the generated constructor."""
    starts = [sum(of.lengths[:place]) for place in range(len(of.lengths))]
    pick = [(starts[place], of.lengths[place]) for place in of.orders]

    def build(*values: Any) -> Message:
        fields: list[Any] = []
        for start, length in pick:
            value = values[start]
            if isinstance(value, bytes):
                value = value.rstrip(b"\0")
            elif length > 1:
                value = list(values[start : start + length])
            fields.append(value)
        return of(*fields)

    return build


class ReceivedFrame(NamedTuple):
    """A frame with a correct checksum and a message of the dialect."""

    message: Message
    name: str
    system: int
    component: int
    sequence: int
    signed: bool
    "Whether the frame is signed. The signature is not verified here."
    frame: bytes
    "The received octets, for the raw log."


_LEAST, _BEHIND_SIGNED = HEADER + CHECKSUM, CHECKSUM + SIGNATURE


class Codec:
    """One end of a link: packs messages as (system, component), and parses those of the other end.

    `only`, if given, holds the accepted system ids; frames of others are dropped and counted in `foreign`.
    `damaged` counts sequences of bytes that were not a valid frame, `unknown` counts frames of messages that are
    not in the dialect, so that their checksum cannot be verified, `refused` those that `verifier` did not accept.
    """

    def __init__(
        self, system: int, component: int, only: Container[int] | None = None, verifier: FrameVerifier | None = None
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
        kind = kind_of(type(message).id)  # read from the class, because some messages have a field of this name
        _, extra, _, _, number, payload_of = kind or _UNKNOWN
        if payload_of is None:
            frame: bytes = message.pack(sender)
        else:
            # Equivalent to pymavlink in a third of the time. Trailing zeros of a payload are not sent, except its
            # first octet.
            payload = payload_of(message)
            if not payload[-1]:
                payload = payload.rstrip(b"\0") or b"\0"
            head = _HEAD(len(payload), 0, 0, sender.seq, sender.srcSystem, sender.srcComponent, number)
            covered = head + payload
            frame = b"\xfd" + covered + octets_of_checksum(covered + extra)
        sender.seq = (sender.seq + 1) % 256
        return frame

    def parse(self, datagram: bytes, now_us: int = 0) -> list[ReceivedFrame]:
        """The valid frames in a datagram, in order; raises nothing.

        A frame does not span datagrams, so nothing is kept between calls. The time is for the verifier.
        """
        received, only = decode(datagram), self._only  # a datagram usually contains one frame
        if received is not None:
            heeded = self._verifier is None and (only is None or received[2] in only)
            return [received] if heeded or self._lets_in(received, now_us) else []
        good: list[ReceivedFrame] = []
        start, octets = 0, len(datagram)
        in_garbage = False
        while start < octets:
            end = _frame_end(datagram, start)
            received = decode(datagram[start:end]) if end else None
            if received is not None:
                if self._lets_in(received, now_us):
                    good.append(received)
                start, in_garbage = end, False
            elif end and kind_of(message_id(datagram, start)) is None and _at_boundary(datagram, end):
                # Its checksum cannot be verified, but it has the frame of a message: skip all of it, so that its
                # payload is not parsed as a frame.
                self.unknown += 1
                start, in_garbage = end, False
            else:
                self.damaged += not in_garbage
                next_marker = datagram.find(MARKER, start + 1)
                start, in_garbage = (next_marker if next_marker >= 0 else octets), True
        return good

    def _lets_in(self, received: ReceivedFrame, now_us: int) -> bool:
        """Whether a valid frame is from an accepted system; counted if not."""
        if self._only is not None and received[2] not in self._only:
            self.foreign += 1
        elif self._verifier is not None and not self._verifier.accept(received[6], now_us):
            self.refused += 1
        else:
            return True
        return False


def decode(frame: bytes) -> ReceivedFrame | None:
    """The valid frame in these octets, signed or not; None for anything else."""
    octets = len(frame)
    if octets < _LEAST or frame[0] != MARKER:
        return None
    length, flags, sequence, system, component, number = _head(frame)
    end = HEADER + length
    if octets != end + (_BEHIND_SIGNED if flags else CHECKSUM) or flags & ~FLAG_SIGNED:
        return None
    kind = _met.get(number)
    if kind is None:
        kind = kind_of(int.from_bytes(number, "little"))
        if kind is None:
            return None
        _met[number] = kind
    name, extra, fields, build, _, _ = kind
    if crc_hqx((frame[1:end] + extra + frame[end : end + CHECKSUM]).translate(MIRROR), 0xFFFF):
        return None  # the CRC of octets that end in their own checksum is 0
    size = fields.size
    if length >= size:  # a longer payload is from a newer dialect
        message = build(*fields.unpack_from(frame, HEADER))
    else:
        message = build(*fields.unpack(frame[HEADER:end].ljust(size, b"\0")))  # trailing zeros are not sent
    return ReceivedFrame(message, name, system, component, sequence, flags != 0, frame)


def _frame_end(datagram: bytes, start: int) -> int:
    """The end of the frame that begins at `start`; 0 if there is no complete, known frame."""
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
