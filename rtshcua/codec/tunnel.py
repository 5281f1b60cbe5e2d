"""Messages longer than a frame, over TUNNEL frames (https://mavlink.io/en/messages/common.html#TUNNEL).

A message is cut into chunks; each carries the message's kind, its name, its own number and how many there are. Frames
get lost, come twice and out of order; who sends a message again sends the same chunks, which fill what is missing.
Nothing here is trusted: what comes out is bytes, as hostile as the link.
"""

from collections import OrderedDict
from collections.abc import Hashable, Iterator
from hashlib import sha256
from struct import Struct
from typing import Final, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega

from rtshcua.codec.frames import Message, ReceivedFrame

#: Ours. Numbers from 32768 on are nobody's, for use among parties that agree (MAV_TUNNEL_PAYLOAD_TYPE).
PAYLOAD_TYPE: Final = 0xC05E
NAME_OCTETS: Final = 8
_HEAD: Final = Struct(f"<B{NAME_OCTETS}sHH")
_PAYLOAD: Final = 128
CHUNK: Final = _PAYLOAD - _HEAD.size
#: the longest message, in octets
LONGEST: Final = 1 << 16
MOST_CHUNKS: Final = -(-LONGEST // CHUNK)
#: how many unfinished messages are kept, of all senders together, and of one
MOST_OPEN: Final = 32
MOST_OF_ONE: Final = 4


class Whole(NamedTuple):
    """A message that is complete."""

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
    """The name of what answers the message of name `asked`: two answers are never mixed up, nor put together."""
    return asked[: NAME_OCTETS // 2] + sha256(data).digest()[: NAME_OCTETS // 2]


def messages(kind: int, name: bytes, data: bytes, target: tuple[int, int] = (0, 0)) -> Iterator[Message]:
    """The TUNNEL messages that carry `data`, for a system and component (0: all). Raises ValueError for too much."""
    if not 0 < len(data) <= LONGEST:
        raise ValueError(f"a message has from 1 to {LONGEST} octets, not {len(data)}")
    count = -(-len(data) // CHUNK)
    for index in range(count):
        payload = _HEAD.pack(kind, name, index, count) + data[index * CHUNK : (index + 1) * CHUNK]
        padded = list(payload.ljust(_PAYLOAD, b"\0"))
        yield ardupilotmega.MAVLink_tunnel_message(*target, PAYLOAD_TYPE, len(payload), padded)


class Assembler:
    """Puts messages together. What it holds is bounded; of too many unfinished messages the oldest is forgotten."""

    def __init__(self) -> None:
        self._open: OrderedDict[tuple[Hashable, int, bytes], _Open] = OrderedDict()

    @property
    def unfinished(self) -> int:
        """How many messages are unfinished."""
        return len(self._open)

    def take(self, sender: Hashable, received: ReceivedFrame) -> Whole | None:
        """Take in a frame of a sender; gives the message that it completes, if it does."""
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
            del self._open[key]  # one of the two is not of this message, and which, nobody knows
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
