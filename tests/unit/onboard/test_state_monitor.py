"""The values that the state monitor keeps of the frames."""

from reference import flat_case as flat
from reference.asking import POLICY
from rtshcua.model.flat.limits import MAX_VALUE
from rtshcua.onboard.ports import Readings
from rtshcua.onboard.runtime.monitor import StateMonitor
from rtshcua.wire.request import MAX_AGE_US


def test_missing_signal_is_unknown_with_age_zero() -> None:
    state = StateMonitor(POLICY).state(1_000)
    assert (state.values, state.ages, state.monitors) == ((None,) * flat.SLOTS, (0,) * flat.SLOTS, ())


def test_values_age_until_they_are_reported_again() -> None:
    monitor = StateMonitor(POLICY)
    monitor.update(Readings(100, ((0, 7), (1, -7))))
    monitor.update(Readings(300, ((1, None),)))
    state = monitor.state(400)
    assert (state.values[:2], state.ages[:2]) == ((7, None), (300, 100))


def test_older_report_is_dropped() -> None:
    monitor = StateMonitor(POLICY)
    monitor.update(Readings(300, ((0, 7),)))
    monitor.update(Readings(200, ((0, 8),)))
    assert monitor.state(400).values[0] == 7


def test_ages_saturate_at_both_ends() -> None:
    monitor = StateMonitor(POLICY)
    monitor.update(Readings(500, ((0, 1),)))
    assert monitor.state(400).ages[0] == 0
    assert monitor.state(1 << 60).ages[0] == MAX_AGE_US


def test_a_value_beyond_64_bits_is_unknown() -> None:
    monitor = StateMonitor(POLICY)
    monitor.update(Readings(0, ((0, MAX_VALUE), (flat.SLOTS, 1), (-1, 1))))
    assert monitor.state(0).values == (MAX_VALUE, *(None,) * (flat.SLOTS - 1))
    monitor.update(Readings(0, ((0, -MAX_VALUE - 1),)))
    assert monitor.state(0).values[0] is None


def test_ages_are_the_same_where_every_slot_was_reported() -> None:
    monitor = StateMonitor(POLICY)
    monitor.update(Readings(500, tuple((slot, 1) for slot in range(flat.SLOTS))))
    monitor.update(Readings(700, ((0, 1),)))
    assert monitor.state(700).ages == (0, *(200,) * (flat.SLOTS - 1))
    assert monitor.state(600).ages == (0, *(100,) * (flat.SLOTS - 1))
    assert monitor.state(500 + MAX_AGE_US).ages == (MAX_AGE_US - 200, *(MAX_AGE_US,) * (flat.SLOTS - 1))
    assert monitor.state(501 + MAX_AGE_US).ages == (MAX_AGE_US - 199, *(MAX_AGE_US,) * (flat.SLOTS - 1))
    assert monitor.state(700 + 2 * MAX_AGE_US).ages == (MAX_AGE_US,) * flat.SLOTS
