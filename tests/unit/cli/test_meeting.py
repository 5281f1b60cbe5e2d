"""Before a flight the vehicle's time of day is waited for, and not before what hangs in the air is brought down."""

from types import SimpleNamespace
from typing import Any

import pytest

from rtshcua.adapters.clock import SystemClock
from rtshcua.adapters.utc import UtcWatch
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.cli import meeting


class Silent:
    """A vehicle that tells no time of day."""

    def __init__(self, *, armed: bool) -> None:
        self.driver: Any = SimpleNamespace(flavour=None, seen=ObservedVehicle(armed=armed), asks_utc=True)
        self.polls = 0

    def poll(self, now_us: int, timeout_us: int) -> list[Any]:
        self.polls += 1
        return []


@pytest.mark.parametrize(("hurried", "armed", "waits"), [(True, True, False), (True, False, True), (False, True, True)])
def test_what_hangs_in_the_air_does_not_wait_for_the_time_of_day(
    hurried: bool, armed: bool, waits: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """3 s of each restart on a machine whose clock nobody sets, where the operator said how far it is off."""
    monkeypatch.setattr(meeting, "UTC_S", 0.05)
    clock, vehicle = SystemClock(), Silent(armed=armed)
    utc = UtcWatch(clock, 500_000, kernel_us=lambda: None)
    meeting.await_utc(utc, vehicle, clock, patient=True, hurried=hurried)  # type: ignore[arg-type]
    assert (vehicle.polls > 0) == waits
    assert utc.bound.source == "operator"
