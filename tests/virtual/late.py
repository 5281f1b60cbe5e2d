"""A flight whose computer stalls for 3 s just before the takeoff is sent; the steps have 10 s to begin."""

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

from msgspec.structs import replace

from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import Command
from rtshcua.virtual.flight import VirtualFlight
from virtual import case
from virtual.flight import Flight

STALL_US = 3 * case.S


@cache
def bundle() -> bytes:
    """Up and home."""

    def patient(contract: Contract) -> Contract:
        return replace(contract, deadline_us=10 * case.S)

    policy = case.policy()
    steps = [replace(each, contract=patient(each.contract)) for each in case.low_steps(leg=False)]
    return case.seal(case.mission(steps), replace(policy, contracts=tuple(map(patient, policy.contracts))))


class Stalls:
    """Stalls a flight's computer, in us by the number of clock readings from now on (`looks`)."""

    def __init__(self, flight: VirtualFlight, stalls: Mapping[int, int]) -> None:
        self.looks = 0
        left, now = dict(stalls), flight.clock.now

        def looked() -> Now:
            for_us = left.pop(self.looks, 0)
            self.looks += 1
            if for_us:
                flight.vehicle.stand_still(for_us)
            return now()

        flight.clock.now = looked  # type: ignore[method-assign]


def looks_until_sent(flight: VirtualFlight) -> int:
    """Return the number of clock readings until the first command reaches the vehicle; the last one checks its
    deadline.
    """
    counted, begin, found = Stalls(flight, {}), flight.vehicle.begin, list[int]()

    def begun(command: Command, now_us: int) -> None:
        found.append(counted.looks)
        begin(command, now_us)

    flight.vehicle.begin = begun  # type: ignore[method-assign]
    flight.prepare(lambda _: ())
    while not found:
        assert flight.turn() is None
    return found[0]


def late(make: Callable[[], VirtualFlight], *, at_its_frame: bool = False) -> VirtualFlight:
    """Return a flight whose takeoff is late when it is sent, or when its first frame is."""
    looks, flight = looks_until_sent(make()), make()
    Stalls(flight, {looks - (not at_its_frame): STALL_US})
    return flight


def flight(**more: Any) -> Flight:
    """A flight of the `bundle`."""
    return Flight(bundle(), case.simulated("px4"), **more)
