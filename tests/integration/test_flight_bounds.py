"""Proved bounds hold in flight: no step exceeds its duration, charge or height."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import cycle
from typing import NamedTuple

import pytest

from reference.bounded_flights import Drawn, bounds, compiled, draw, simulated
from rtshcua.ground.pipeline.program import Compiled
from rtshcua.onboard.ports import Ending
from virtual import case
from virtual.flight import Flight, Flown

#: what the tick of these flights adds to a step
TICKS_US = 100_000
POSITION_ERROR_MM = 3_000


class Sample(NamedTuple):
    """The true state at a time."""

    at_us: int
    battery: int
    up_mm: int


def accepted(seeds: Iterable[int], count: int) -> Iterator[tuple[int, Drawn, Compiled]]:
    """Return so many accepted missions, generated from seeds."""
    for seed in seeds:
        drawn = draw(seed)
        made = compiled(drawn)
        if made.mission is not None:
            yield seed, drawn, made
            count -= 1
            if not count:
                return


def flown(drawn: Drawn, made: Compiled, flavour: str) -> tuple[Flown, list[Sample]]:
    """Fly it, and record the true state at each turn."""
    assert made.mission is not None
    samples = []

    def look(flight: Flight) -> tuple[()]:
        truth = flight.vehicle.simulation.truth()
        samples.append(Sample(flight.clock.now().monotonic_us, truth.battery, truth.up_mm))
        return ()

    flight = Flight(case.seal(made.mission, made.policy), simulated(drawn, made, flavour))
    return flight.fly(look), samples


def exceeded(drawn: Drawn, made: Compiled, flavour: str) -> Iterator[str]:
    """Return the bounds that its flight exceeds."""
    flight, samples = flown(drawn, made, flavour)
    proven = bounds(made)
    if flight.ending is not Ending.COMPLETED:
        yield f"{flight.ending}, after {flight.dispatched()}: {[each['event'] for each in flight.effects('violated')]}"
        return
    begun = flight.effects("dispatched")
    ended = {each["step"]: each["at_us"] for each in flight.effects("succeeded")}

    def battery(at_us: int) -> int:
        return next((each.battery for each in samples if each.at_us >= at_us), samples[-1].battery)

    for step, bound in zip(begun, proven.steps, strict=True):
        start, end = step["at_us"], ended[step["step"]]
        if end - start > bound.time_us + TICKS_US:
            yield f"{bound.skill} took {(end - start) / 1e6:.1f} s of {bound.time_us / 1e6:.1f} s"
        taken = battery(start) - battery(end)
        if taken > bound.energy + 1:  # both are rounded
            yield f"{bound.skill} took {taken} of {bound.energy}"
    whole = max(ended.values()) - begun[0]["at_us"]
    if whole > proven.time_us:
        yield f"all took {whole / 1e6:.1f} s of {proven.time_us / 1e6:.1f} s"
    if samples[0].battery - samples[-1].battery > proven.energy:
        yield f"all took {samples[0].battery - samples[-1].battery} of {proven.energy}"
    highest = max(each.up_mm for each in samples)
    if highest > 1_000 * drawn.highest + POSITION_ERROR_MM:
        yield f"it came {highest / 1_000} m high, and {drawn.highest} m is planned"


def wrong(first: int, count: int, *autopilots: Sequence[str]) -> list[str]:
    """What is wrong about `count` accepted missions, of seeds from `first` on, each on the next of `autopilots`."""
    missions = list(accepted(range(first, first + 1_000), count))
    assert len(missions) == count
    return [
        f"seed {seed} on {flavour}: {what}"
        for (seed, *mission), flavours in zip(missions, cycle(autopilots))
        for flavour in flavours
        for what in exceeded(*mission, flavour)
    ]


@pytest.mark.slow
def test_proved_bounds_hold_in_flight() -> None:
    assert wrong(0, 4, ["px4"], ["ardupilot"]) == []


@pytest.mark.soak
@pytest.mark.parametrize("ten", range(50))
def test_proved_bounds_hold_in_many_flights(ten: int) -> None:
    assert wrong(1_000 * ten, 10, ["px4", "ardupilot"]) == []
