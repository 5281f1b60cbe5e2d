"""The `Vehicle` and `Clock` ports in virtual time: the simulated vehicle behind the real driver, in one process."""

from collections.abc import Callable, Iterable, Mapping, Sequence

from msgspec.structs import replace

from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.adapters.vehicle.flavour import Stages
from rtshcua.mavlink.signing import FrameVerifier
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.enforcement.isolated import IsolatedGate
from rtshcua.onboard.ports import Command, Event, Readings
from rtshcua.simulation.config import SimulationConfig
from rtshcua.simulation.world import Simulation

#: the simulation's own tick
TICK_US = 20_000
SECOND = 1_000_000
#: datagrams that a socket buffers by default on Linux (`net.core.rmem_max`); later ones are lost
MOST_WAITING = 500
#: how many of them one poll reads
AT_ONCE = 256
#: the initial time: a monotonic time that is not 0, and a UTC time
START = Now(7_000_000, 1_767_225_600_000_000, 1_000)


class VirtualClock:
    """A clock that only advances when `elapsed_us`, the time since `start`, is set."""

    def __init__(self, start: Now = START) -> None:
        self.elapsed_us = 0
        self.start_us = start.monotonic_us
        """The monotonic time at the start."""
        self._start = start

    @property
    def monotonic_us(self) -> int:
        """The monotonic time."""
        return self.start_us + self.elapsed_us

    def now(self) -> Now:
        """Return the current time."""
        start = self._start
        return Now(start.monotonic_us + self.elapsed_us, start.utc_us + self.elapsed_us, start.utc_error_us)


class VirtualVehicle:
    """Steps the simulation tick by tick; method calls replace datagrams.

    `received` and `sent` count frames. `lose` decides whether a frame to the vehicle is lost; `hurt`, if set, returns
    the datagrams that replace one from the vehicle. Without the `frames` of an executor every command counts as
    permitted. `verifier`, `fence`, `manoeuvres` and `steps` are the driver's. Frames are read every `tick_us`.
    """

    def __init__(
        self, policy: Policy, config: SimulationConfig, clock: VirtualClock | None = None,
        frames: FrameSession | IsolatedGate | None = None, verifier: FrameVerifier | None = None, *, fence: bool = True,
        manoeuvres: Mapping[str, Stages] | None = None, tick_us: int = TICK_US, steps: Sequence[Invocation] = (),
    ) -> None:  # fmt: skip
        self.simulation = Simulation(config)
        self.frames: FrameSession | IsolatedGate = FrameSession() if frames is None else frames
        self._free = frames is None
        self._tick_us = tick_us
        self.driver = Driver(policy, self.frames, fence=fence, verifier=verifier, manoeuvres=manoeuvres, steps=steps)
        self.clock = clock or VirtualClock()
        self.received = self.sent = 0
        self.lose: Callable[[bytes], bool] = lambda frame: False
        self.hurt: Callable[[bytes], Sequence[bytes]] | None = None
        self._pending: list[Event] = []
        self._waiting: list[bytes] = []

    def stand_still(self, for_us: int) -> None:
        """Advance without reading: datagrams wait in the buffer for the next poll."""
        self.clock.elapsed_us += for_us
        self._waiting += self.simulation.advance(self.clock.elapsed_us)
        del self._waiting[MOST_WAITING:]

    def poll(self, now_us: int, timeout_us: int) -> Sequence[Event]:
        """Advance by at most `timeout_us`; return early for any event except readings."""
        events, self._pending = self._pending, []
        if self._waiting:
            waiting, self._waiting = self._waiting[:AT_ONCE], self._waiting[AT_ONCE:]
            self._take(waiting, events)
            if self._waiting:
                return events
        clock, driver, advance, tick_us = self.clock, self.driver, self.simulation.advance, self._tick_us
        start_us, elapsed_us = clock.start_us, clock.elapsed_us
        end_us = elapsed_us + timeout_us
        looked_at = 0
        while True:
            happened, frames = driver.tick(start_us + elapsed_us)
            events += happened
            if frames:
                self._send(frames, events)
            if elapsed_us >= end_us:
                return events
            while looked_at < len(events):
                if type(events[looked_at]) is not Readings:
                    return events
                looked_at += 1
            elapsed_us += tick_us
            if elapsed_us > end_us:
                elapsed_us = end_us
            clock.elapsed_us = elapsed_us
            datagrams = advance(elapsed_us)
            if datagrams:
                self._take(datagrams, events)

    def begin(self, command: Command, now_us: int) -> None:
        """Start a command."""
        if isinstance(self.frames, FrameSession) and self._free:
            self.frames.open(replace(command, not_after_us=now_us + 10 * SECOND))
        events, frames = self.driver.begin(command, now_us)
        self._send(frames, events)
        self._pending += events

    def release(self) -> None:
        """Release the vehicle: send no more frames for a command."""
        self.driver.release()

    def announce(self, severity: int, text: str) -> None:
        """Send a STATUSTEXT."""
        self.driver.announce(severity, text)

    def expect(self, steps: Sequence[Invocation]) -> None:
        """Request reports at the rates that these steps need."""
        self.driver.expect(steps)

    def _send(self, frames: Sequence[bytes], events: list[Event]) -> None:
        for frame in frames:
            self.sent += 1
            if self.lose(frame):
                continue
            answers = self.simulation.receive(frame, self.clock.elapsed_us)
            if self._waiting:  # new datagrams queue after the waiting ones
                self._waiting = (self._waiting + answers)[:MOST_WAITING]
            else:
                self._take(answers, events)

    def _take(self, datagrams: Iterable[bytes], events: list[Event]) -> None:
        now_us, hurt, receive = self.clock.monotonic_us, self.hurt, self.driver.receive
        if hurt is not None:
            datagrams = (datagram for original in datagrams for datagram in hurt(original))
        for datagram in datagrams:
            came, answers, frames = receive(datagram, now_us)
            self.received += len(frames)
            events += came
            if answers:
                self._send(answers, events)
