"""Witnesses over a link: requests and answers in MAVLink 2 TUNNEL frames over UDP.

Nobody is believed for where a frame comes from: requests carry the log's signatures, answers the witness's.

The log's end shows its witnesses the log as it grows, in a thread of its own. It reads the log from its file, so the
flight gives it nothing and never waits for it. What is shown is on the disk: a witness must never have seen what a loss
of power takes away.
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

#: kinds of messages in the tunnel
REQUEST: Final = 1
ANSWER: Final = 2
#: what a witness calls itself: a ground station (MAVLink's customary id) and its logger
GROUND: Final = (255, 155)
_LARGEST: Final = 65_535
_BUFFER: Final = 1 << 20
#: the most datagrams that are taken in before anything else is looked at
_BATCH: Final = 256
#: how often the log is looked at, in seconds
EVERY_S: Final = 0.1
#: a request is sent again after so long without an answer, in seconds; each time twice as long, up to
AGAIN_S: Final = 1.0
LONGEST_S: Final = 8.0
#: How long the witnesses are waited for after the log was closed, in seconds.
LAST_S: Final = 3.0
#: How much of a log is read at once, in octets, so that a long one does not keep the flight's thread from running.
_SLICE: Final = 1 << 18
_GRACE_S: Final = 1.0
_MOST_WORDS: Final = 200
#: what we call ourselves on the witnesses' link
_SYSTEM: Final = 1

Consider = Callable[[CosignRequest], WitnessResponse | Declined]
Address = tuple[str, int]
_Heard = tuple[ReceivedFrame, Whole, Address]


class _Tunnel:
    """A UDP socket that never blocks, and the messages that go through it in frames of `codec`."""

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
        """The port listened at (the system's choice when 0 was asked for)."""
        return int(self._socket.getsockname()[1])

    def hear(self, wait_s: float, known: Collection[Address] | None = None) -> Iterator[_Heard]:
        """The messages that came, each with the frame that completed it, of those who are `known`, if that is given;
        the first is waited for.
        """
        if not select.select([self._socket], [], [], wait_s)[0]:
            return
        for _ in range(_BATCH):
            try:
                datagram, sender = self._socket.recvfrom(_LARGEST)
            except BlockingIOError:
                return
            except ConnectionError:
                continue  # an ICMP answer to something we sent: nobody listens there
            if known is None or sender in known:
                for received in self._codec.parse(datagram):
                    whole = self._assembler.take(sender, received)
                    if whole is not None:
                        yield received, whole, sender

    def send(self, kind: int, name: bytes, data: bytes, address: Address, target: tuple[int, int] = (0, 0)) -> None:
        """Sends a message to an address, for a system and component there (0: all)."""
        for message in messages(kind, name, data, target):
            with suppress(OSError):  # lost, as any datagram may be: it is asked again
                self._socket.sendto(self._codec.pack(message), address)

    def close(self) -> None:
        """Gives the port back."""
        self._socket.close()


class WitnessLink:
    """Listens at an address and answers every request that comes there, whoever sends it.

    `consider` says what to; when it raises, nothing is answered, and the sender asks again.
    """

    def __init__(self, address: Address, consider: Consider) -> None:
        """Raises OSError where the address cannot be bound."""
        self._tunnel = _Tunnel(address, Codec(*GROUND))
        self._consider = consider
        self.port = self._tunnel.port  # the one listened at
        self.close = self._tunnel.close

    def serve(self, wait_s: float) -> None:
        """Wait so long for requests, and answer those that came. Raises what `consider` raises, and OSError."""
        for received, whole, sender in self._tunnel.hear(wait_s):
            if whole.kind == REQUEST and whole.name == name_of(whole.data):
                self._answer(whole, (received.system, received.component), sender)

    def _answer(self, whole: Whole, asker: tuple[int, int], sender: Address) -> None:
        request = decode(whole.data)
        found = request if isinstance(request, Declined) else self._consider(request)
        if isinstance(found, Declined):
            if found.status == MALFORMED:
                return  # nobody of ours sends such, and whoever does need not be answered
            found = found.answer()
        answer = found.encode()
        self._tunnel.send(ANSWER, answer_name(whole.name, answer), answer, sender, asker)


# ------------------------------------------------------------------------------------- the end of the log


class Anchor(NamedTuple):
    """A checkpoint that a witness cosigned: the note with the witness's line."""

    note: str


class WitnessTrouble(NamedTuple):
    """What an operator should know of a witness; told once."""

    text: str


class _Peer:
    """One witness: what it is thought to know, and what it was asked."""

    def __init__(self, address: Address) -> None:
        self.address = address
        self.known: int | None = None
        self.asked: CosignRequest | None = None
        self.name = b""
        self.due_s = 0.0
        self.wait_s = AGAIN_S
        self.anchored = -1  # the size of the largest tree that it cosigned
        self.heard = False  # lately; who is silent is asked for what is little to send in vain
        self.lost = False  # it saw another log: there is nothing more to be had from it
        self.told: set[str] = set()


class WitnessClient:
    """Shows a log to its witnesses until it is finished. `witnesses` are the public keys that the trust root names.

    `synced` gives how many lines of the log, from the first on, are on the disk; it is called from the thread.
    """

    def __init__(
        self, addresses: Sequence[Address], log: Path, synced: Callable[[], int], witnesses: frozenset[bytes]
    ) -> None:
        """`addresses` are numbers, not names. Raises OSError where there is no socket to be had, or no log."""
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
        """What came since the last call; never waits."""
        return [self._news.get_nowait() for _ in range(self._news.qsize())]  # nobody else takes from it

    def finish(self, last_s: float = LAST_S) -> list[WitnessTrouble]:
        """The log is closed, or nothing more comes: wait up to so long for the witnesses to cosign its end.

        What they cosigned and no record holds is put beside the log. Gives what went wrong.
        """
        self._until_s = time.monotonic() + last_s
        self._over.set()
        self._thread.join(last_s + _GRACE_S)
        if not self._thread.is_alive():  # else the disk does not answer, and the process ends without it
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
        """Take in whole lines; what the disk took of one more is not touched, for it may be cut off again."""
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
        """What to ask of it, if anything: what lies ahead, and before that whether it is there, and where it stands."""
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
            peer.known = None  # it has forgotten
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
