"""The relay: frames of the vehicle to FLIGHT, then to the clients, then a lossy copy to the starter. The vehicle gets
only what FLIGHT and pilots send.

One thread waits for all descriptors. In each turn the vehicle comes first, and again after each client; what a client
can cost in a turn is bounded (`clients.py`).
"""

import select
import socket
from collections import deque
from collections.abc import Callable, Hashable, Sequence
from contextlib import suppress
from time import monotonic_ns
from typing import Final

import msgspec

from rtshcua.adapters.gateway.clients import ClientPeer, ClientSide, open_side, reason
from rtshcua.adapters.gateway.frames import asks_for_control, numbers_in, parcels, without
from rtshcua.adapters.gateway.messages import (
    DIALOGUES,
    EVERY_CLIENT,
    LARGEST,
    Counters,
    RelayKind,
    RelayMessage,
    RelaySetup,
    SetupFailure,
    Up,
    decoded,
    encoded,
)
from rtshcua.adapters.vehicle.address import AddressError, LinkCarrier, parse
from rtshcua.adapters.vehicle.transport import open_transport
from rtshcua.codec.stream import FrameStream
from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1

S: Final = 1_000_000
#: the most datagrams of the vehicle in one turn; they are sent on together
_BATCH: Final = 64
#: the most datagrams of FLIGHT, and messages of the starter, in one turn
_TURN: Final = 16
#: how often links are tended, and counters told, in us
_TEND_US: Final = 50_000
_TELL_US: Final = S
#: the most events that wait for a starter that does not read; then nobody is admitted
_MOST_EVENTS: Final = 1_024
#: the send buffers of FLIGHT's socket, of the control socket and of the telemetry socket, in octets as the system
#: counts them (about 800 a small datagram)
_FLIGHT_BUFFER: Final = 4 << 20
_CONTROL_BUFFER: Final = 1 << 20
_TELEMETRY_BUFFER: Final = 1 << 18
_NUMBERS: Final = range(1, EVERY_CLIENT)


class SetupError(Exception):
    """The relay cannot begin."""

    def __init__(self, failure: SetupFailure) -> None:
        super().__init__(failure.text)
        self.failure = failure


