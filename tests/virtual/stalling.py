"""A flight whose computer stands still for a while when it looks at its clock: between any two things that it does.

The vehicle flies on meanwhile, and what it says waits to be read.
"""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

from rtshcua.model.flat.situation import Now
from rtshcua.simulation.config import SimulationConfig
from rtshcua.virtual.vehicle import VirtualClock
from virtual import case
from virtual.flight import Flight, Flown

#: a silence that is longer than this is told by whoever verifies the log, in us
TOLD_US = 20_000_000


class StallingFlight(Flight):
    """`stalls` are how long it stands still, in us, by how often it looked at the clock before, from its log on;
    `lost` is when its boundary is lost, where that is elsewhere. `looks` counts.
    """

    def __init__(
        self, bundle: bytes, flavour: str, stalls: Mapping[int, int], lost: int | None = None,
        config: SimulationConfig | None = None, **more: Any,
    ) -> None:  # fmt: skip
        super().__init__(bundle, config or case.simulated(flavour), **more)
        self.stalls = dict(stalls)
        self.looks = 0
        #: in total, in us
        self.stood_us = 0
        clock, now = self.clock, self.clock.now

        def looked() -> Now:
            for_us = self.stalls.pop(self.looks, 0)
            self.served.dead = self.served.dead or (lost is not None and self.looks >= lost)
            self.looks += 1
            if for_us:
                self.stood_us += for_us
                self.vehicle.stand_still(for_us)
            return now()

        assert isinstance(clock, VirtualClock)
        clock.now = looked  # type: ignore[method-assign]


def silences(flown: Flown) -> list[tuple[int, int]]:
    """The times in which its log has nothing for longer than 20 s: the record behind each, and its us."""
    times = [record["at_us"] for record in flown.records]
    return [
        (number, after - before)
        for number, (before, after) in enumerate(pairwise(times), 1)
        if after - before > TOLD_US
    ]
