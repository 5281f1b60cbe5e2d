"""Witnesses over a link: requests and answers in MAVLink 2 TUNNEL frames over UDP. This is the end of the witness.

Nobody is believed for where a frame comes from: requests carry the log's signatures, answers the witness's.
"""

import select
import socket
from collections.abc import Callable
from typing import Final

from rtshcua.codec.frames import Codec
from rtshcua.codec.tunnel import Assembler, answer_name, messages, name_of
from rtshcua.evidence.witnessing.witness import MALFORMED, Answer, Declined, Request, decode

#: kinds of messages in the tunnel
REQUEST: Final = 1
ANSWER: Final = 2
#: what a witness calls itself: a ground station (MAVLink's customary id) and its logger
GROUND: Final = (255, 155)
_LARGEST: Final = 65_535
_BUFFER: Final = 1 << 20
#: the most datagrams that are taken in before anything else is looked at
_BATCH: Final = 256

Consider = Callable[[Request], Answer | Declined]


def listen(address: tuple[str, int]) -> socket.socket:
    """A socket that never blocks. Raises OSError where the address cannot be bound."""
    link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        link.bind(address)
        link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        link.setblocking(False)
    except OSError:
        link.close()
        raise
    return link


class WitnessLink:
    """Listens at an address and answers every request that comes there, whoever sends it.

    `consider` says what to; when it raises, nothing is answered, and the sender asks again.
    """

    def __init__(self, address: tuple[str, int], consider: Consider) -> None:
        """Raises OSError where the address cannot be bound."""
        self._socket = listen(address)
        self._consider = consider
        self._codec = Codec(*GROUND)
        self._assembler = Assembler()

    @property
    def port(self) -> int:
        """The port listened at (the system's choice when 0 was asked for)."""
        return int(self._socket.getsockname()[1])

    def serve(self, wait_s: float) -> None:
        """Wait so long for requests, and answer those that came. Raises what `consider` raises, and OSError."""
        if not select.select([self._socket], [], [], wait_s)[0]:
            return
        for _ in range(_BATCH):
            try:
                datagram, sender = self._socket.recvfrom(_LARGEST)
            except BlockingIOError:
                return
            except ConnectionError:
                continue  # an ICMP answer to something we sent: whoever asked is gone
            for received in self._codec.parse(datagram):
                whole = self._assembler.take(sender, received)
                if whole is not None and whole.kind == REQUEST and whole.name == name_of(whole.data):
                    self._answer(whole.name, whole.data, (received.system, received.component), sender)

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()

    def _answer(self, name: bytes, data: bytes, asker: tuple[int, int], sender: tuple[str, int]) -> None:
        request = decode(data)
        found = request if isinstance(request, Declined) else self._consider(request)
        if isinstance(found, Declined):
            if found.status == MALFORMED:
                return  # nobody of ours sends such, and whoever does need not be answered
            found = found.answer()
        answer = found.encode()
        for message in messages(ANSWER, answer_name(name, answer), answer, asker):
            try:
                self._socket.sendto(self._codec.pack(message), sender)
            except OSError:
                return  # lost, as any datagram may be: it is asked again
