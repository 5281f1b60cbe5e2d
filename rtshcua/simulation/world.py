"""The whole simulation without I/O: time and datagrams in, datagrams out.

Time always advances in ticks of 20 ms, so that the same configuration and the same datagrams at the same times give
the same bytes.
"""

from collections.abc import Callable, Mapping, Sequence
from heapq import heappop, heappush
from itertools import count
from math import degrees, hypot
from random import Random
from typing import NamedTuple

from rtshcua.codec.frames import ReceivedFrame
from rtshcua.model.faults import Fault, FlightMode
from rtshcua.simulation.answers import Inbox
from rtshcua.simulation.ardupilot.flavour import ArduCopter
from rtshcua.simulation.autopilot import TICK_US, Autopilot, Flavour, Taker
from rtshcua.simulation.camera import Shot
from rtshcua.simulation.config import Answers, AutopilotKind, SimulationConfig
from rtshcua.simulation.face import Face
from rtshcua.simulation.fault_effects import Affected, effects
from rtshcua.simulation.link import FaultyLink
from rtshcua.simulation.payload_components import components_of
from rtshcua.simulation.px4.flavour import Px4

FLAVOURS: Mapping[AutopilotKind, Flavour] = {AutopilotKind.PX4: Px4(), AutopilotKind.ARDUPILOT: ArduCopter()}


class Truth(NamedTuple):
    """The true state of the vehicle, whatever it reports; mm and mm/s from home, battery in 1/10000."""

    north_mm: int
    east_mm: int
    up_mm: int
    speed_mm_s: int
    climb_mm_s: int
    latitude: int
    longitude: int
    armed: bool
    in_air: bool
    mode: FlightMode
    battery: int
    crashed: bool
    """Whether it hit an obstacle or touched down too hard."""
    distance_to_obstacle_mm: int | None
    """Distance to the nearest obstacle; 0 in contact, None without obstacles."""
    wind_north_mm_s: int
    """The velocity of the air, gusts included."""
    wind_east_mm_s: int
    taken_over_us: int | None
    """When a pilot or a failsafe first took over the armed vehicle with effect; None before."""
    taken_over_by: Taker | None
    heading: int
    """Of the nose, 1/100 degree from north."""