class Relay:
    """All links, once they are open. Raises SetupError where one cannot be opened."""

    def __init__(self, setup: RelaySetup, control: socket.socket, telemetry: socket.socket) -> None:
        self._poll = select.epoll()
        self._ready: dict[int, Callable[[int, int], None]] = {}
        self._events: dict[int, int] = {}
        self._paused: dict[int, int] = {}
        self._counters = Counters()
        self._peers: dict[int, ClientPeer] = {}
        self._ordinary: list[ClientPeer] = []
        self._pilots: list[ClientPeer] = []
        self._numbered = 0
        self._pending: deque[bytes] = deque()
        self._ended = False
        self._silence_us = setup.silence_s * S
        self._flight: socket.socket | None = None
        self._control = _sized(control, _CONTROL_BUFFER)
        self._telemetry = _sized(telemetry, _TELEMETRY_BUFFER)
        self.watch(self._control.fileno(), self._from_starter)
        self._open_vehicle(setup)
        self._sides = [self._opened(index, setup) for index in range(len(setup.clients))]
        self._tell(RelayKind.READY, 0, msgspec.json.encode([side.bound for side in self._sides]))

    def run(self) -> None:
        """Pass frames on until the starter ends."""
        tended_us = told_us = 0
        poll, watched = self._poll.poll, self._ready
        while not self._ended:
            ready = poll(_TEND_US / S if not self._paused else min(_TEND_US, 10_000) / S)
            now_us = monotonic_ns() // 1_000
            for descriptor, events in ready:
                if descriptor in self._vehicle_at:
                    self._from_vehicle(now_us, events)
            for descriptor, events in ready:
                if descriptor not in self._vehicle_at and descriptor in watched:
                    watched[descriptor](now_us, events)
                    if len(ready) > 1:
                        self._from_vehicle(now_us, 0)
            if self._paused:
                self._resume(now_us)
            if now_us - tended_us >= _TEND_US:
                tended_us = now_us
                self._tend(now_us)
            if now_us - told_us >= _TELL_US:
                told_us = now_us
                self._tell_counters()

    def close(self) -> None:
        """Close all links."""
        for side in self._sides:
            side.close()
        self._vehicle.close()
        for each in (self._control, self._telemetry, self._flight):
            if each is not None:
                each.close()
        self._poll.close()

    # ---------------------------------------------------------------- what the clients' sides call

    def watch(self, descriptor: int, ready: Callable[[int, int], None], events: int = select.EPOLLIN) -> None:
        self._ready[descriptor], self._events[descriptor] = ready, events
        self._paused.pop(descriptor, None)
        try:
            self._poll.register(descriptor, events)
        except FileExistsError:
            self._poll.modify(descriptor, events)

    def forget(self, descriptor: int) -> None:
        self._ready.pop(descriptor, None)
        self._events.pop(descriptor, None)
        self._paused.pop(descriptor, None)
        with suppress(OSError):
            self._poll.unregister(descriptor)

    def pause(self, descriptor: int, until_us: int) -> None:
        self._paused[descriptor] = until_us
        with suppress(OSError):
            self._poll.unregister(descriptor)

    def number(self) -> int:
        while True:
            self._numbered = self._numbered % _NUMBERS[-1] + 1
            if self._numbered not in self._peers:
                return self._numbered

    def joined(self, peer: ClientPeer) -> None:
        self._peers[peer.number] = peer
        (self._pilots if peer.setup.pilot else self._ordinary).append(peer)

    def left(self, peer: ClientPeer, why: str) -> None:
        del self._peers[peer.number]
        (self._pilots if peer.setup.pilot else self._ordinary).remove(peer)
        if peer.up:
            self._tell(RelayKind.DOWN, peer.number, why.encode(), event=True)

    def heard(self, peer: ClientPeer, frames: Sequence[bytes], now_us: int) -> None:
        peer.heard_us = now_us
        if not peer.up:
            if len(self._pending) >= _MOST_EVENTS:
                return  # the starter would not know whose frames these are
            peer.up = True
            self._tell(RelayKind.UP, peer.number, msgspec.json.encode(Up(peer.index, peer.where)), event=True)
        peer.counts.frames += len(frames)
        datagram = frames[0] if len(frames) == 1 else b"".join(frames)
        if peer.setup.pilot:
            passed = [each for each in frames if not asks_for_control(each, self._system)]
            if passed:
                self._to_vehicle(datagram if len(passed) == len(frames) else b"".join(passed))
            self._tell(RelayKind.PILOT, peer.number, datagram)
        else:
            self._tell(RelayKind.CLIENT, peer.number, datagram)

    def turned_away(self) -> None:
        self._counters.turned_away += 1

    # ---------------------------------------------------------------- the vehicle

    def _open_vehicle(self, setup: RelaySetup) -> None:
        self._stream = FrameStream(every=True)
        self._place: Hashable = None
        self._heard_us = 0
        self._system = 0  # of the vehicle, once the starter has said it
        self._autopilot = 0, MAV_COMP_ID_AUTOPILOT1
        self._vehicle_at: set[int] = set()
        try:
            address = parse(setup.vehicle)
            self._vehicle = open_transport(address, every=True)
        except AddressError as error:
            raise SetupError(SetupFailure(None, error.text, error.help)) from None
        except OSError as error:
            raise SetupError(_unopened(None, setup.vehicle, error)) from None
        self._tend_vehicle(0)

    def _tend_vehicle(self, now_us: int) -> None:
        self._vehicle.tend(now_us)
        self._vehicle_at = set(self._vehicle.readable())
        for descriptor in self._vehicle_at:
            with suppress(FileExistsError):  # a line that is open again may have the same descriptor
                self._poll.register(descriptor, select.EPOLLIN)

    def _from_vehicle(self, now_us: int, events: int) -> None:
        """Pass on all frames that wait, at most `_BATCH` datagrams."""
        receive = self._vehicle.receive
        batch: list[bytes] = []
        numbers: list[int] = []
        for _ in range(_BATCH):
            received = receive()
            if received is None:
                break
            octets, sender = received
            if not octets or not (sender == self._place or self._takes_place(octets, sender, now_us)):
                continue
            self._counters.vehicle += 1
            self._counters.vehicle_octets += len(octets)
            found = numbers_in(octets)
            if found is None or self._stream.pending:  # a bridge that cuts a stream into datagrams
                octets = b"".join(self._stream.feed(octets))
                found = numbers_in(octets)
                if found is None:
                    continue
            batch.append(octets)
            numbers += found
        if batch:
            self._heard_us = now_us
            self._pass_on(batch, numbers)

    def _takes_place(self, octets: bytes, sender: Hashable, now_us: int) -> bool:
        """Whether this sender is the vehicle from now on: nobody was, or that one is silent or gone."""
        silent = now_us - self._heard_us >= self._silence_us
        free = self._place is None or silent or not self._vehicle.is_open(self._place)
        if free and FrameStream(every=True).feed(octets):  # a bridge may have cut the frames around it
            self._place = sender
            self._stream = FrameStream(every=True)
            return True
        self._counters.strangers += 1
        return False

    def _pass_on(self, batch: list[bytes], numbers: list[int]) -> None:
        every = parcels(batch)
        if self._flight is not None:
            for datagram in every:
                self._to_flight(datagram)
        for pilot in self._pilots:
            for datagram in every:
                pilot.send(datagram)
        theirs = every if DIALOGUES.isdisjoint(numbers) else parcels(_without(batch, DIALOGUES))
        # clients hear a vehicle as soon as their commands for it are decided: some give up at the first refusal
        for peer in self._ordinary if self._system else ():
            gets_all = peer.withheld.isdisjoint(numbers)  # else less of the autopilot; others have the same messages
            for datagram in theirs if gets_all else _without(theirs, peer.withheld, self._autopilot):
                peer.send(datagram)
        for datagram in every:
            try:
                self._telemetry.send(datagram)
            except OSError:
                self._counters.telemetry_lost += 1

    def _to_vehicle(self, frames: bytes) -> None:
        """Lost while nobody was heard at an address that others send to."""
        if self._place is not None or self._vehicle.begins:
            self._vehicle.send(frames, self._place)

    # ---------------------------------------------------------------- FLIGHT

    def _to_flight(self, datagram: bytes) -> None:
        if self._flight is None:
            return
        try:
            self._flight.send(datagram)
        except BlockingIOError:
            self._counters.flight_lost += 1
        except OSError:
            self._end_flight()

    def _from_flight(self, now_us: int, events: int) -> None:
        for _ in range(_TURN):
            if self._flight is None:
                return
            try:
                frames = self._flight.recv(LARGEST)
            except BlockingIOError:
                return
            except OSError:
                frames = b""
            if not frames:
                self._end_flight()
                return
            self._to_vehicle(frames)

    def _end_flight(self) -> None:
        if self._flight is not None:
            self.forget(self._flight.fileno())
            self._flight.close()
            self._flight = None
            self._tell(RelayKind.FLIGHT_ENDED, 0, b"", event=True)

    def _begin_flight(self, descriptor: int) -> None:
        self._end_flight()
        self._flight = _sized(socket.socket(fileno=descriptor), _FLIGHT_BUFFER)
        self.watch(descriptor, self._from_flight)

    # ---------------------------------------------------------------- the starter

    def _from_starter(self, now_us: int, events: int) -> None:
        for _ in range(_TURN):
            try:
                datagram, descriptors, _, _ = socket.recv_fds(self._control, LARGEST, 1)
            except BlockingIOError:
                return
            except OSError:
                datagram, descriptors = b"", []
            if not datagram:
                self._ended = True
                return
            self._obey(decoded(datagram), descriptors)

    def _obey(self, message: RelayMessage, descriptors: Sequence[int]) -> None:
        kind, client, payload = message
        if kind is RelayKind.ANSWER:
            self._answer(client, payload)
        elif kind is RelayKind.WITHHOLD and client in self._peers:
            numbers = (payload[start : start + 3] for start in range(1, len(payload), 3))
            self._peers[client].withheld = frozenset(int.from_bytes(each, "little") for each in numbers)
            self._autopilot = payload[0], MAV_COMP_ID_AUTOPILOT1
        elif kind is RelayKind.VEHICLE:
            self._system = payload[0]
        elif kind is RelayKind.FLIGHT and descriptors:
            self._begin_flight(descriptors[0])

    def _answer(self, client: int, frames: bytes) -> None:
        if client == EVERY_CLIENT:
            for peer in self._ordinary:
                peer.send(frames)
        elif client in self._peers:
            self._peers[client].send(frames)

    def _tell(self, kind: RelayKind, client: int, payload: bytes, *, event: bool = False) -> None:
        """Send a message to the starter. An event waits if it cannot be sent; anything else is lost, as is what would
        overtake an event.
        """
        message = encoded(kind, client, payload)
        if event:
            self._pending.append(message)
        self._tell_pending()
        if not event:
            try:
                if self._pending:
                    raise BlockingIOError
                self._control.send(message)
            except OSError:
                self._counters.control_lost += 1

    def _tell_pending(self) -> None:
        with suppress(OSError):
            while self._pending:
                self._control.send(self._pending[0])
                self._pending.popleft()

    def _tell_counters(self) -> None:
        counters = self._counters
        counters.garbage, counters.trouble = self._vehicle.counts.garbage, self._vehicle.trouble
        counters.garbage += self._stream.counts.garbage
        counters.clients = tuple(peer.counts for peer in self._peers.values() if peer.up)
        self._tell(RelayKind.COUNTERS, 0, msgspec.json.encode(counters))

    # ---------------------------------------------------------------- from time to time

    def _tend(self, now_us: int) -> None:
        self._tend_vehicle(now_us)
        for side in self._sides:
            side.tend(now_us)
        self._tell_pending()

    def _resume(self, now_us: int) -> None:
        for descriptor, until_us in list(self._paused.items()):
            if now_us >= until_us:
                self.watch(descriptor, self._ready[descriptor], self._events[descriptor])

    def _opened(self, index: int, setup: RelaySetup) -> ClientSide:
        client = setup.clients[index]
        try:
            return open_side(self, index, client, parse(client.address), monotonic_ns() // 1_000)
        except AddressError as error:
            raise SetupError(SetupFailure(index, error.text, error.help)) from None
        except OSError as error:
            raise SetupError(_unopened(index, client.address, error)) from None


def _sized(link: socket.socket, buffer: int) -> socket.socket:
    link.setblocking(False)
    link.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, buffer)
    return link


def _without(datagrams: Sequence[bytes], numbers: frozenset[int], sender: tuple[int, int] | None = None) -> list[bytes]:
    """Datagrams without the frames of these messages, and without those that are then empty."""
    return [kept for datagram in datagrams if (kept := without(datagram, numbers, sender))]


def _unopened(client: int | None, address: str, error: OSError) -> SetupFailure:
    whose = "the vehicle's" if client is None else "the client's"
    help = "another program has it open: end that one, or choose another address"
    if address.startswith(LinkCarrier.SERIAL):
        help = f"{help}; the device must be there, and this user must be allowed to open it"
    return SetupFailure(client, f"{whose} address `{address}` cannot be opened: {reason(error)}", help)
