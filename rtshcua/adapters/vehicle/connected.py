"""The `Vehicle` port over a transport: one peer, and every valid frame kept for the raw log."""

import select
from collections.abc import Callable, Hashable, Sequence

from rtshcua.adapters.clock import LinkClock
from rtshcua.adapters.vehicle.driver import HEARTBEAT_US, Driver
from rtshcua.adapters.vehicle.transport import Transport
from rtshcua.codec.stream import FrameStream, StreamCounts
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.mission import Invocation
from rtshcua.onboard.ports import Command, Event, Noted

#: The limits of one poll, in datagrams and in time (by its clock or the machine's): a flood must not starve the
#: runtime, and a backlog is processed in order.
_BATCH = 256
_SLICE_US, _SLICE_S = 50_000, 0.002


class ConnectedVehicle:
    """Receives from the other end of a transport, and replies to the first sender that proves to be a vehicle. Other
    senders are read from then on only to detect a second vehicle. Where the vehicle's line or connection is lost, the
    next one that it sends over replaces it.

    `keep` gets every valid frame from the vehicle and every frame sent to it, with its UTC time in us, when the next
    poll begins or at the end, so that no frame waits for it.
    """

    def __init__(
        self, transport: Transport, driver: Driver, clock: LinkClock, keep: Callable[[int, bytes], None]
    ) -> None:
        #: the driver of the vehicle
        self.driver = driver
        self._transport = transport
        self._clock = clock
        self._keep = keep
        self._peer: Hashable | None = None
        self._pending: list[Event] = []
        self._unkept: list[tuple[int, bytes]] = []
        self._slice_us = max(_SLICE_US, clock.us_in(_SLICE_S))
        self._greeted_us: int | None = None
        self._looked_us = 0
        self._seen = StreamCounts()  # counts of datagrams, until a vehicle is known
        driver.carried_by(transport.capacity)

    @property
    def silence(self) -> str | None:
        """Why no vehicle is heard, judging by the received octets; None if there are none and no fault is known."""
        counts = self._seen if self._seen.octets else self._transport.counts
        if counts.frames:
            return None
        if not counts.octets:
            return self._transport.trouble
        if counts.old:
            return (
                f"{counts.old} frames of MAVLink 1 arrived, but this program uses MAVLink 2: set `MAV_PROTO_VER` to 2 "
                "(PX4) or the port's `SERIALn_PROTOCOL` to 2 (ArduPilot)"
            )
        if self._transport.capacity is None:
            return f"{counts.octets} octets arrived, but no MAVLink frame: another kind of program sends there"
        return (
            f"{counts.octets} octets arrived, but no MAVLink frame: the baud rate is probably wrong, or another kind "
            "of device is on this port"
        )

    def poll(self, now_us: int, timeout_us: int) -> Sequence[Event]:
        """Wait at most `timeout_us` of the clock for frames; return the events.

        Frames that wait are processed together; frames that were waited for are processed as they come, one datagram at
        a time. Timed actions are checked as often as without any frame, but frames are processed first.
        """
        self._keep_all()
        events, self._pending = self._pending, []
        transport = self._transport
        events += [Noted(now_us, text) for text in transport.tend(now_us)]
        if self._peer is not None and not transport.is_open(self._peer):
            self._peer = None
        if transport.begins and self._peer is None:
            self._greet(now_us, None)
        links = transport.readable()
        came = bool(select.select(links, [], [], 0)[0])
        if came:  # before the driver gets the time: it must not mistake unread frames for silence
            self._drain(now_us + self._slice_us, events)
            now_us = self._clock.now().monotonic_us
        if not came or now_us - self._looked_us >= timeout_us:
            self._looked_us = now_us
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

    def pass_on(self, frame: bytes) -> Refusal | None:
        """Send the request of a gateway's client, or say why it must not leave."""
        sealed = self.driver.pass_on(frame, self._clock.now().monotonic_us)
        if isinstance(sealed, Refusal):
            return sealed
        self._send([sealed])
        return None

    def announce(self, severity: int, text: str) -> None:
        """Send a text to every ground station on the link."""
        self.driver.announce(severity, text)

    def expect(self, steps: Sequence[Invocation]) -> None:
        """Request reports as often as these steps need them."""
        self.driver.expect(steps)

    def close(self) -> None:
        """Close the port."""
        self._keep_all()
        self._transport.close()

    def _drain(self, until_us: int, events: list[Event]) -> None:
        for _ in range(_BATCH):
            taken_us = self._take(events)
            if taken_us is None or taken_us > until_us:
                return

    def _take(self, events: list[Event]) -> int | None:
        """Process the waiting frames of one sender and return the time; None if there are none."""
        received = self._transport.receive()
        if received is None:
            return None
        datagram, sender = received
        if not datagram:
            return 0
        now = self._clock.now()
        now_us = now.monotonic_us
        if self._peer is not None and sender != self._peer:
            self.driver.overhear(datagram, now_us)
            return now_us
        outdated = self.driver.link.outdated
        heard = self.driver.receive(datagram, now_us)
        if self._peer is None:
            if self.driver.link.outdated > outdated:
                self._greet(now_us, sender)  # the time stamp of our heartbeat sets its clock; a replay gains nothing
            if self.driver.flavour is None:
                for question in heard.answers:  # not kept: it is addressed to nobody yet
                    self._transport.send(question, sender)
                self._look(datagram)
                return now_us
            if not any(frame.system == self.driver.system for frame in heard.frames):
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
        """Send frames and keep them, including those that reach nobody any more, because they passed the gate."""
        if not frames:
            return
        for frame in frames if self._peer is not None else ():
            self._transport.send(frame, self._peer)
        utc_us = self._clock.now().utc_us
        self._unkept += [(utc_us, frame) for frame in frames]

    def _greet(self, now_us: int, to: Hashable | None) -> None:
        """Send our heartbeat before a vehicle is known, at most once a second. It is not kept: it is addressed to
        nobody yet.
        """
        if self._greeted_us is not None and now_us - self._greeted_us < HEARTBEAT_US:
            return
        self._greeted_us = now_us
        for frame in self.driver.link.greet(now_us):
            self._transport.send(frame, to)

    def _look(self, datagram: bytes) -> None:
        """Count the contents of a datagram from no known vehicle."""
        stream, seen = FrameStream(), self._seen
        stream.feed(datagram)
        self._seen = StreamCounts(*map(sum, zip(seen, stream.counts, strict=True)))

    def _keep_all(self) -> None:
        """Hand over the frames since the last call, in their order."""
        unkept, self._unkept = self._unkept, []
        for utc_us, frame in unkept:
            self._keep(utc_us, frame)
