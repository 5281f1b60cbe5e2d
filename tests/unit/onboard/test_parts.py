"""The small parts of the runtime, each by itself."""

from hypothesis import given
from hypothesis import strategies as st

from reference import flat_case as flat
from reference.asking import POLICY
from reference.flat_case import MISSION
from rtshcua.model.flat.limits import MAX_VALUE
from rtshcua.onboard.ports import Readings
from rtshcua.onboard.runtime.admission import InvocationQueue
from rtshcua.onboard.runtime.dispatcher import CONSERVATIVE_US, WINDOW, RemainingLatency
from rtshcua.onboard.runtime.monitor import StateMonitor
from rtshcua.wire.request import MAX_AGE_US


def test_nothing_received_is_unknown_and_of_no_age() -> None:
    state = StateMonitor(POLICY).state(1_000)
    assert (state.values, state.ages, state.monitors) == ((None,) * flat.SLOTS, (0,) * flat.SLOTS, ())


def test_values_age_until_they_are_reported_again() -> None:
    monitor = StateMonitor(POLICY)
    monitor.update(Readings(100, ((0, 7), (1, -7))))
    monitor.update(Readings(300, ((1, None),)))
    state = monitor.state(400)
    assert (state.values[:2], state.ages[:2]) == ((7, None), (300, 100))


def test_a_frame_that_comes_late_is_set_aside() -> None:
    monitor = StateMonitor(POLICY)
    monitor.update(Readings(300, ((0, 7),)))
    monitor.update(Readings(200, ((0, 8),)))
    assert monitor.state(400).values[0] == 7


def test_ages_saturate_at_both_ends() -> None:
    monitor = StateMonitor(POLICY)
    monitor.update(Readings(500, ((0, 1),)))
    assert monitor.state(400).ages[0] == 0
    assert monitor.state(1 << 60).ages[0] == MAX_AGE_US


def test_what_is_beyond_all_sense_is_unknown() -> None:
    monitor = StateMonitor(POLICY)
    monitor.update(Readings(0, ((0, MAX_VALUE), (flat.SLOTS, 1), (-1, 1))))
    assert monitor.state(0).values == (MAX_VALUE, *(None,) * (flat.SLOTS - 1))
    monitor.update(Readings(0, ((0, -MAX_VALUE - 1),)))
    assert monitor.state(0).values[0] is None


def test_the_queue_releases_step_by_step_and_phase_by_phase() -> None:
    queue = InvocationQueue(MISSION)
    assert (queue.released_us, queue.phase) == (None, 0)
    queue.release(10)
    queue.release(20)
    assert queue.released_us == 10
    seen = []
    while (current := queue.current) is not None:
        seen.append((current.step, queue.phase))
        queue.advance(30 + current.step)
    assert seen == [(0, 0), (1, 1), (2, 1), (3, 2)]
    assert (queue.released_us, queue.phase) == (33, 2)


def test_the_remaining_latency_is_conservative_until_measured() -> None:
    remaining = RemainingLatency()
    assert remaining.us == CONSERVATIVE_US
    for _ in range(7):
        remaining.measured(10)
    assert remaining.us == CONSERVATIVE_US
    remaining.measured(-5)
    assert remaining.us == 10
    remaining.measured(90_000)
    assert remaining.us == 90_000


def test_a_first_slow_dispatch_counts_at_once() -> None:
    remaining = RemainingLatency()
    remaining.measured(2 * CONSERVATIVE_US)
    assert remaining.us == 2 * CONSERVATIVE_US


@given(st.lists(st.integers(0, 10**6), min_size=8, max_size=3 * WINDOW))
def test_the_quantile_is_that_of_the_latest(took: list[int]) -> None:
    remaining = RemainingLatency()
    for each in took:
        remaining.measured(each)
    latest = took[-WINDOW:]
    covered = sum(each <= remaining.us for each in latest)
    assert remaining.us in latest
    assert covered * 100 >= 99 * len(latest)
