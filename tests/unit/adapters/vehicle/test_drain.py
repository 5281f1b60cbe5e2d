"""What a minute takes of the charge, as measured from reports in whole percent."""

from random import Random
from typing import Any

from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.vehicle.drain import LEAST_CHANGES, WINDOW_US, DrainMeter
from rtshcua.adapters.vehicle.telemetry import Telemetry, drained
from rtshcua.decision.flying import MINUTE, MOST_DRAIN
from rtshcua.model.flat.signal import DRAIN, NUMBER, Signal, SignalSource
from virtual.policy import BATTERY, POLICY

S = 1_000_000


def measured(
    rate: int, seconds: int, *, start: int = 10_000, every_us: int = S, meter: DrainMeter | None = None
) -> int | None:
    """What is measured at the end of so many seconds in which a minute takes `rate`, 1/10000, reported in percent."""
    meter, found = meter or DrainMeter(), None
    for at_us in range(0, seconds * S + 1, S):
        left = max(0, start - rate * at_us // MINUTE)
        found = meter.take(left // 100 * 100, at_us)
    return found


def test_a_steady_drain_is_measured_within_a_tenth() -> None:
    """Of 6.3 % a minute, as declared, to 75 %, as PX4's simulation of a battery drains; `found` is never None there."""
    for rate in (630, 1_300, 1_760, 3_500, 7_500):
        found = measured(rate, 50, start=10_000 - rate // 60)
        assert found is not None
        assert abs(found - rate) * 10 <= rate, (rate, found)


def test_nothing_is_measured_before_several_changes_nor_of_a_charge_that_stands() -> None:
    assert measured(630, 12) is None
    assert measured(0, 300) is None


def test_a_drain_that_ends_is_believed_to_have_ended() -> None:
    meter = DrainMeter()
    high = measured(3_000, 30, meter=meter)
    assert high is not None
    found = [meter.take(8_500, 30 * S + second * S) for second in range(1, 62)]
    known = [each for each in found if each is not None]
    assert known == sorted(known, reverse=True)
    assert known[-1] < high // 2
    assert found[-1] is None, "what is older than the window counts no more"


def test_a_fall_at_once_is_a_finding_and_no_drain() -> None:
    meter = DrainMeter()
    measured(1_000, 50, meter=meter)
    assert meter.take(4_000, 51 * S) is None
    assert meter.take(5_000, 52 * S) is None, "nor is a rise"
    measured(1_000, 50, meter=meter)
    assert meter.take(None, 51 * S) is None


def test_steps_of_five_percent_are_a_drain() -> None:
    meter = DrainMeter()
    for index in range(4):
        found = meter.take(10_000 - 500 * index, index * 18 * S)
    assert found == 1_667


def test_a_silence_makes_no_drain_of_what_was_taken_meanwhile() -> None:
    meter = DrainMeter()
    assert measured(1_760, 30, meter=meter) is not None
    found = meter.take(8_000, 60 * S)
    assert found is not None
    assert found <= 1_760 * 11 // 10


def test_reports_that_come_late_or_together_make_no_number_too_great() -> None:
    of, meter = Random(7), DrainMeter()
    for _ in range(3_000):
        found = meter.take(of.choice([None, *range(0, 10_001, 100)]), of.randrange(100) * S)
        assert found is None or 0 <= found <= MOST_DRAIN
    assert LEAST_CHANGES * S < WINDOW_US


def drained_policy() -> Any:
    source = SignalSource("BATTERY_STATUS", ("battery_remaining",), 100, 1, (-1,))
    signal = Signal(DRAIN, POLICY.slots, NUMBER, "ratio", 5 * S, (), (source,))
    return replace(POLICY, signals=(*POLICY.signals, signal), slots=POLICY.slots + 1)


def test_telemetry_tells_the_drain_beside_the_charge_and_says_when_it_is_more_than_declared() -> None:
    policy = drained_policy()
    telemetry, slot = Telemetry(policy), policy.slots - 1
    declared = drained(policy.vehicle)
    for second in range(60):
        left = 100 - second * 3 * declared // 6_000
        message = mavlink.MAVLink_battery_status_message(0, 1, 1, 0, [0] * 10, 0, 0, 0, left)
        values = dict(telemetry.read("BATTERY_STATUS", message, now_us=second * S))
    assert values[BATTERY] == left * 100
    assert abs((values[slot] or 0) - 3 * declared) * 10 <= 3 * declared
    assert telemetry.notes
    assert "the way home is counted with what was measured" in telemetry.notes[-1]
