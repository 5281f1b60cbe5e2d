"""The clients' sides of the relay: an address each, with a bounded number of peers.

What a client costs is bounded: the datagrams read in one turn and in one second, the connections accepted, the octets
kept for a slow reader. Beyond that its descriptor is not waited for, and the system drops its datagrams.
"""

import socket
from collections.abc import Callable, Sequence
from contextlib import suppress
from select import EPOLLIN, EPOLLOUT
from typing import Any, Final, Protocol

from rtshcua.adapters.gateway.frames import good_frames, upgraded
from rtshcua.adapters.gateway.messages import ClientCounts, ClientSetup
from rtshcua.adapters.vehicle.address import Address, LinkCarrier
from rtshcua.adapters.vehicle.transport import Transport, open_transport, prepare_connection
from rtshcua.codec.stream import FrameStream

S: Final = 1_000_000
#: the most datagrams or chunks read from one descriptor in one turn
READS: Final = 8
#: a longer datagram is cut, and so it is no whole frames
_LONGEST: Final = 4_096
#: octets read from a stream at once
_CHUNK: Final = 1_024
#: more frames a second than any link has: what a pilot sends is bounded by the turns alone
_PILOTS_RATE: Final = S
#: for each frame a second that may be passed on, this many reads a second, at least `_LEAST_READS`
_READS_OF_A_FRAME: Final = 4
_LEAST_READS: Final = 400
#: and of a stream so many octets, at least one chunk: in the worst ones it takes 1 us each to look for frames
_OCTETS_OF_A_FRAME: Final = 64
#: how long a descriptor beyond its limit is left alone
PAUSE_US: Final = 20_000
#: accepted connections a second of one address, and at once; the others wait in the system's short queue
_WELCOMES: Final = 50
_WELCOMES_AT_ONCE: Final = 8
_QUEUED: Final = 8
#: the buffers of a connection, in the system and here: a reader that is further behind is dropped
_SYSTEM_BUFFER: Final = 1 << 17
UNSENT: Final = 1 << 16
#: a sender of UDP that was silent for so long is gone, even if nobody wants its place
FORGOTTEN_US: Final = 60 * S
SLOW_READER: Final = "it reads too slowly"


