"""The simulated vehicle behind a real line, in explicit time: a pseudo-terminal or a TCP connection with a limited
capacity each way.
"""

import os
import pty
import socket
import tty
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from msgspec.structs import replace

from rtshcua.adapters.vehicle.address import Address
from rtshcua.adapters.vehicle.connected import ConnectedVehicle
from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.adapters.vehicle.transport import open_transport
from rtshcua.codec.stream import FrameStream
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.ports import Command, Event, Readings
from rtshcua.simulation.config import SimulationConfig
from rtshcua.simulation.world import Simulation
from rtshcua.virtual.vehicle import SECOND, START, VirtualClock, VirtualVehicle
from virtual.flight import UTC_US

#: the send buffer of the vehicle's port; a frame that does not fit is dropped, as on an autopilot
UART_OCTETS = 1_024
TICK_US = 20_000


class FarEnd(Protocol):
    """The vehicle's side of a line."""

    def read(self, most: int) -> bytes: ...

    def write(self, octets: bytes) -> int: ...

    def close(self) -> None: ...


class Terminal:
    """A pseudo-terminal; `path` is a symbolic link to it, so that another one can replace it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.plug_in()

    def plug_in(self) -> None:
        """Create the device (again)."""
        self.far, self._near = pty.openpty()
        tty.setraw(self._near)
        os.set_blocking(self.far, False)
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(self._near))

    def pull(self) -> None:
        """Remove the device and its name."""
        self.path.unlink()
        os.close(self.far)
        os.close(self._near)

    def read(self, most: int) -> bytes:
        try:
            return os.read(self.far, most)
        except OSError:
            return b""

    def write(self, octets: bytes) -> int:
        try:
            return os.write(self.far, octets)
        except OSError:
            return 0

    def close(self) -> None:
        with suppress(OSError):
            self.pull()


class Connection:
    """The vehicle's end of a TCP connection."""

    def __init__(self, far: socket.socket) -> None:
        self.far = far
        far.setblocking(False)

    def read(self, most: int) -> bytes:
        try:
            return self.far.recv(most)
        except OSError:
            return b""

    def write(self, octets: bytes) -> int:
        try:
            return self.far.send(octets)
        except OSError:
            return 0

    def close(self) -> None:
        self.far.close()


class LineClock(VirtualClock):
    """Virtual time for a link: waiting returns at once."""

    def heard(self, boot_us: int) -> None:
        pass

    def real_seconds(self, us: int) -> float:
        return 0.0

    def us_in(self, seconds: float) -> int:
        return 0


class LinedVehicle(VirtualVehicle):
    """A vehicle behind a line with `capacity` octets per second; `end` is its side. `sent_octets` counts its octets,
    `dropped` the frames that did not fit into its port. `free`: every command counts as permitted.
    """

    def __init__(
        self, policy: Policy, config: SimulationConfig, address: Address, end: FarEnd | None, capacity: int,
        steps: Sequence[Invocation] = (), *, free: bool = True,
    ) -> None:  # fmt: skip
        self.simulation = Simulation(config)
        self.clock = LineClock(Now(START.monotonic_us, UTC_US, START.utc_error_us))
        self.frames = FrameSession()
        self._free = free
        self._far_frames = FrameStream()
        self.driver = Driver(policy, self.frames, steps=steps)
        self.transport = open_transport(address)
        self.connected = ConnectedVehicle(self.transport, self.driver, self.clock, lambda _utc_us, _frame: None)
        self.end = end
        self.capacity = capacity
        self.sent_octets = self.dropped = 0
        self._out = b""
        self._down = self._up = 0  # octets that may be sent by now

    def poll(self, now_us: int, timeout_us: int) -> Sequence[Event]:
        """Advance by at most `timeout_us`; return early for any event except readings."""
        end_us, events = self.clock.elapsed_us + timeout_us, list[Event]()
        while True:
            events += self.connected.poll(self.clock.monotonic_us, 0)
            if self.clock.elapsed_us >= end_us or any(type(event) is not Readings for event in events):
                return events
            self.pump(min(end_us, self.clock.elapsed_us + TICK_US))

    def pump(self, until_us: int) -> None:
        """Advance the vehicle, and move octets as far as the line's capacity allows."""
        passed_us, self.clock.elapsed_us = until_us - self.clock.elapsed_us, until_us
        for datagram in self.simulation.advance(until_us):
            self._say(datagram)
        if self.end is None:
            return
        room = self.capacity * passed_us
        self._up = min(self._up + room, self.capacity * 100_000)
        octets = self.end.read(self._up // SECOND)
        self._up -= len(octets) * SECOND
        for frame in self._far_frames.feed(octets):
            for answer in self.simulation.receive(frame, until_us):
                self._say(answer)
        self._down = min(self._down + room, self.capacity * 100_000)
        gone = self.end.write(self._out[: self._down // SECOND])
        self._down -= gone * SECOND
        self.sent_octets += gone
        self._out = self._out[gone:]

    def _say(self, datagram: bytes) -> None:
        if len(self._out) + len(datagram) > UART_OCTETS:
            self.dropped += 1
        else:
            self._out += datagram

    def begin(self, command: Command, now_us: int) -> None:
        """Start a command."""
        if self._free:
            self.frames.open(replace(command, not_after_us=now_us + 10 * SECOND))
        self.connected.begin(command, now_us)

    def close(self) -> None:
        """End the line, both ends."""
        self.connected.close()
        if self.end is not None:
            self.end.close()
