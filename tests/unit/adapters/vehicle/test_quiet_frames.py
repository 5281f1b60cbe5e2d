"""Frames in which a manoeuvre sees nothing new are not shown to it: nothing comes of it, whatever goes wrong."""

from collections.abc import Sequence
from itertools import product

import pytest

from rtshcua.adapters.vehicle.manoeuvre import Manoeuvre
from rtshcua.onboard.ports import Event
from rtshcua.simulation.faults import parse_fault
from virtual.flight import Flight
from virtual.shipped import shipped, simulated

FAULTS = ("link-loss,at=5s,loss=40%", "link-delay,at=0s,delay=400ms")


#: one of them flies a whole mission twice; the others are for soak
CASES = [
    pytest.param("px4", FAULTS[0]),
    *(pytest.param(*each, marks=pytest.mark.soak) for each in [("px4", FAULTS[1]), *product(["ardupilot"], FAULTS)]),
]


def flown(flavour: str, fault: str) -> tuple[list[bytes], Sequence[Event]]:
    flight = Flight(shipped("short"), simulated(flavour, faults=(parse_fault(fault),)))
    return flight.fly().lines, flight.events


@pytest.mark.parametrize(("flavour", "fault"), CASES)
def test_a_flight_is_the_same_when_every_frame_is_shown(
    flavour: str, fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    spared = flown(flavour, fault)
    monkeypatch.setattr(Manoeuvre, "due_us", property(lambda _: 0, lambda _, value: None), raising=False)
    assert flown(flavour, fault) == spared
    assert b'"ending":"completed"' in spared[0][-1]
