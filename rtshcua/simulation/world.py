"""The simulation as a whole, sans I/O: time and datagrams in, datagrams out.

Time moves in ticks of 20 ms, however it is asked to advance, so that the same configuration and the same datagrams at
the same times give the same bytes.
"""

from collections.abc import Callable, Mapping
from heapq import heappop, heappush
from itertools import count
from math import hypot
from random import Random
from typing import NamedTuple

from rtshcua.codec.frames import ReceivedFrame
from rtshcua.model.faults import Fault, FlightMode
from rtshcua.simulation.answers import Inbox
from rtshcua.simulation.ardupilot.flavour import ArduCopter
from rtshcua.simulation.autopilot import TICK_US, Autopilot, Flavour, Taker
from rtshcua.simulation.config import Answers, AutopilotKind, SimulationConfig
from rtshcua.simulation.face import Face
from rtshcua.simulation.fault_effects import Affected, effects
from rtshcua.simulation.link import FaultyLink
from rtshcua.simulation.px4.flavour import Px4

FLAVOURS: Mapping[AutopilotKind, Flavour] = {AutopilotKind.PX4: Px4(), AutopilotKind.ARDUPILOT: ArduCopter()}


class Truth(NamedTuple):
    """Where the vehicle really is and what it does, whatever it reports; mm and mm/s from home, battery in 1/10000."""

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
    """Whether it flew into something, or came down too hard."""
    distance_to_obstacle_mm: int | None
    """How far the nearest thing is that stands around or moves there, through the air; 0 in contact, None for none."""
    wind_north_mm_s: int
    """Where the air goes now, gusts included."""
    wind_east_mm_s: int
    taken_over_us: int | None
    """When a pilot or a failsafe first took over in flight, or while it was armed, so that it obeyed; None before."""
    taken_over_by: Taker | None


class Simulation:
    """A vehicle, the air around it, and the link to it. Times are microseconds since its start."""

    def __init__(self, config: SimulationConfig) -> None:
        flavour, recorded = FLAVOURS[config.flavour], config.answers is Answers.RECORDED
        self._autopilot = Autopilot(flavour, config)
        self._face = Face(self._autopilot, config.system)
        self._system = config.system
        self._up = FaultyLink(Random(f"{config.seed} uplink"))
        self._down = FaultyLink(Random(f"{config.seed} downlink"))
        self._now_us = self._ticked_us = 0
        self._halted = False
        self._taken_over_us: int | None = None
        self._inbox = Inbox(flavour.lanes, Random(f"{config.seed} answers")) if recorded else None
        self.heard: Callable[[int, bytes], None] | None = None
        """Is given each good frame that comes to the vehicle, and when, if somebody wants to know."""
        self.obeyed: Callable[[int, bytes], None] | None = None
        """And this, when the autopilot gets to it."""
        self._events: list[tuple[int, int, Callable[[], object]]] = []
        self._order = count()
        for fault in config.faults:
            self.inject(fault)

    @property
    def now_us(self) -> int:
        """How far time has come."""
        return self._now_us

    @property
    def next_us(self) -> int | None:
        """When the vehicle gets to what it was sent, if that waits for it: the time to advance to for its answer."""
        return None if self._inbox is None else self._inbox.next_us

    @property
    def damaged(self) -> int:
        """How many stretches of bytes the vehicle received that were no good frame."""
        return self._face.damaged

    def advance(self, to_us: int) -> list[bytes]:
        """Lets time pass until `to_us`; the datagrams that arrive at the other end meanwhile, one frame in each."""
        autopilot, face, up, down, inbox = self._autopilot, self._face, self._up, self._down, self._inbox
        surroundings, events = autopilot.surroundings, self._events
        at_us = self._ticked_us + TICK_US
        while at_us <= to_us:
            if inbox is not None and inbox.next_us is not None:
                self._obey(inbox, at_us - 1)
            self._ticked_us = at_us
            if surroundings.moving:
                surroundings.step(TICK_US / 1_000_000)
            if events:
                self._happen(at_us)
            if up.under_way:
                self._deliver(at_us)
            if inbox is not None and inbox.next_us is not None:
                self._obey(inbox, at_us)
            if not self._halted:
                autopilot.tick()
                if autopilot.outbox or autopilot.now_us >= autopilot.streams.next_us:
                    down.send(face.due(), at_us)
            if autopilot.taker is not None and self._taken_over_us is None:
                self._taken_over_us = at_us
            if at_us >= face.radio_due_us:
                down.send((face.radio(at_us),), at_us)
            for voice in autopilot.voices:
                if said := voice.due(autopilot, self._system, at_us):
                    down.send(said, at_us)
            at_us += TICK_US
        now_us = self._now_us
        if to_us > now_us:
            self._now_us = now_us = to_us
        if inbox is not None and inbox.next_us is not None:
            self._obey(inbox, now_us)
        return down.due(now_us) if down.under_way else []

    def receive(self, data: bytes, at_us: int) -> list[bytes]:
        """The other end sends a datagram at `at_us`: lets time pass until then, and gives what `advance` would.

        On a link without delay the vehicle has obeyed when this returns, and its answers are among the datagrams.
        """
        before = self.advance(at_us)
        self._up.send((data,), self._now_us)
        self._deliver(self._now_us)
        if self._inbox is not None:
            self._obey(self._inbox, self._now_us)
        return before + self._down.due(self._now_us)

    def inject(self, fault: Fault) -> None:
        """Adds a fault; one whose time is over happens at the next tick."""
        on = Affected(self._autopilot, self._up, self._down, self._halt, self._reboot)
        for at_us, effect in effects(fault, on):
            heappush(self._events, (at_us, next(self._order), effect))

    def truth(self) -> Truth:
        """What really is, as of the last tick."""
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
        )

    def _halt(self, halted: bool) -> None:
        """The autopilot's loop halts, or goes on: while it does the autopilot stands still, its clock too."""
        self._halted = halted

    def _reboot(self) -> None:
        self._autopilot.reboot()
        self._face.restart()
        if self._inbox is not None:
            self._inbox.clear()

    def _deliver(self, now_us: int) -> None:
        """What has come over the link is obeyed at once, or put where the autopilot gets to it."""
        if self._halted:
            return
        inbox = self._inbox
        for datagram in self._up.due(now_us):
            for received in self._face.parse(datagram):
                if self.heard is not None:
                    self.heard(now_us, received.frame)
                if not self._face.lets_in(received):
                    continue
                if inbox is None:
                    self._answer(received, now_us)
                else:
                    inbox.put(received, now_us)

    def _obey(self, inbox: Inbox, until_us: int) -> None:
        """What the autopilot gets to until then is obeyed."""
        if not self._halted:
            for at_us, received in inbox.due(until_us):
                self._answer(received, max(at_us, self._ticked_us))  # what waited while it was halted comes after

    def _answer(self, received: ReceivedFrame, now_us: int) -> None:
        if self.obeyed is not None:
            self.obeyed(now_us, received.frame)
        self._autopilot.since_us = now_us - self._ticked_us
        self._down.send(self._face.obey(received), now_us)

    def _happen(self, now_us: int) -> None:
        while self._events and self._events[0][0] <= now_us:
            heappop(self._events)[2]()