class Bucket:
    """A token bucket: `rate` a second, at most `burst` at once."""

    def __init__(self, rate: int, burst: int) -> None:
        self._each_us = max(1, S // rate)
        self._span_us = burst * self._each_us
        self._level_us: int | None = None

    def take(self, amount: int, now_us: int) -> bool:
        """Take so many tokens at this time; False, and none taken, if there are fewer."""
        full_us = now_us - self._span_us
        level_us = full_us if self._level_us is None or self._level_us < full_us else self._level_us
        level_us += amount * self._each_us
        if level_us > now_us:
            return False
        self._level_us = level_us
        return True

    def charge(self, amount: int, now_us: int) -> None:
        """Take so many tokens, even if there are fewer: `take` finds none until they are there again."""
        full_us = now_us - self._span_us
        level_us = full_us if self._level_us is None or self._level_us < full_us else self._level_us
        self._level_us = level_us + amount * self._each_us


class ClientPeer:
    """One sender or connection of a client's address. It is `up` after its first whole frame."""

    def __init__(self, number: int, index: int, setup: ClientSetup, where: str, now_us: int) -> None:
        self.number, self.index, self.setup, self.where = number, index, setup, where
        self.up = False
        self.made_us = self.heard_us = now_us
        self.bucket = Bucket(rate := _rate(setup), rate)
        self.counts = ClientCounts(number)
        #: the messages that it does not get from the vehicle, besides the dialogues of others
        self.withheld: frozenset[int] = frozenset()

    def send(self, datagram: bytes) -> None:
        """Send whole frames to it; lost if it cannot take them."""
        raise NotImplementedError


class Hub(Protocol):
    """What the sides know of the relay."""

    def watch(self, descriptor: int, ready: Callable[[int, int], None], events: int = EPOLLIN) -> None:
        """Wait for a descriptor: `ready(now_us, events)` is called when it is ready."""
        ...

    def forget(self, descriptor: int) -> None:
        """Wait for it no longer; before it is closed."""
        ...

    def pause(self, descriptor: int, until_us: int) -> None:
        """Wait for it again from this time on."""
        ...

    def number(self) -> int:
        """A number for a new peer."""
        ...

    def joined(self, peer: ClientPeer) -> None:
        """A peer gets the vehicle's frames from now on."""
        ...

    def left(self, peer: ClientPeer, why: str) -> None:
        """A peer is gone."""
        ...

    def heard(self, peer: ClientPeer, frames: Sequence[bytes], now_us: int) -> None:
        """Whole frames came from a peer."""
        ...

    def turned_away(self) -> None:
        """Somebody found no place."""
        ...


class ClientSide(Protocol):
    """An open address of a client."""

    @property
    def bound(self) -> str:
        """The address as it is open: with the port that the system chose, if it was to choose one."""
        ...

    def tend(self, now_us: int) -> None:
        """Whatever is due from time to time."""
        ...

    def close(self) -> None:
        """Close it."""
        ...


def open_side(hub: Hub, index: int, setup: ClientSetup, address: Address, now_us: int) -> ClientSide:
    """Open the address of a client. Raises OSError."""
    match address.way:
        case LinkCarrier.UDP_IN:
            return UdpSide(hub, index, setup, address)
        case LinkCarrier.TCP_IN:
            return TcpSide(hub, index, setup, address)
        case _:
            return LineSide(hub, index, setup, address, now_us)


def _rate(setup: ClientSetup) -> int:
    """How many frames a second a peer may send."""
    return _PILOTS_RATE if setup.pilot else setup.rate


def _reads(setup: ClientSetup) -> Bucket:
    rate = max(_LEAST_READS, _READS_OF_A_FRAME * _rate(setup))
    return Bucket(rate, rate // 4)


# ---------------------------------------------------------------- datagrams


class _UdpPeer(ClientPeer):
    def __init__(self, link: socket.socket, to: tuple[str, int], *rest: Any) -> None:
        super().__init__(*rest)
        self._send, self._to = link.sendto, to

    def send(self, datagram: bytes) -> None:
        try:
            self.counts.sent += self._send(datagram, self._to)
        except OSError:
            self.counts.lost += 1


class UdpSide:
    """A UDP address to which clients send. Whoever sends a whole frame first has a place, until it is silent."""

    def __init__(self, hub: Hub, index: int, setup: ClientSetup, address: Address) -> None:
        self._hub, self._index, self._setup = hub, index, setup
        self._reads = _reads(setup)
        self._peers: dict[tuple[str, int], _UdpPeer] = {}
        self._link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._link.bind((address.host, address.port))
        except OSError:
            self._link.close()
            raise
        self._link.setblocking(False)
        hub.watch(self._link.fileno(), self._ready)

    @property
    def bound(self) -> str:
        host, port = self._link.getsockname()
        return f"{LinkCarrier.UDP_IN}:{host}:{port}"

    def tend(self, now_us: int) -> None:
        for sender, peer in list(self._peers.items()):
            if now_us - peer.heard_us > FORGOTTEN_US:
                self._drop(sender, "it was silent for a minute")

    def close(self) -> None:
        self._hub.forget(self._link.fileno())
        self._link.close()

    def _ready(self, now_us: int, events: int) -> None:
        for _ in range(READS):
            if not self._reads.take(1, now_us):
                self._hub.pause(self._link.fileno(), now_us + PAUSE_US)
                return
            try:
                datagram, sender = self._link.recvfrom(_LONGEST)
            except BlockingIOError:
                return
            except OSError:
                continue  # an answer of the network to an earlier datagram
            self._received(datagram, sender, now_us)

    def _received(self, datagram: bytes, sender: tuple[str, int], now_us: int) -> None:
        peer = self._peers.get(sender)
        if peer is not None and not peer.bucket.take(0, now_us):
            peer.counts.dropped += 1  # at least one frame, or garbage: it is not looked into
            return
        eldest = None
        if peer is None and len(self._peers) >= self._setup.peers:
            eldest = min(self._peers, key=lambda each: self._peers[each].heard_us)
            if now_us - self._peers[eldest].heard_us < self._setup.silence_s * S:
                self._hub.turned_away()
                return
        frames, garbage = good_frames(datagram)
        if peer is None:
            if not frames:
                return
            if eldest is not None:
                self._drop(eldest, "it was silent, and another one came")
            peer = self._admitted(sender, now_us)
        peer.counts.garbage += garbage
        if frames:
            take_frames(self._hub, peer, frames, now_us)

    def _admitted(self, sender: tuple[str, int], now_us: int) -> _UdpPeer:
        where = f"{sender[0]}:{sender[1]}"
        peer = _UdpPeer(self._link, sender, self._hub.number(), self._index, self._setup, where, now_us)
        self._peers[sender] = peer
        self._hub.joined(peer)
        return peer

    def _drop(self, sender: tuple[str, int], why: str) -> None:
        self._hub.left(self._peers.pop(sender), why)


# ---------------------------------------------------------------- connections


class _TcpPeer(ClientPeer):
    """A connection. Unsent octets are kept up to `UNSENT`; the side drops one that has more."""

    def __init__(self, side: "TcpSide", link: socket.socket, *rest: Any) -> None:
        super().__init__(*rest)
        self.link = link
        self.frames = FrameStream(every=True)
        self.reads = _reads(self.setup)
        octets = _OCTETS_OF_A_FRAME * _rate(self.setup)
        self.octets = Bucket(octets, octets)
        self._side = side
        self._unsent = b""

    def send(self, datagram: bytes) -> None:
        if self._unsent:
            if len(self._unsent) + len(datagram) > UNSENT:
                self.counts.lost += 1
                self._side.doomed[self] = SLOW_READER
            else:
                self._unsent += datagram
            return
        try:
            taken = self.link.send(datagram)
        except BlockingIOError:
            taken = 0
        except OSError as error:
            self._side.doomed[self] = reason(error)
            return
        self.counts.sent += taken
        if taken < len(datagram):
            self._unsent = datagram[taken:]
            self._side.await_room(self, waiting=True)

    def flush(self) -> None:
        """Send what waits. Raises OSError for a lost connection."""
        with suppress(BlockingIOError):
            taken = self.link.send(self._unsent)
            self.counts.sent += taken
            self._unsent = self._unsent[taken:]
        if not self._unsent:
            self._side.await_room(self, waiting=False)


class TcpSide:
    """A TCP address to which clients connect. Dropped are: lost connections and those to nobody, slow readers, and, as
    soon as another one wants the place, a connection that never sent a frame.
    """

    def __init__(self, hub: Hub, index: int, setup: ClientSetup, address: Address) -> None:
        self._hub, self._index, self._setup = hub, index, setup
        self._welcomes = Bucket(_WELCOMES, _WELCOMES_AT_ONCE)
        self._peers: dict[int, _TcpPeer] = {}
        #: connections to drop, and why: not while frames are passed on to all
        self.doomed: dict[_TcpPeer, str] = {}
        self._listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._listener.bind((address.host, address.port))
            self._listener.listen(_QUEUED)
        except OSError:
            self._listener.close()
            raise
        self._listener.setblocking(False)
        hub.watch(self._listener.fileno(), self._welcome)

    @property
    def bound(self) -> str:
        host, port = self._listener.getsockname()
        return f"{LinkCarrier.TCP_IN}:{host}:{port}"

    def tend(self, now_us: int) -> None:
        while self.doomed:
            peer, why = self.doomed.popitem()
            self._drop(peer, why)

    def close(self) -> None:
        for peer in list(self._peers.values()):
            self._drop(peer, "the gateway ends")
        self._hub.forget(self._listener.fileno())
        self._listener.close()

    def await_room(self, peer: _TcpPeer, *, waiting: bool) -> None:
        """Wait until a connection takes octets again, or no longer."""
        ready = self._ready_of(peer)
        self._hub.watch(peer.link.fileno(), ready, EPOLLIN | EPOLLOUT if waiting else EPOLLIN)

    def _welcome(self, now_us: int, events: int) -> None:
        if not self._welcomes.take(1, now_us):
            self._hub.pause(self._listener.fileno(), now_us + PAUSE_US)
            return
        try:
            link, (host, port) = self._listener.accept()
        except OSError:
            return
        if not self._has_place(now_us):
            self._hub.turned_away()
            link.close()
            return
        link.setblocking(False)
        prepare_connection(link)
        link.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SYSTEM_BUFFER)
        peer = _TcpPeer(self, link, self._hub.number(), self._index, self._setup, f"{host}:{port}", now_us)
        self._peers[peer.number] = peer
        self._hub.watch(link.fileno(), self._ready_of(peer))
        self._hub.joined(peer)

    def _has_place(self, now_us: int) -> bool:
        if len(self._peers) < self._setup.peers:
            return True
        mute = [peer for peer in self._peers.values() if not peer.up]
        eldest = min(mute, key=lambda each: each.made_us, default=None)
        if eldest is None or now_us - eldest.made_us < self._setup.silence_s * S:
            return False
        self._drop(eldest, "it never sent a frame, and another one came")
        return True

    def _ready_of(self, peer: _TcpPeer) -> Callable[[int, int], None]:
        return lambda now_us, events: self._ready(peer, now_us, events)

    def _ready(self, peer: _TcpPeer, now_us: int, events: int) -> None:
        try:
            if events & EPOLLOUT:
                peer.flush()
            if events & ~EPOLLOUT:
                self._read(peer, now_us)
        except BlockingIOError:
            return
        except OSError as error:
            self._drop(peer, reason(error))

    def _read(self, peer: _TcpPeer, now_us: int) -> None:
        """Read once: a stream may have many frames in one chunk. Raises OSError."""
        if not (peer.octets.take(0, now_us) and peer.reads.take(1, now_us)):
            self._hub.pause(peer.link.fileno(), now_us + PAUSE_US)
            return
        octets = peer.link.recv(_CHUNK)
        if not octets:
            raise OSError("it disconnected")
        peer.octets.charge(len(octets), now_us)
        garbage = peer.frames.counts.garbage
        frames = [upgraded(frame) for frame in peer.frames.feed(octets)]
        peer.counts.garbage += peer.frames.counts.garbage - garbage
        if not frames:
            return
        take_frames(self._hub, peer, frames, now_us)

    def _drop(self, peer: _TcpPeer, why: str) -> None:
        if self._peers.pop(peer.number, None) is None:
            return
        self.doomed.pop(peer, None)
        self._hub.forget(peer.link.fileno())
        peer.link.close()
        self._hub.left(peer, why)


# ---------------------------------------------------------------- one known peer


class _LinePeer(ClientPeer):
    def __init__(self, link: Transport, *rest: Any) -> None:
        super().__init__(*rest)
        self._link = link

    def send(self, datagram: bytes) -> None:
        self._link.send(datagram, None)
        self.counts.sent += len(datagram)


class LineSide:
    """An address with one peer, to which the relay sends from the start: of UDP, of a TCP server, a serial device."""

    def __init__(self, hub: Hub, index: int, setup: ClientSetup, address: Address, now_us: int) -> None:
        self._hub, self.bound = hub, str(address)
        self._reads = _reads(setup)
        self._link = open_transport(address, every=True)
        self._streams = address.way is not LinkCarrier.UDP_OUT
        self._garbage = self._resumed_us = 0
        self._peer = _LinePeer(self._link, hub.number(), index, setup, str(address), now_us)
        hub.joined(self._peer)
        self.tend(now_us)

    def tend(self, now_us: int) -> None:
        self._link.tend(now_us)
        if now_us < self._resumed_us:
            return
        for descriptor in self._link.readable():
            self._hub.watch(descriptor, self._ready)

    def close(self) -> None:
        for descriptor in self._link.readable():
            self._hub.forget(descriptor)
        self._link.close()

    def _ready(self, now_us: int, events: int) -> None:
        peer = self._peer
        for _ in range(1 if self._streams else READS):
            if not self._reads.take(1, now_us):
                self._resumed_us = now_us + PAUSE_US
                for descriptor in self._link.readable():
                    self._hub.pause(descriptor, self._resumed_us)
                return
            received = self._link.receive()
            if received is None:
                return
            if not received[0]:
                continue
            frames, garbage = good_frames(received[0])
            self._note_garbage(garbage)
            if frames:
                take_frames(self._hub, peer, frames, now_us)

    def _note_garbage(self, octets: int) -> None:
        in_stream = self._link.counts.garbage
        self._peer.counts.garbage += octets + in_stream - self._garbage
        self._garbage = in_stream


def take_frames(hub: Hub, peer: ClientPeer, frames: Sequence[bytes], now_us: int) -> None:
    """Pass on the frames of a peer, within its limit."""
    if peer.bucket.take(len(frames), now_us):
        hub.heard(peer, frames, now_us)
    else:
        peer.counts.dropped += len(frames)


def reason(error: OSError) -> str:
    """An error of the system in words."""
    return (error.strerror or str(error)).lower()
