"""A flight whose computer stalls when it reads its clock: between any two of its actions.

The vehicle flies on meanwhile, and its frames wait to be read.
"""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

from rtshcua.model.flat.situation import Now
from rtshcua.simulation.config import SimulationConfig
from rtshcua.virtual.vehicle import VirtualClock
from virtual import case
from virtual.flight import Flight, Flown

#: us: a verifier reports longer gaps of a log
TOLD_US = 20_000_000


class StallingFlight(Flight):
    """`stalls` are the durations of stalls, in us, by the number of earlier clock readings since its log began; `lost`
    is the reading at which its boundary process is lost. `looks` counts readings.
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
    """Return the gaps of its log longer than 20 s: the record after each, and its length in us."""
    times = [record["at_us"] for record in flown.records]
    return [
        (number, after - before)
        for number, (before, after) in enumerate(pairwise(times), 1)
        if after - before > TOLD_US
    ]
