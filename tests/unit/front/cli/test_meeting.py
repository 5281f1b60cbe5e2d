"""A flight waits for the vehicle's time of day, except when it lands an airborne vehicle."""

from types import SimpleNamespace
from typing import Any

import pytest

from reference.flying import context, request
from rtshcua.adapters.clock import PacedClock, SystemClock
from rtshcua.adapters.utc import UtcWatch
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.adapters.vehicle.source_time import SourceTime
from rtshcua.app.fly import connect
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.simulation.simulated_mark import marked


class Silent:
    """A vehicle that does not report the time of day."""

    def __init__(self, *, armed: bool) -> None:
        link = SimpleNamespace(crowd=None)
        self.driver: Any = SimpleNamespace(
            flavour=None, seen=ObservedVehicle(armed=armed), asks_utc=True, issued_from_us=0, link=link,
            source=SourceTime(),
        )  # fmt: skip
        self.polls = 0
        #: the earliest readiness, at each check
        self.ready_from_us: list[int] = []

    def poll(self, now_us: int, timeout_us: int) -> list[Any]:
        self.polls += 1
        self.ready_from_us.append(self.driver.issued_from_us)
        self.driver.flavour = SimpleNamespace(name="px4")
        return []


@pytest.mark.parametrize(("hurried", "armed", "waits"), [(True, True, False), (True, False, True), (False, True, True)])
def test_airborne_vehicle_does_not_wait_for_the_time_of_day(
    hurried: bool, armed: bool, waits: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Otherwise each restart takes 3 s on a machine without clock synchronisation and with a stated error."""
    monkeypatch.setattr(connect, "UTC_S", 0.05)
    clock, vehicle = SystemClock(), Silent(armed=armed)
    utc = UtcWatch(clock, 500_000, kernel_us=lambda: None)
    connect.await_utc(utc, vehicle, clock, 0, patient=True, hurried=hurried)  # type: ignore[arg-type]
    assert (vehicle.polls > 0) == waits
    assert utc.bound.source == "operator"


def test_vehicle_is_not_ready_before_its_first_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Regression: on a busy machine the time came last, while the run waited for a second vehicle. The first step was
    deferred as uncertain until its deadline.
    """
    monkeypatch.setattr(connect, "UTC_S", 0.05)
    monkeypatch.setattr(connect, "ANOTHER_S", 0.05)
    clock, vehicle = SystemClock(), Silent(armed=False)
    utc = UtcWatch(clock, 500_000, kernel_us=lambda: None)
    now = clock.now()
    link: Any = object()
    never: Any = None
    connect.await_heartbeat(context(request(link=link), clock), vehicle, never, hurried=False)  # type: ignore[arg-type]
    connect.await_utc(utc, vehicle, clock, now.utc_us, patient=True)  # type: ignore[arg-type]
    assert vehicle.polls > 2
    assert min(vehicle.ready_from_us) > now.monotonic_us + 10**15
    wait_us = vehicle.driver.issued_from_us - now.monotonic_us
    assert 0 <= wait_us <= 600_000, "issued now, by a clock that is true to 0.5 s"


#: the values of PX4 1.16: hashes of its sources and of its operating system
PX4_HASHES = [0x6A, 0x0F, 0xC1, 0x33, 0x91, 0, 0, 0], [0x12, 0xFE, 0x44, 0x09, 0x5B, 0, 0, 0]


class Telling(Silent):
    """A vehicle that answers the first request with these custom versions; None: it does not answer."""

    def __init__(self, custom: tuple[list[int], list[int]] | None) -> None:
        super().__init__(armed=False)
        self.driver.asks_first, self.driver.system = None, 1
        self.custom = custom
        self.asked_before_ready = False

    def poll(self, now_us: int, timeout_us: int) -> list[Any]:
        first = self.driver.asks_first
        if first is not None and first.due(1, now_us) and self.custom is not None:
            self.asked_before_ready = self.driver.issued_from_us > now_us + 10**15
            middleware, system = self.custom
            told = SimpleNamespace(middleware_custom_version=middleware, os_custom_version=system)
            first.take("AUTOPILOT_VERSION", told)
        return super().poll(now_us, timeout_us)


def met_at(
    speed: float, custom: tuple[list[int], list[int]] | None, monkeypatch: pytest.MonkeyPatch
) -> tuple[Telling, Any]:
    monkeypatch.setattr(connect, "ANOTHER_S", 0)
    monkeypatch.setattr(connect, "SPEED_S", 0.02)
    vehicle, of, never = Telling(custom), request(link=object(), speed=speed), None
    found = connect.await_heartbeat(context(of, PacedClock(speed)), vehicle, never, hurried=False)  # type: ignore[arg-type]
    return vehicle, found


@pytest.mark.parametrize("speed", [10, 1.01, 0.5, 2])
@pytest.mark.parametrize(
    ("custom", "slug"),
    [
        (PX4_HASHES, "not-simulated"),
        (([0] * 8, [0] * 8), "not-simulated"),
        (None, "not-simulated"),
        (marked(100), "other-speed"),
    ],
)
def test_speed_is_refused_for_a_real_vehicle(
    speed: float, custom: Any, slug: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Regression: a real autopilot behind a router at 127.0.0.1 was accepted as simulated, with `--speed 10`, on an
    unsynchronised machine, with a time of day exact to 0.1 s.
    """
    _, found = met_at(speed, custom, monkeypatch)
    assert isinstance(found, Refusal)
    assert (found.code, found.slug) == (ExitCode.REFUSED, slug)


@pytest.mark.parametrize("speed", [10, 1.01, 0.5, 2])
def test_speed_is_read_from_a_simulated_vehicle(speed: float, monkeypatch: pytest.MonkeyPatch) -> None:
    vehicle, found = met_at(speed, marked(round(speed * 100)), monkeypatch)
    assert found == []
    assert vehicle.asked_before_ready, "nothing begins before it is known"
    assert vehicle.driver.asks_first is None
    assert vehicle.driver.issued_from_us == 0


def test_no_speed_query_in_real_time(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not met_at(1, None, monkeypatch)[0].asked_before_ready
