"""Messages longer than a frame, over TUNNEL frames (https://mavlink.io/en/messages/common.html#TUNNEL).

A message is split into chunks; each carries the message's kind, its name, its own number and the number of chunks.
Frames may be lost, duplicated or reordered; a sender repeats a message with the same chunks, which fill the gaps.
Nothing here is trusted: the output is as hostile as the link.
"""

from collections import OrderedDict
from collections.abc import Hashable, Iterator
from hashlib import sha256
from struct import Struct
from typing import Final, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega

from rtshcua.codec.frames import Message, ReceivedFrame

#: Our type. Numbers from 32768 on are for private use (MAV_TUNNEL_PAYLOAD_TYPE).
PAYLOAD_TYPE: Final = 0xC05E
NAME_OCTETS: Final = 8
_HEAD: Final = Struct(f"<B{NAME_OCTETS}sHH")
_PAYLOAD: Final = 128
CHUNK: Final = _PAYLOAD - _HEAD.size
#: the longest message, in octets
LONGEST: Final = 1 << 16
MOST_CHUNKS: Final = -(-LONGEST // CHUNK)
#: the most unfinished messages that are kept, of all senders together, and of one sender
MOST_OPEN: Final = 32
MOST_OF_ONE: Final = 4


class Whole(NamedTuple):
    """A complete message."""

    kind: int
    name: bytes
    data: bytes


class _Open(NamedTuple):
    number: int
    chunks: dict[int, bytes]


def name_of(data: bytes) -> bytes:
    """The name of a message that is the first of an exchange."""
    return sha256(data).digest()[:NAME_OCTETS]


def answer_name(asked: bytes, data: bytes) -> bytes:
    """The name of the answer to the message of name `asked`, so that answers are never confused or combined."""
    return asked[: NAME_OCTETS // 2] + sha256(data).digest()[: NAME_OCTETS // 2]


def messages(kind: int, name: bytes, data: bytes, target: tuple[int, int] = (0, 0)) -> Iterator[Message]:
    """The TUNNEL messages that carry `data`, for a system and component (0: all). Raises ValueError for data that is
    too long.
    """
    if not 0 < len(data) <= LONGEST:
        raise ValueError(f"a message must have 1 to {LONGEST} octets, not {len(data)}")
    count = -(-len(data) // CHUNK)
    for index in range(count):
        payload = _HEAD.pack(kind, name, index, count) + data[index * CHUNK : (index + 1) * CHUNK]
        padded = list(payload.ljust(_PAYLOAD, b"\0"))
        yield ardupilotmega.MAVLink_tunnel_message(*target, PAYLOAD_TYPE, len(payload), padded)


class Assembler:
    """Assembles messages. Its memory is bounded; beyond that the oldest unfinished message is dropped."""

    def __init__(self) -> None:
        self._open: OrderedDict[tuple[Hashable, int, bytes], _Open] = OrderedDict()

    @property
    def unfinished(self) -> int:
        """The number of unfinished messages."""
        return len(self._open)

    def take(self, sender: Hashable, received: ReceivedFrame) -> Whole | None:
        """Process a frame of a sender; return the message that it completes, if any."""
        message = received.message
        if received.name != "TUNNEL" or message.payload_type != PAYLOAD_TYPE:
            return None
        payload = bytes(message.payload[: message.payload_length])
        if not _HEAD.size < len(payload) == message.payload_length:
            return None
        kind, name, index, count = _HEAD.unpack_from(payload)
        chunk = payload[_HEAD.size :]
        if not index < count <= MOST_CHUNKS or (len(chunk) != CHUNK and index != count - 1):
            return None
        key = (sender, kind, name)
        held = self._open.get(key)
        if held is None:
            held = self._open[key] = _Open(count, {})
            self._forget(sender)
        if held.number != count or held.chunks.setdefault(index, chunk) != chunk:
            del self._open[key]  # one of the two is not part of this message, and it is unknown which
            return None
        if len(held.chunks) < count:
            return None
        del self._open[key]
        return Whole(kind, name, b"".join(held.chunks[number] for number in range(count)))

    def _forget(self, sender: Hashable) -> None:
        theirs = [key for key in self._open if key[0] == sender]
        if len(theirs) > MOST_OF_ONE:
            del self._open[theirs[0]]
        elif len(self._open) > MOST_OPEN:
            self._open.popitem(last=False)
