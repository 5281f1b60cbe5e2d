"""The machine's clocks, across a suspend and a step of its time of day."""

import time
from collections.abc import Callable

import pytest

from rtshcua.adapters.clock import StepWatch, SystemClock, monotonic_ns

S = 1_000_000_000
HOUR_US = 3_600_000_000


class Machine:
    """A machine that can be suspended: Linux's clocks, as `clock_gettime(2)` has them."""

    def __init__(self) -> None:
        self.boot_ns, self.monotonic_ns, self.utc_ns = 900 * S, 100 * S, 1_750_000_000 * S

    def wait(self, ns: int, *, suspended: bool = False) -> None:
        self.boot_ns += ns
        self.utc_ns += ns
        self.monotonic_ns += 0 if suspended else ns

    def clock(self, which: int) -> int:
        return {7: self.boot_ns}[which]


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    made = Machine()
    monkeypatch.setattr("rtshcua.adapters.clock._BOOTTIME", 7)
    monkeypatch.setattr(time, "clock_gettime_ns", made.clock)
    monkeypatch.setattr(time, "monotonic_ns", lambda: made.monotonic_ns)
    monkeypatch.setattr(time, "time_ns", lambda: made.utc_ns)
    return made


def test_both_times_go_on_while_the_machine_is_suspended(machine: Machine) -> None:
    """Otherwise an expired bundle could fly, and approvals, hours of zones and ages would be wrong."""
    clock = SystemClock(1_000)
    before = clock.now()
    machine.wait(3_600 * S, suspended=True)
    after = clock.now()
    assert after.monotonic_us - before.monotonic_us == HOUR_US
    assert after.utc_us - before.utc_us == HOUR_US


def test_suspend_is_not_reported_as_a_clock_step(machine: Machine) -> None:
    clock, watch = SystemClock(), StepWatch()
    machine.wait(60 * S, suspended=True)
    assert watch.events(clock.now()) == []
    machine.wait(60 * S, suspended=True)
    machine.utc_ns += 5 * S
    (stepped,) = watch.events(clock.now())
    assert stepped.by_us == 5_000_000


@pytest.mark.parametrize(("clock", "found"), [(7, 900 * S), (None, 100 * S)])
def test_monotonic_clock_is_used_without_a_boottime_clock(
    machine: Machine, monkeypatch: pytest.MonkeyPatch, clock: int | None, found: int
) -> None:
    monkeypatch.setattr("rtshcua.adapters.clock._BOOTTIME", clock)
    read: Callable[[], int] = monotonic_ns
    assert read() == found
