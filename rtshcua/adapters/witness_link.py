"""Witnesses over a link: requests and answers in MAVLink 2 TUNNEL frames over UDP.

A sender's address proves nothing: requests carry the log's signatures, answers the witness's.

The logging side shows its witnesses the log as it grows, in a separate thread. It reads the log from its file, so the
flight neither feeds it nor waits for it. Only lines on the disk are shown: a witness must never have seen what a power
failure can remove.
"""

import select
import socket
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from queue import SimpleQueue
from threading import Event, Thread
from typing import Final, NamedTuple

from rtshcua.adapters.store.logs import add_anchors, anchors_path
from rtshcua.adapters.store.reading import open_regular
from rtshcua.codec.frames import Codec, ReceivedFrame
from rtshcua.codec.tunnel import Assembler, Whole, answer_name, messages, name_of
from rtshcua.evidence.witnessing.submission import Submission, anchor
from rtshcua.evidence.witnessing.witness import (  # fmt: skip
    CONFLICT,
    MALFORMED,
    OK,
    CosignRequest,
    Declined,
    WitnessResponse,
    decode,
    decode_answer,
)
from rtshcua.onboard.enforcement.frames import OURS

#: the kinds of tunnel messages
REQUEST: Final = 1
ANSWER: Final = 2
#: the ids of a witness: a ground station (MAVLink's customary id) and its logger
GROUND: Final = (255, 155)
_LARGEST: Final = 65_535
_BUFFER: Final = 1 << 20
#: the most datagrams that are processed in a row
_BATCH: Final = 256
#: the interval at which the log is checked, in seconds
EVERY_S: Final = 0.1
#: the wait before an unanswered request is repeated, in seconds, doubled each time up to the second value
AGAIN_S: Final = 1.0
LONGEST_S: Final = 8.0
#: How long to wait for the witnesses after the log was closed, in seconds.
LAST_S: Final = 3.0
#: The most octets of a log that are read at once, so that a long log does not hold up the flight's thread.
_SLICE: Final = 1 << 18
_GRACE_S: Final = 1.0
_MOST_WORDS: Final = 200
#: our ids on the witnesses' link
_SYSTEM: Final = 1

Consider = Callable[[CosignRequest], WitnessResponse | Declined]
Address = tuple[str, int]
_Heard = tuple[ReceivedFrame, Whole, Address]


class _Tunnel:
    """A non-blocking UDP socket, and the messages in frames of `codec`."""

    def __init__(self, address: Address, codec: Codec) -> None:
        """Raises OSError where the address cannot be bound."""
        self._codec = codec
        self._assembler = Assembler()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(address)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
            self._socket.setblocking(False)
        except OSError:
            self._socket.close()
            raise

    @property
    def port(self) -> int:
        """The local port (chosen by the system for 0)."""
        return int(self._socket.getsockname()[1])

    def hear(self, wait_s: float, known: Collection[Address] | None = None) -> Iterator[_Heard]:
        """The received messages with the frames that completed them, from `known` senders if given; waits for the first
        one.
        """
        if not select.select([self._socket], [], [], wait_s)[0]:
            return
        for _ in range(_BATCH):
            try:
                datagram, sender = self._socket.recvfrom(_LARGEST)
            except BlockingIOError:
                return
            except ConnectionError:
                continue  # an ICMP answer to an earlier datagram: nobody listens there
            if known is None or sender in known:
                for received in self._codec.parse(datagram):
                    whole = self._assembler.take(sender, received)
                    if whole is not None:
                        yield received, whole, sender

    def send(self, kind: int, name: bytes, data: bytes, address: Address, target: tuple[int, int] = (0, 0)) -> None:
        """Send a message to an address, for a system and component there (0: all)."""
        for message in messages(kind, name, data, target):
            with suppress(OSError):  # lost, as any datagram may be: the request is repeated
                self._socket.sendto(self._codec.pack(message), address)

    def close(self) -> None:
        """Close the port."""
        self._socket.close()