class Simulation:
    """A vehicle, the air around it, and its link. Times are microseconds since the start."""

    def __init__(self, config: SimulationConfig) -> None:
        flavour, recorded = FLAVOURS[config.flavour], config.answers is Answers.RECORDED
        self._autopilot = Autopilot(flavour, config)
        self._face = Face(self._autopilot, config.system, config.radio_us)
        self._components = components_of(self._autopilot, config.system)
        self._has_payload = config.camera or config.gimbal
        self._system = config.system
        self._up = FaultyLink(Random(f"{config.seed} uplink"))
        self._down = FaultyLink(Random(f"{config.seed} downlink"))
        self._now_us = self._ticked_us = 0
        self._halted = False
        self._taken_over_us: int | None = None
        self._inbox = Inbox(flavour.lanes, Random(f"{config.seed} answers")) if recorded else None
        self.heard: Callable[[int, bytes], None] | None = None
        """Optional callback for each valid frame that reaches the vehicle, with its time."""
        self.obeyed: Callable[[int, bytes], None] | None = None
        """Optional callback for each frame that the autopilot obeys, with its time."""
        self._events: list[tuple[int, int, Callable[[], object]]] = []
        self._order = count()
        for fault in config.faults:
            self.inject(fault)

    @property
    def now_us(self) -> int:
        """The current time."""
        return self._now_us

    @property
    def next_us(self) -> int | None:
        """When the vehicle handles the next waiting message, and so answers it; None if none waits."""
        return None if self._inbox is None else self._inbox.next_us

    @property
    def damaged(self) -> int:
        """The number of received byte sequences that were not valid frames."""
        return self._face.damaged

    def advance(self, to_us: int) -> list[bytes]:
        """Advance to `to_us`; return the datagrams that arrive at the other end meanwhile, one frame in each."""
        for at_us in range(self._ticked_us + TICK_US, to_us + 1, TICK_US):
            self._tick(at_us)
        if to_us > self._now_us:
            self._now_us = to_us
        if self._inbox is not None and self._inbox.next_us is not None:
            self._obey(self._inbox, self._now_us)
        return self._down.due(self._now_us) if self._down.under_way else []

    def receive(self, data: bytes, at_us: int) -> list[bytes]:
        """Send a datagram to the vehicle at `at_us`; advance until then and return datagrams as `advance` does.

        On a link without delay the vehicle has obeyed when this returns, and its answers are among the datagrams.
        """
        before = self.advance(at_us)
        self._up.send((data,), self._now_us)
        self._deliver(self._now_us)
        if self._inbox is not None:
            self._obey(self._inbox, self._now_us)
        return before + self._down.due(self._now_us)

    def inject(self, fault: Fault) -> None:
        """Add a fault; a fault whose time has passed takes effect at the next tick."""
        on = Affected(self._autopilot, self._up, self._down, self._halt, self._reboot)
        for at_us, effect in effects(fault, on):
            heappush(self._events, (at_us, next(self._order), effect))

    @property
    def shots(self) -> Sequence[Shot]:
        """Every release of the camera's shutter so far, as it truly was."""
        camera = self._autopilot.camera
        return () if camera is None else tuple(camera.shots)

    def truth(self) -> Truth:
        """Return the true state as of the last tick."""
        vehicle = self._autopilot.vehicle
        body = vehicle.body
        surroundings = self._autopilot.surroundings
        distance = surroundings.distance(body) if surroundings.pillars else None
        return Truth(
            round(body.north * 1000),
            round(body.east * 1000),
            round(body.up * 1000),
            round(hypot(body.v_north, body.v_east) * 1000),
            round(body.v_up * 1000),
            *self._autopilot.home.globe(body.north, body.east),
            vehicle.armed,
            vehicle.in_air and not vehicle.lies,
            vehicle.mode,
            round(self._autopilot.battery.level * 10_000),
            vehicle.crashed,
            None if distance is None else round(distance * 1000),
            round(self._autopilot.air.north * 1000),
            round(self._autopilot.air.east * 1000),
            self._taken_over_us,
            self._autopilot.taker,
            round(degrees(body.yaw) * 100) % 36_000,
        )

    def _tick(self, at_us: int) -> None:
        autopilot, face, down, inbox = self._autopilot, self._face, self._down, self._inbox
        if inbox is not None and inbox.next_us is not None:
            self._obey(inbox, at_us - 1)
        self._ticked_us = at_us
        if autopilot.surroundings.moving:
            autopilot.surroundings.step(TICK_US / 1_000_000)
        if self._events:
            self._happen(at_us)
        if self._up.under_way:
            self._deliver(at_us)
        if inbox is not None and inbox.next_us is not None:
            self._obey(inbox, at_us)
        if not self._halted:
            autopilot.tick()
            if autopilot.outbox or autopilot.now_us >= autopilot.streams.next_us:
                down.send(face.due(), at_us)
        self._step_payload(at_us)
        if autopilot.taker is not None and self._taken_over_us is None:
            self._taken_over_us = at_us
        if at_us >= face.radio_due_us:
            down.send((face.radio(at_us),), at_us)
        for voice in autopilot.voices:
            down.send(voice.due(autopilot, self._system, at_us), at_us)

    def _step_payload(self, at_us: int) -> None:
        """Advance the camera and the gimbal. Their frames pass the autopilot, while it runs."""
        if not self._has_payload:
            return
        autopilot = self._autopilot
        autopilot.step_payload(at_us)
        for component in self._components:
            component.due(at_us)
            if not self._halted and not autopilot.off_us:
                self._down.send(component.taken(), at_us)

    def _halt(self, halted: bool) -> None:
        """Halt or resume the autopilot's loop, including its clock."""
        self._halted = halted

    def _reboot(self) -> None:
        self._autopilot.reboot()
        self._face.restart()
        if self._inbox is not None:
            self._inbox.clear()

    def _deliver(self, now_us: int) -> None:
        """Obey arrived frames at once, or queue them in the inbox."""
        if self._halted:
            return
        inbox = self._inbox
        for datagram in self._up.due(now_us):
            for received in self._face.parse(datagram):
                if self.heard is not None:
                    self.heard(now_us, received.frame)
                trusted = self._face.trusts(received)
                if self._components and trusted:
                    self._pass_on(received, now_us)
                if not trusted or not self._face.lets_in(received):
                    continue
                if inbox is None:
                    self._answer(received, now_us)
                else:
                    inbox.put(received, now_us)

    def _pass_on(self, received: ReceivedFrame, now_us: int) -> None:
        """Pass a command to the components behind the autopilot's link."""
        for component in self._components:
            if component.is_named(received):
                if self.obeyed is not None:
                    self.obeyed(now_us, received.frame)
                component.obey(received)
                self._down.send(component.taken(), now_us)

    def _obey(self, inbox: Inbox, until_us: int) -> None:
        """Obey the queued frames that are due by `until_us`."""
        if not self._halted:
            for at_us, received in inbox.due(until_us):
                self._answer(received, max(at_us, self._ticked_us))  # frames that waited during a halt are late

    def _answer(self, received: ReceivedFrame, now_us: int) -> None:
        if self.obeyed is not None:
            self.obeyed(now_us, received.frame)
        self._autopilot.since_us = now_us - self._ticked_us
        self._down.send(self._face.obey(received), now_us)

    def _happen(self, now_us: int) -> None:
        while self._events and self._events[0][0] <= now_us:
            heappop(self._events)[2]()
