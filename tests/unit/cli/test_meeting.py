"""Before a flight the vehicle's time of day is waited for, and not before what hangs in the air is brought down."""

from types import SimpleNamespace
from typing import Any

import pytest

from rtshcua.adapters.clock import SystemClock
from rtshcua.adapters.utc import UtcWatch
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.adapters.vehicle.source_time import SourceTime
from rtshcua.cli import meeting


class Silent:
    """A vehicle that tells no time of day."""

    def __init__(self, *, armed: bool) -> None:
        link = SimpleNamespace(crowd=None)
        self.driver: Any = SimpleNamespace(
            flavour=None, seen=ObservedVehicle(armed=armed), asks_utc=True, issued_from_us=0, link=link,
            source=SourceTime(),
        )  # fmt: skip
        self.polls = 0
        #: from when on it could have been ready, at each look
        self.ready_from_us: list[int] = []

    def poll(self, now_us: int, timeout_us: int) -> list[Any]:
        self.polls += 1
        self.ready_from_us.append(self.driver.issued_from_us)
        self.driver.flavour = SimpleNamespace(name="px4")
        return []


@pytest.mark.parametrize(("hurried", "armed", "waits"), [(True, True, False), (True, False, True), (False, True, True)])
def test_what_hangs_in_the_air_does_not_wait_for_the_time_of_day(
    hurried: bool, armed: bool, waits: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """3 s of each restart on a machine whose clock nobody sets, where the operator said how far it is off."""
    monkeypatch.setattr(meeting, "UTC_S", 0.05)
    clock, vehicle = SystemClock(), Silent(armed=armed)
    utc = UtcWatch(clock, 500_000, kernel_us=lambda: None)
    meeting.await_utc(utc, vehicle, clock, 0, patient=True, hurried=hurried)  # type: ignore[arg-type]
    assert (vehicle.polls > 0) == waits
    assert utc.bound.source == "operator"


def test_it_is_not_ready_before_all_that_is_asked_of_it_first_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy machine it had all else while a second vehicle was waited for: its first step was deferred as
    uncertain, until the deadline of that was over.
    """
    monkeypatch.setattr(meeting, "UTC_S", 0.05)
    monkeypatch.setattr(meeting, "ANOTHER_S", 0.05)
    clock, vehicle = SystemClock(), Silent(armed=False)
    utc = UtcWatch(clock, 500_000, kernel_us=lambda: None)
    now = clock.now()
    link: Any = object()
    never: Any = SimpleNamespace(wish=lambda: None)
    meeting.meet(link, None, vehicle, clock, never, signing=never, hurried=False)  # type: ignore[arg-type]
    meeting.await_utc(utc, vehicle, clock, now.utc_us, patient=True)  # type: ignore[arg-type]
    assert vehicle.polls > 2
    assert min(vehicle.ready_from_us) > now.monotonic_us + 10**15
    wait_us = vehicle.driver.issued_from_us - now.monotonic_us
    assert 0 <= wait_us <= 600_000, "issued now, by a clock that is true to 0.5 s"
