"""A link that delays frames: a late report is old, and a stale state is unknown."""

from functools import cache

import pytest
from msgspec.structs import replace

from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.decision.prepare import prepare
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.faults import LinkDelay
from rtshcua.onboard.ports import Readings, Ready
from rtshcua.onboard.runtime.monitor import StateMonitor
from rtshcua.simulation.config import AutopilotKind, SimulationConfig
from rtshcua.virtual.vehicle import SECOND, VirtualVehicle
from virtual.copying import copied
from virtual.policy import POLICY

STALE_US = 2 * SECOND
LATE = replace(POLICY, signals=tuple(replace(signal, stale_us=STALE_US) for signal in POLICY.signals))
#: those that the simulated vehicle reports on the ground
REPORTED = ("battery", "height", "gps.fix", "position", "link.quality")


class Watched:
    """The simulated vehicle with its driver and the state monitor."""

    def __init__(self, flavour: str) -> None:
        prepared = prepare(LATE)
        assert not isinstance(prepared, Refusal)
        self.vehicle = VirtualVehicle(LATE, SimulationConfig(flavour=AutopilotKind(flavour)))
        self.monitor = StateMonitor(prepared)
        self.events: list[object] = []

    @property
    def now_us(self) -> int:
        return self.vehicle.clock.monotonic_us

    def wait(self, seconds: float) -> None:
        end_us = self.now_us + round(seconds * SECOND)
        while self.now_us < end_us:
            for event in self.vehicle.poll(self.now_us, end_us - self.now_us):
                self.events.append(event)
                if isinstance(event, Readings):
                    self.monitor.update(event)

    def delay(self, delay_us: int) -> None:
        self.vehicle.simulation.inject(LinkDelay(self.vehicle.clock.elapsed_us, delay_us))

    def known(self) -> set[str]:
        """The signals that are known, and not stale."""
        state = self.monitor.state(self.now_us)
        return {
            signal.name
            for signal in LATE.signals
            if state.values[signal.slot] is not None and state.ages[signal.slot] <= signal.stale_us
        }


@cache
def watched(flavour: str) -> Watched:
    one = Watched(flavour)
    one.wait(20)
    return one


def ready(flavour: str) -> Watched:
    """A vehicle that was received for 20 s."""
    return copied(watched(flavour))


def test_position_delayed_beyond_its_staleness_is_unknown(flavour: str) -> None:
    one = ready(flavour)
    assert any(isinstance(event, Ready) for event in one.events)
    assert set(REPORTED) <= one.known()
    one.delay(3 * SECOND)
    one.wait(2.2)
    assert one.known() == set(), "nothing came since"
    for _ in range(100):
        one.wait(0.2)
        assert one.known() == set(), "frames come as often as before, each of them 3 s old"
    seen: ObservedVehicle = one.vehicle.driver.seen
    assert not seen.located
    assert not seen.levelled
    one.delay(0)
    one.wait(4)
    assert set(REPORTED) <= one.known()
    assert seen.located


def test_slightly_delayed_position_stays_known_with_its_age(flavour: str) -> None:
    one = ready(flavour)
    one.delay(500_000)
    one.wait(5)
    for _ in range(20):
        one.wait(0.2)
        ages = one.monitor.state(one.now_us).ages
        assert set(REPORTED) <= one.known()
        reported = [ages[signal.slot] for signal in LATE.signals if signal.name in REPORTED]
        # the way down, the same again for the way up, and the time to the next report
        assert 500_000 <= min(reported) <= max(reported) < 500_000 + 500_000 + 600_000
    assert one.vehicle.driver.source.clock.round_trip_us == 1_000_000


@pytest.mark.parametrize("flavour", ["px4", pytest.param("ardupilot", marks=pytest.mark.soak)])
def test_a_link_that_was_slow_from_the_beginning_counts_the_way_up_as_well(flavour: str) -> None:
    """The division of a round trip is unknown: all of it may have been the way down."""
    one = Watched(flavour)
    one.delay(700_000)
    one.wait(25)
    for _ in range(20):
        one.wait(0.2)
        state = one.monitor.state(one.now_us)
        ages = [state.ages[signal.slot] for signal in LATE.signals if signal.name in ("position", "height", "battery")]
        assert all(1_390_000 <= age_us < 1_400_000 + 1_200_000 for age_us in ages), ages
    assert {"position", "height"} <= one.known()
    one.delay(1_100_000)
    one.wait(30)
    assert one.known() == set()


def test_a_first_silence_leaves_no_age_that_is_too_young(flavour: str) -> None:
    one = ready(flavour)
    one.delay(700_000)
    one.wait(0.69)
    held = one.monitor.state(one.now_us)
    one.wait(0.1)
    first = one.monitor.state(one.now_us)
    for slot, age_us in enumerate(first.ages):
        assert held.values[slot] is None or age_us >= 700_000