class WitnessLink:
    """Listens at an address and answers every request, whoever sends it. `consider` computes the answer; if it raises,
    there is no answer, and the sender repeats the request.
    """

    def __init__(self, address: Address, consider: Consider) -> None:
        """Raises OSError where the address cannot be bound."""
        self._tunnel = _Tunnel(address, Codec(*GROUND))
        self._consider = consider
        self.port = self._tunnel.port  # the local port
        self.close = self._tunnel.close

    def serve(self, wait_s: float) -> None:
        """Wait this long for requests, and answer them. Raises what `consider` raises, and OSError."""
        for received, whole, sender in self._tunnel.hear(wait_s):
            if whole.kind == REQUEST and whole.name == name_of(whole.data):
                self._answer(whole, (received.system, received.component), sender)

    def _answer(self, whole: Whole, asker: tuple[int, int], sender: Address) -> None:
        request = decode(whole.data)
        found = request if isinstance(request, Declined) else self._consider(request)
        if isinstance(found, Declined):
            if found.status == MALFORMED:
                return  # not sent by our software, so no answer is needed
            found = found.answer()
        answer = found.encode()
        self._tunnel.send(ANSWER, answer_name(whole.name, answer), answer, sender, asker)


# ------------------------------------------------------------------------------------- the logging side


class Anchor(NamedTuple):
    """A checkpoint that a witness cosigned: the note with its line."""

    note: str


class WitnessTrouble(NamedTuple):
    """A problem with a witness, reported once to the operator."""

    text: str


class _Peer:
    """One witness: its assumed state and the pending request."""

    def __init__(self, address: Address) -> None:
        self.address = address
        self.known: int | None = None
        self.asked: CosignRequest | None = None
        self.name = b""
        self.due_s = 0.0
        self.wait_s = AGAIN_S
        self.anchored = -1  # the size of the largest tree that it cosigned
        self.heard = False  # recently; a silent witness is only sent small requests
        self.lost = False  # it saw another log: it will cosign nothing more
        self.told: set[str] = set()


