"""What faults do to a simulation, and when."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from random import Random

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.simulation import faults
from rtshcua.simulation.autopilot import Autopilot
from rtshcua.simulation.faults import Fault, Way
from rtshcua.simulation.link import Link
from rtshcua.simulation.loop import Loop
from rtshcua.simulation.pilot import Effect, pilot_effects
from rtshcua.simulation.surroundings import Pillar
from rtshcua.simulation.wind import Wind

SHUFFLED_US = 200_000
"""How long after a stall messages wait to be shuffled."""


@dataclass(frozen=True, slots=True)
class Affected:
    """What faults act on."""

    autopilot: Autopilot
    up: Link
    down: Link
    loop: Loop

    def links(self, way: Way) -> tuple[Link, ...]:
        """The links of a direction."""
        return {Way.BOTH: (self.up, self.down), Way.UP: (self.up,), Way.DOWN: (self.down,)}[way]


def effects(fault: Fault, on: Affected) -> Iterator[Effect]:
    """When a fault begins, and ends if it does, and what happens then."""
    a = on.autopilot
    match fault:
        case faults.LinkDelay() | faults.LinkJitter() | faults.LinkReorder() | faults.LinkLoss():
            yield from _on_link(fault, on)
        case faults.LinkSilence() | faults.LinkQuality():
            yield from _on_link(fault, on)
        case faults.Stall() | faults.Freeze() | faults.MessageSilence():
            yield from _on_autopilot(fault, on)
        case faults.PilotMode() | faults.PilotPause() | faults.PilotGoto() | faults.PilotSticks() | faults.Kill():
            yield from pilot_effects(fault, a)
        case faults.GpsLoss() | faults.GpsGlitch() | faults.GpsJump():
            yield from _on_receiver(fault, a)
        case faults.Obstacle() | faults.Pillar():
            yield from _in_the_way(fault, a)
        case faults.BatteryLevel(at_us, level):
            yield at_us, partial(a.battery.cap, level / 10_000)
        case faults.BatteryVoltage(at_us, voltage_mv):
            yield at_us, partial(a.battery.measure, voltage_mv)
        case faults.WindStep(at_us, speed_mm_s, from_deg, gust_mm_s):
            yield at_us, partial(a.air.set, Wind(speed_mm_s, from_deg, gust_mm_s))


def _on_receiver(fault: faults.GpsLoss | faults.GpsGlitch | faults.GpsJump, a: Autopilot) -> Iterator[Effect]:
    match fault:
        case faults.GpsLoss(at_us, for_us):
            yield from _for(at_us, for_us, a.sensors.lose_fix, a.sensors.find_fix)
        case faults.GpsGlitch(at_us, north_mm, east_mm, for_us):
            off = partial(a.sensors.glitch, north_mm / 1000, east_mm / 1000)
            yield from _for(at_us, for_us, off, partial(a.sensors.glitch, 0.0, 0.0))
        case faults.GpsJump(at_us, north_mm, east_mm):
            yield at_us, partial(a.sensors.jump, north_mm / 1000, east_mm / 1000)


def _in_the_way(fault: faults.Obstacle | faults.Pillar, a: Autopilot) -> Iterator[Effect]:
    match fault:
        case faults.Obstacle(at_us, distance_mm, for_us):
            see = a.surroundings.see
            yield from _for(at_us, for_us, partial(see, distance_mm / 1000), partial(see, None))
        case faults.Pillar(at_us, north_mm, east_mm, radius_mm, height_mm, for_us):
            pillar = Pillar(north_mm / 1000, east_mm / 1000, radius_mm / 1000, height_mm / 1000)
            pillars = a.surroundings.pillars
            yield from _for(at_us, for_us, partial(pillars.append, pillar), partial(pillars.remove, pillar))


def _on_link(fault: faults.LinkFault, on: Affected) -> Iterator[Effect]:
    """On the directions that the fault names, and what the radio tells of it."""
    a = on.autopilot
    match fault:
        case faults.LinkDelay(at_us, delay_us, for_us, way):
            yield from _while(on.links(way), "delay_us", delay_us, at_us, for_us)
        case faults.LinkJitter(at_us, jitter_us, for_us, way):
            yield from _while(on.links(way), "jitter_us", jitter_us, at_us, for_us)
        case faults.LinkReorder(at_us, part, for_us, way):
            yield from _while(on.links(way), "reordered", part, at_us, for_us)
        case faults.LinkLoss(at_us, loss, for_us, way):
            yield from _while(on.links(way), "loss", loss, at_us, for_us)
            yield from _for(
                at_us,
                for_us,
                partial(setattr, a, "link_quality", 10_000 - loss),
                partial(setattr, a, "link_quality", 10_000),
            )
        case faults.LinkSilence(at_us, for_us, way, held):
            links = on.links(way)
            if held:
                yield at_us, partial(_set, links, "held", True)
                if for_us is not None:
                    yield from ((at_us + for_us, partial(link.release, at_us + for_us)) for link in links)
            else:
                yield from _for(
                    at_us, for_us, partial(_set, links, "silent", True), partial(_set, links, "silent", False)
                )
        case faults.LinkQuality(at_us, quality):
            yield at_us, partial(setattr, a, "link_quality", quality)


def _on_autopilot(fault: faults.AutopilotFault, on: Affected) -> Iterator[Effect]:
    a = on.autopilot
    match fault:
        case faults.Stall(at_us, for_us, shuffle):
            yield from _for(at_us, for_us, on.loop.halt, on.loop.resume)
            if shuffle:
                end_us = at_us + for_us
                yield end_us, partial(setattr, on.down, "held", True)
                last_us = end_us + SHUFFLED_US
                yield last_us, partial(on.down.release, last_us, Random(shuffle))
        case faults.Freeze(at_us, for_us):
            yield from _for(at_us, for_us, partial(a.reports.freeze, True), partial(a.reports.freeze, False))
        case faults.MessageSilence(at_us, message, for_us):
            silence = partial(a.reports.silence, message_number(message))
            yield from _for(at_us, for_us, partial(silence, True), partial(silence, False))


def message_number(name: str) -> int:
    """The number of a message. Raises ValueError if the dialect has none of this name."""
    number = getattr(mavlink, f"MAVLINK_MSG_ID_{name}", None)
    if not isinstance(number, int):
        raise ValueError(f"no such message: `{name}`")
    return number


def _while(links: tuple[Link, ...], name: str, value: int, at_us: int, for_us: int | None) -> Iterator[Effect]:
    return _for(at_us, for_us, partial(_set, links, name, value), partial(_set, links, name, 0))


def _for(at_us: int, for_us: int | None, begin: Callable[[], object], end: Callable[[], object]) -> Iterator[Effect]:
    yield at_us, begin
    if for_us is not None:
        yield at_us + for_us, end


def _set(things: tuple[object, ...], name: str, value: object) -> None:
    for thing in things:
        setattr(thing, name, value)
