"""A flight from a cold start: the vehicle is not ready before its estimator is, whatever it reports."""

import pytest

from rtshcua.onboard.ports import Ending
from rtshcua.simulation.config import Boot
from rtshcua.virtual.vehicle import SECOND, START
from virtual.flight import Flight
from virtual.shipped import shipped, simulated


@pytest.mark.slow
@pytest.mark.parametrize(("flavour", "earliest_s", "latest_s"), [("px4", 5, 8), ("ardupilot", 41.6, 45)])
def test_vehicle_is_ready_when_its_estimator_is(flavour: str, earliest_s: float, latest_s: float) -> None:
    flown = Flight(shipped("short"), simulated(flavour, boot=Boot.RECORDED)).fly()
    assert flown.ending is Ending.COMPLETED
    (ready,) = (r["at_us"] - START.monotonic_us for r in flown.records if r.get("event") == "ready")
    assert earliest_s * SECOND <= ready <= latest_s * SECOND
