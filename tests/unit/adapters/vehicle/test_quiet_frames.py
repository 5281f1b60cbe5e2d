"""Frames without news for a manoeuvre are not passed to it, which changes no outcome."""

from collections.abc import Callable, Sequence
from itertools import product

import pytest

from rtshcua.adapters.vehicle.manoeuvre import Manoeuvre
from rtshcua.adapters.vehicle.messages import Message
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import Event
from rtshcua.simulation.fault_syntax import parse_fault
from rtshcua.virtual.vehicle import SECOND, TICK_US
from virtual.flight import Flight
from virtual.flyer import Flyer
from virtual.shipped import shipped, simulated

FAULTS = ("link-loss,at=5s,loss=40%", "link-delay,at=0s,delay=400ms")


#: one case flies a whole mission twice; the others are for soak
CASES = [
    pytest.param("px4", FAULTS[0]),
    *(pytest.param(*each, marks=pytest.mark.soak) for each in [("px4", FAULTS[1]), *product(["ardupilot"], FAULTS)]),
]


def flown(flavour: str, fault: str) -> tuple[list[bytes], Sequence[Event]]:
    flight = Flight(shipped("short"), simulated(flavour, faults=(parse_fault(fault),)))
    return flight.fly().lines, flight.events


@pytest.mark.slow
@pytest.mark.parametrize(("flavour", "fault"), CASES)
def test_a_flight_is_the_same_when_every_frame_is_shown(
    flavour: str, fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    spared = flown(flavour, fault)
    monkeypatch.setattr(Manoeuvre, "due_us", property(lambda _: 0, lambda _, value: None), raising=False)
    assert flown(flavour, fault) == spared
    assert b'"ending":"completed"' in spared[0][-1]


def test_a_leg_is_not_looked_at_whenever_time_goes_by(
    aloft: Callable[[], Flyer], monkeypatch: pytest.MonkeyPatch
) -> None:
    """This includes a leg whose target would otherwise be repeated."""
    advance = Manoeuvre.advance
    moments: set[int] = set()

    def counted(self: Manoeuvre, seen: ObservedVehicle, now_us: int) -> tuple[list[Message], Sequence[Event]]:
        moments.add(now_us)
        return advance(self, seen, now_us)

    one = aloft()
    one.begin(MotionKind.COVER, (20_000, 0), (200_000, 0), altitude=20_000, speed=5_000)
    one.wait(15)
    monkeypatch.setattr(Manoeuvre, "advance", counted)
    one.wait(5)
    assert 0 < len(moments) < 5 * SECOND // TICK_US // 2
