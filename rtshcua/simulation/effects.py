"""What faults do to a simulation, and when."""

from collections.abc import Callable, Iterator
from functools import partial

from rtshcua.simulation import faults
from rtshcua.simulation.autopilot import Autopilot
from rtshcua.simulation.faults import Fault
from rtshcua.simulation.link import Link
from rtshcua.simulation.surroundings import Pillar
from rtshcua.simulation.wind import Wind

Effect = tuple[int, Callable[[], object]]
"""A time, and what happens then."""


def effects(fault: Fault, a: Autopilot, links: tuple[Link, ...]) -> Iterator[Effect]:
    """When a fault begins, and ends if it does, and what happens then."""
    match fault:
        case faults.LinkDelay() | faults.LinkLoss() | faults.LinkSilence() | faults.LinkQuality():
            yield from _on_link(fault, a, links)
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
        case faults.PilotMode(at_us, mode):
            if mode in a.flavour.modes.numbers:  # the switch has no position for another flavour's mode
                yield at_us, partial(a.vehicle.set_mode, mode)


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


def _on_link(
    fault: faults.LinkDelay | faults.LinkLoss | faults.LinkSilence | faults.LinkQuality,
    a: Autopilot,
    links: tuple[Link, ...],
) -> Iterator[Effect]:
    """Each direction alike, and what the radio tells of it."""
    match fault:
        case faults.LinkDelay(at_us, delay_us):
            yield at_us, partial(_set, links, "delay_us", delay_us)
        case faults.LinkLoss(at_us, loss):
            yield at_us, partial(_set, links, "loss", loss)
            yield at_us, partial(_set, (a,), "link_quality", 10_000 - loss)
        case faults.LinkSilence(at_us, for_us):
            silent = partial(_set, links, "silent")
            yield from _for(at_us, for_us, partial(silent, True), partial(silent, False))
        case faults.LinkQuality(at_us, quality):
            yield at_us, partial(_set, (a,), "link_quality", quality)


def _for(at_us: int, for_us: int | None, begin: Callable[[], object], end: Callable[[], object]) -> Iterator[Effect]:
    yield at_us, begin
    if for_us is not None:
        yield at_us + for_us, end


def _set(things: tuple[object, ...], name: str, value: object) -> None:
    for thing in things:
        setattr(thing, name, value)