class WitnessClient:
    """Shows a log to its witnesses until it is finished. `witnesses` are the public keys in the trust root. `synced`
    returns how many lines of the log, from the first on, are on the disk; the thread calls it.
    """

    def __init__(
        self, addresses: Sequence[Address], log: Path, synced: Callable[[], int], witnesses: frozenset[bytes]
    ) -> None:
        """`addresses` are numeric. Raises OSError where no socket or no log is available."""
        self._log = log
        self._file = open_regular(log)
        try:
            self._tunnel = _Tunnel(("", 0), Codec(_SYSTEM, OURS))
        except OSError:
            self._file.close()
            raise
        self._synced = synced
        self._witnesses = witnesses
        self._peers = [_Peer(address) for address in addresses]
        self._submission = Submission()
        self._offset = 0
        self._news: SimpleQueue[Anchor | WitnessTrouble] = SimpleQueue()
        self._over = Event()
        self._until_s = 0.0
        self._thread = Thread(target=self._run, name="witnesses", daemon=True)
        self._thread.start()

    def news(self) -> list[Anchor | WitnessTrouble]:
        """The results since the last call; never waits."""
        return [self._news.get_nowait() for _ in range(self._news.qsize())]  # only this thread takes from it

    def finish(self, last_s: float = LAST_S) -> list[WitnessTrouble]:
        """Wait up to this long for the witnesses to cosign the end of the closed log. Cosignatures that no record holds
        are stored beside the log. Returns the problems.
        """
        self._until_s = time.monotonic() + last_s
        self._over.set()
        self._thread.join(last_s + _GRACE_S)
        if not self._thread.is_alive():  # otherwise the disk does not answer, and the process ends without the thread
            self._tunnel.close()
            self._file.close()
        news = self.news()
        troubles = [each for each in news if isinstance(each, WitnessTrouble)]
        anchors = [each.note for each in news if isinstance(each, Anchor)]
        try:
            if anchors:
                add_anchors(anchors_path(self._log), anchors)
        except OSError as error:
            troubles.append(
                WitnessTrouble(f"anchors of the log's end were not stored: {(error.strerror or str(error)).lower()}")
            )
        last = self._submission.last(self._submission.records)
        short = [peer for peer in self._peers if not peer.lost and (last is None or peer.anchored < last)]
        return troubles + [
            WitnessTrouble(f"witness {_shown(peer)} did not cosign the end of the log") for peer in short
        ]

    # -------------------------------------------------------- in the thread

    def _run(self) -> None:
        ending = False
        try:
            while not (self._over.is_set() and (self._done() or time.monotonic() >= self._until_s)):
                self._read()
                if self._over.is_set() and not ending:
                    ending = True
                    for peer in self._peers:
                        peer.due_s, peer.wait_s = 0.0, AGAIN_S
                now_s = time.monotonic()
                for peer in self._peers:
                    if not peer.lost and now_s >= peer.due_s:
                        self._ask(peer, now_s)
                self._hear()
        except Exception as error:  # noqa: BLE001  a thread that dies in silence would leave the log without witnesses
            self._news.put(WitnessTrouble(f"witnesses are no longer asked: {error}"))

    def _done(self) -> bool:
        """Whether every witness cosigned the last checkpoint of the whole file."""
        last = self._submission.last(self._submission.records)
        whole = self._offset == self._log.stat().st_size
        return whole and all(peer.lost or (last is not None and peer.anchored >= last) for peer in self._peers)

    def _read(self) -> None:
        """Read whole lines; a partial line is left, because the writer may cut it off again."""
        self._file.seek(self._offset)
        data = self._file.read(_SLICE)
        if b"\n" not in data and len(data) == _SLICE:
            data += self._file.readline()  # a genesis may be large
        for line in BytesIO(data):
            if line.endswith(b"\n"):
                self._submission.take(line)
                self._offset += len(line)

    def _ask(self, peer: _Peer, now_s: float) -> None:
        request = self._wanted(peer)
        if request is None:
            return
        data = request.encode()
        peer.asked, peer.name = request, name_of(data)
        peer.due_s, peer.wait_s = now_s + peer.wait_s, min(peer.wait_s * 2, LONGEST_S)
        peer.heard = peer.heard and peer.wait_s < LONGEST_S
        self._tunnel.send(REQUEST, peer.name, data, peer.address)

    def _wanted(self, peer: _Peer) -> CosignRequest | None:
        """The request to a witness, if any: the next checkpoints or, before that, its presence and state."""
        records = min(self._synced(), self._submission.records)
        request = self._submission.request(peer.known, records)
        if peer.known is None:
            return request if peer.heard else self._submission.request(None, min(records, 1))
        if peer.known > peer.anchored or (request is not None and not peer.heard):
            return self._submission.again(peer.known)
        return request

    def _hear(self) -> None:
        for _, whole, sender in self._tunnel.hear(EVERY_S, {peer.address for peer in self._peers}):
            for peer in self._peers:
                if peer.address != sender or peer.asked is None:
                    continue
                if (whole.kind, whole.name) == (ANSWER, answer_name(peer.name, whole.data)):
                    answer = decode_answer(whole.data)
                    if answer is not None:
                        self._answered(peer, peer.asked, answer)

    def _answered(self, peer: _Peer, asked: CosignRequest, answer: WitnessResponse) -> None:
        peer.asked, peer.heard, peer.wait_s, peer.due_s = None, True, AGAIN_S, 0.0
        if answer.status == OK:
            self._cosigned(peer, asked, answer)
        elif answer.status == CONFLICT and answer.size is not None:
            self._conflict(peer, asked, answer.size)
        else:
            peer.due_s = time.monotonic() + LONGEST_S
            words = "".join(letter if letter.isprintable() else " " for letter in answer.body[:_MOST_WORDS])
            self._tell(peer, f"refuses to cosign: {words.strip()}")

    def _cosigned(self, peer: _Peer, asked: CosignRequest, answer: WitnessResponse) -> None:
        mark = anchor(asked.note, answer.body, self._witnesses)
        if mark is None:
            peer.due_s = time.monotonic() + LONGEST_S
            self._tell(peer, "cosigns with a key that is not in the trust root")
            return
        peer.known = int(asked.note.split("\n", 2)[1])
        if peer.known > peer.anchored:
            peer.anchored = peer.known
            self._news.put(Anchor(mark))

    def _conflict(self, peer: _Peer, asked: CosignRequest, size: int) -> None:
        if size == 0 and asked.old:
            peer.known = None  # it has lost its state
        elif size != asked.old and self._submission.has(size):
            peer.known = size
        else:
            peer.lost = True
            self._tell(peer, f"saw another log of this vehicle and boot, of {size} records, and will not cosign")

    def _tell(self, peer: _Peer, text: str) -> None:
        if text not in peer.told:
            peer.told.add(text)
            self._news.put(WitnessTrouble(f"witness {_shown(peer)} {text}"))


def _shown(peer: _Peer) -> str:
    return f"{peer.address[0]}:{peer.address[1]}"
