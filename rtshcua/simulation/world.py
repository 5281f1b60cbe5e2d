"""The simulation as a whole, sans I/O: time and datagrams in, datagrams out.

Time moves in ticks of 20 ms, however it is asked to advance, so that the same configuration and the same datagrams at
the same times give the same bytes.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from heapq import heappop, heappush
from itertools import count
from math import hypot
from random import Random

from rtshcua.simulation.autopilot import TICK_US, Autopilot
from rtshcua.simulation.config import SimulationConfig
from rtshcua.simulation.face import Face
from rtshcua.simulation.faults import (
    BatteryLevel,
    Fault,
    GpsJump,
    GpsLoss,
    LinkDelay,
    LinkLoss,
    LinkQuality,
    LinkSilence,
    Obstacle,
    PilotMode,
    WindStep,
)
from rtshcua.simulation.flavours import FLAVOURS
from rtshcua.simulation.link import Link
from rtshcua.simulation.modes import Mode
from rtshcua.simulation.wind import Wind


@dataclass(frozen=True, slots=True)
class Truth:
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
    mode: Mode
    battery: int


class Simulation:
    """A vehicle, the air around it, and the link to it. Times are microseconds since its start."""

    def __init__(self, config: SimulationConfig) -> None:
        self._autopilot = Autopilot(FLAVOURS[config.flavour], config)
        self._face = Face(self._autopilot, config.system)
        self._up = Link(Random(f"{config.seed} uplink"))
        self._down = Link(Random(f"{config.seed} downlink"))
        self._now_us = 0
        self._events: list[tuple[int, int, Callable[[], None]]] = []
        self._order = count()
        for fault in config.faults:
            self.inject(fault)

    @property
    def now_us(self) -> int:
        """How far time has come."""
        return self._now_us

    @property
    def damaged(self) -> int:
        """How many stretches of bytes the vehicle received that were no good frame."""
        return self._face.damaged

    def advance(self, to_us: int) -> list[bytes]:
        """Lets time pass until `to_us`; the datagrams that arrive at the other end meanwhile, one frame in each."""
        autopilot = self._autopilot
        while autopilot.now_us + TICK_US <= to_us:
            at_us = autopilot.now_us + TICK_US
            self._happen(at_us)
            self._deliver(at_us)
            autopilot.tick()
            for frame in self._face.due():
                self._down.send(frame, at_us)
        self._now_us = max(self._now_us, to_us)
        return self._down.due(self._now_us)

    def receive(self, data: bytes, at_us: int) -> list[bytes]:
        """The other end sends a datagram at `at_us`: lets time pass until then, and gives what `advance` would.

        On a link without delay the vehicle has obeyed when this returns, and its answers are among the datagrams.
        """
        before = self.advance(at_us)
        self._up.send(data, self._now_us)
        self._deliver(self._now_us)
        return before + self._down.due(self._now_us)

    def inject(self, fault: Fault) -> None:
        """Adds a fault; one whose time is over happens at the next tick."""
        for at_us, effect in self._effects(fault):
            heappush(self._events, (at_us, next(self._order), effect))

    def truth(self) -> Truth:
        """What really is, as of the last tick."""
        vehicle = self._autopilot.vehicle
        body = vehicle.body
        return Truth(
            round(body.north * 1000),
            round(body.east * 1000),
            round(body.up * 1000),
            round(hypot(body.v_north, body.v_east) * 1000),
            round(body.v_up * 1000),
            *self._autopilot.home.globe(body.north, body.east),
            vehicle.armed,
            vehicle.in_air,
            vehicle.mode,
            round(self._autopilot.battery.level * 10_000),
        )

    def _deliver(self, now_us: int) -> None:
        for datagram in self._up.due(now_us):
            for frame in self._face.handle(datagram):
                self._down.send(frame, now_us)

    def _happen(self, now_us: int) -> None:
        while self._events and self._events[0][0] <= now_us:
            heappop(self._events)[2]()

    def _effects(self, fault: Fault) -> Iterator[tuple[int, Callable[[], None]]]:
        """When a fault begins, and ends if it does, and what happens then."""
        a = self._autopilot
        match fault:
            case BatteryLevel(at_us, level):
                yield at_us, partial(a.battery.cap, level / 10_000)
            case GpsLoss(at_us, for_us):
                yield at_us, a.sensors.lose_fix
                if for_us is not None:
                    yield at_us + for_us, a.sensors.find_fix
            case GpsJump(at_us, north_mm, east_mm):
                yield at_us, partial(a.sensors.jump, north_mm / 1000, east_mm / 1000)
            case WindStep(at_us, speed_mm_s, from_deg, gust_mm_s):
                yield at_us, partial(a.air.set, Wind(speed_mm_s, from_deg, gust_mm_s))
            case LinkDelay(at_us, delay_us):
                yield at_us, partial(self._link, delay_us=delay_us)
            case LinkLoss(at_us, loss):
                yield at_us, partial(self._link, loss=loss, quality=10_000 - loss)
            case LinkSilence(at_us, for_us):
                yield at_us, partial(self._link, silent=True)
                if for_us is not None:
                    yield at_us + for_us, partial(self._link, silent=False)
            case LinkQuality(at_us, quality):
                yield at_us, partial(self._link, quality=quality)
            case Obstacle(at_us, distance_mm, for_us):
                yield at_us, partial(a.sensors.see, distance_mm)
                if for_us is not None:
                    yield at_us + for_us, partial(a.sensors.see, None)
            case PilotMode(at_us, mode):
                yield at_us, partial(a.vehicle.set_mode, mode)

    def _link(
        self,
        delay_us: int | None = None,
        loss: int | None = None,
        silent: bool | None = None,
        quality: int | None = None,
    ) -> None:
        """Changes both directions in what is given, and what the radio tells of them."""
        for link in (self._up, self._down):
            link.delay_us = link.delay_us if delay_us is None else delay_us
            link.loss = link.loss if loss is None else loss
            link.silent = link.silent if silent is None else silent
        if quality is not None:
            self._autopilot.link_quality = quality
