"""The `Vehicle` port over UDP: one socket, one peer, every good frame kept for the raw log."""

import select
import socket
from collections.abc import Callable, Sequence

from rtshcua.adapters.clock import LinkClock
from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.mavlink.framing import unsigned
from rtshcua.onboard.ports import Command, Event

_LARGEST = 65_535
_BUFFER = 4 << 20  # asked for; what the system allows is enough for a moment of being held up
#: One poll takes no more datagrams, and no more time, by its clock or the machine's, than this: a flood must not starve
#: the runtime, and a backlog is worked off in order.
_BATCH = 256
_SLICE_US, _SLICE_S = 50_000, 0.002


class UdpVehicle:
    """Listens where the vehicle sends to (`udpin`), and answers the first sender that proves to be a vehicle.

    Datagrams of other senders are read from then on only to learn whether there is a second vehicle. `keep` gets every
    good frame that came from the vehicle, and every one that was sent, with its UTC time in us: when the next poll
    begins, or at the end, for nothing that is sent is to wait for it.
    Raises OSError where the address cannot be bound.
    """

    def __init__(
        self, address: tuple[str, int], driver: Driver, clock: LinkClock, keep: Callable[[int, bytes], None]
    ) -> None:
        #: what is known of the vehicle
        self.driver = driver
        self._clock = clock
        self._keep = keep
        self._peer: tuple[str, int] | None = None
        self._pending: list[Event] = []
        self._buffer = memoryview(bytearray(_LARGEST))
        self._unkept: list[tuple[int, bytes]] = []
        self._slice_us = max(_SLICE_US, clock.us_in(_SLICE_S))
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(address)
        except OSError:
            self._socket.close()
            raise
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        self._socket.setblocking(False)

    @property
    def port(self) -> int:
        """The port listened at (the system's choice when 0 was asked for)."""
        return int(self._socket.getsockname()[1])

    def poll(self, now_us: int, timeout_us: int) -> Sequence[Event]:
        """Wait at most `timeout_us` of the clock for frames; gives what happened.

        What waits is taken in together. What has to be waited for is acted on as it comes, one datagram at a time.
        """
        self._keep_all()
        events, self._pending = self._pending, []
        links = [self._socket]
        came = bool(select.select(links, [], [], 0)[0])
        if came:  # before the driver is told the time: it must not take for silence that nobody looked
            self._drain(now_us + self._slice_us, events)
            now_us = self._clock.now().monotonic_us
        due, frames = self.driver.tick(now_us)
        self._send(frames)
        events += due
        wait = 0.0 if came or events else max(0.0, self._clock.real_seconds(timeout_us))
        if wait and select.select(links, [], [], wait)[0]:
            self._take(events)
        return events

    def begin(self, command: Command, now_us: int) -> None:
        """Start a manoeuvre."""
        events, frames = self.driver.begin(command, now_us)
        self._send(frames)
        self._pending += events

    def release(self) -> None:
        """Send nothing more that moves the vehicle."""
        self.driver.release()

    def announce(self, severity: int, text: str) -> None:
        """Tell any ground station on the link."""
        self.driver.announce(severity, text)

    def close(self) -> None:
        """Give the port back."""
        self._keep_all()
        self._socket.close()

    def _drain(self, until_us: int, events: list[Event]) -> None:
        for _ in range(_BATCH):
            taken_us = self._take(events)
            if taken_us is None or taken_us > until_us:
                return

    def _take(self, events: list[Event]) -> int | None:
        """Take in a datagram that waits, and give the time; None if there is none."""
        try:
            octets, sender = self._socket.recvfrom_into(self._buffer)
        except BlockingIOError:
            return None
        except ConnectionError:  # an ICMP answer to something we sent: the peer is not there (yet)
            return 0
        datagram = bytes(self._buffer[:octets])
        now = self._clock.now()
        now_us = now.monotonic_us
        if self._peer is not None and sender != self._peer:
            self.driver.overhear(datagram, now_us)
            return now_us
        heard = self.driver.receive(datagram, now_us)
        if self._peer is None:
            if self.driver.flavour is None:
                return now_us
            self._peer = sender
        for frame in heard.frames:
            self._unkept.append((now.utc_us, frame.frame))
            if frame.name == "GLOBAL_POSITION_INT":
                self._clock.heard(frame.message.time_boot_ms * 1_000)
        if heard.answers:
            self._send(heard.answers)
        events += heard.events
        return now_us

    def _send(self, frames: Sequence[bytes]) -> None:
        if self._peer is None or not frames:
            return
        for frame in frames:
            try:
                self._socket.sendto(frame, self._peer)
            except OSError:
                continue  # lost, as any datagram may be: what matters is sent again, and only effects count
        utc_us = self._clock.now().utc_us
        self._unkept += [(utc_us, frame) for frame in frames]

    def _keep_all(self) -> None:
        """Hand over what came and left since the last call, in its order."""
        unkept, self._unkept = self._unkept, []
        for utc_us, frame in unkept:
            self._keep(utc_us, unsigned(frame))
