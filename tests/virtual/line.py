"""The simulated vehicle at the other end of a real line, in explicit time: a pseudo-terminal or a TCP connection that
carries so many octets a second each way.
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

#: what the vehicle's own port holds until it is sent; a frame that does not fit is not sent, as on an autopilot
UART_OCTETS = 1_024
TICK_US = 20_000


class FarEnd(Protocol):
    """The vehicle's side of a line."""

    def read(self, most: int) -> bytes: ...

    def write(self, octets: bytes) -> int: ...

    def close(self) -> None: ...


class Terminal:
    """A pseudo-terminal; `path` is a link to the end that is opened, so that another one can take its place."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.plug_in()

    def plug_in(self) -> None:
        """A device is there (again)."""
        self.far, self._near = pty.openpty()
        tty.setraw(self._near)
        os.set_blocking(self.far, False)
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(self._near))

    def pull(self) -> None:
        """The device is gone, and its name with it."""
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
    """Virtual time, as a link needs it: nobody waits."""

    def heard(self, boot_us: int) -> None:
        pass

    def real_seconds(self, us: int) -> float:
        return 0.0

    def us_in(self, seconds: float) -> int:
        return 0


class LinedVehicle(VirtualVehicle):
    """A vehicle behind a line that carries `capacity` octets a second; `end` is its side. `sent_octets` is how many it
    sent, `dropped` how many frames did not fit into its port. `free`: whatever is begun counts as permitted.
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
        self._down = self._up = 0  # octets that may go by now

    def poll(self, now_us: int, timeout_us: int) -> Sequence[Event]:
        """Let time pass, at most `timeout_us`; comes back early for anything but readings."""
        end_us, events = self.clock.elapsed_us + timeout_us, list[Event]()
        while True:
            events += self.connected.poll(self.clock.monotonic_us, 0)
            if self.clock.elapsed_us >= end_us or any(type(event) is not Readings for event in events):
                return events
            self.pump(min(end_us, self.clock.elapsed_us + TICK_US))

    def pump(self, until_us: int) -> None:
        """The vehicle lives until then, and its port sends and takes in what the line carries in that time."""
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
