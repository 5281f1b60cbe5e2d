"""Round trips bound the vehicle's clock: the bound may be early, never late."""

from itertools import pairwise

import pytest

from rtshcua.adapters.vehicle.source_time import (
    DRIFT_US,
    EACH_US,
    FIRST_ANSWERS,
    FIRST_US,
    MISSED_US,
    RETRY_US,
    STEP_US,
    VehicleClock,
)

S = 1_000_000


def ask(clock: VehicleClock, now_us: int) -> int:
    ts1 = clock.due(now_us)
    assert ts1 is not None
    return ts1


def trip(clock: VehicleClock, sent_us: int, boot_us: int, came_us: int) -> bool:
    return clock.answer(boot_us * 1_000, ask(clock, sent_us), came_us)


@pytest.mark.parametrize(("boot_ns", "least_us"), [
    (4_000_000_000, 6 * S),
    (4_000_000_001, 6 * S - 1),  # fractions of a us are rounded against us
    (4_000_999_999, 6 * S - 1_000),
    (16_000_000_000, -6 * S),  # a vehicle that has been up for longer than we
])  # fmt: skip
def test_the_offset_is_at_least_from_sending_to_the_vehicles_reading(boot_ns: int, least_us: int) -> None:
    clock = VehicleClock()
    assert clock.offset_us(10 * S) is None
    clock.answer(boot_ns, ask(clock, 10 * S), 10 * S + 80_000)
    assert clock.offset_us(10 * S + 80_000) == least_us - DRIFT_US
    assert clock.round_trip_us == 80_000


def test_the_bound_goes_down_in_steps_for_the_clocks_may_drift() -> None:
    clock = VehicleClock()
    trip(clock, 10 * S, 4 * S, 10 * S)
    steps = {clock.offset_us(10 * S + after) for after in range(0, STEP_US, 10_000)}
    assert steps == {6 * S - DRIFT_US}, "equal stamps mean equal times while it stands"
    assert clock.next_step_us(10 * S + 10_000) == 10 * S + STEP_US
    assert clock.offset_us(10 * S + STEP_US) == 6 * S - 2 * DRIFT_US
    assert clock.offset_us(110 * S) == 6 * S - 401 * DRIFT_US, "1 % of 100 s"


def test_the_best_of_all_round_trips_counts() -> None:
    clock = VehicleClock()
    trip(clock, 10 * S, 4 * S + 5_000, 10 * S + 10_000)  # 5 ms on the way up
    trip(clock, 11 * S, 5 * S + 200_000, 11 * S + 400_000)  # 200 ms
    assert clock.offset_us(11 * S + 400_000) == 6 * S - 5_000 - 6 * DRIFT_US
    assert clock.error_us == 200_000 + 1 + 5_000 + 6 * DRIFT_US
    trip(clock, 12 * S, 6 * S + 1_000, 12 * S + 2_000)
    assert clock.offset_us(12 * S + 2_000) == 6 * S - 1_000 - DRIFT_US
    assert clock.round_trip_us == 10_000


def test_answers_that_nobody_here_asked_for_do_not_count() -> None:
    clock = VehicleClock()
    sent = ask(clock, 10 * S)
    for tc1, ts1, now_us in [
        (4 * S * 1_000, sent + 1, 10 * S),  # to another program
        (4 * S * 1_000, 5, 10 * S),
        (0, 12345, 10 * S),  # a request of the vehicle's own
        (4 * S * 1_000, 0, 10 * S),
    ]:
        assert not clock.answer(tc1, ts1, now_us)
        assert clock.offset_us(now_us) is None
    clock.answer(4 * S * 1_000, sent, 10 * S)
    again = clock.offset_us(10 * S)
    clock.answer(1, sent, 11 * S)  # the same answer for a second time, with another time in it
    assert clock.offset_us(10 * S) == again


@pytest.mark.parametrize("tc1", [0, -1, -(1 << 63)])
def test_an_answer_without_a_time_says_nothing(tc1: int) -> None:
    clock = VehicleClock()
    clock.answer(tc1, ask(clock, 10 * S), 10 * S)
    assert clock.offset_us(10 * S) is None
    assert clock.answered_us is None


def test_a_clock_that_was_set_forward_is_begun_anew() -> None:
    clock = VehicleClock()
    assert not trip(clock, 10 * S, 4 * S, 10 * S)
    assert trip(clock, 11 * S, 6 * S, 11 * S + 1_000), "an hour of ages would be too young by a second"
    assert clock.offset_us(11 * S + 1_000) == 5 * S - DRIFT_US


def test_an_autopilot_that_started_again_is_known_with_its_next_answer() -> None:
    clock = VehicleClock()
    trip(clock, 100 * S, 94 * S, 100 * S)
    assert not trip(clock, 103 * S, 1 * S, 103 * S), "what was held is too old, which does no harm"
    assert clock.offset_us(103 * S) == 102 * S - DRIFT_US


def asked_within(clock: VehicleClock, from_us: int, to_us: int) -> list[int]:
    """When it asks in this time; nothing is answered."""
    return [now_us for now_us in range(from_us, to_us, 10_000) if clock.due(now_us) is not None]


def test_time_requests_start_fast_and_then_slow_down() -> None:
    clock, now_us = VehicleClock(), 10 * S
    for _ in range(FIRST_ANSWERS):
        trip(clock, now_us, now_us - S, now_us + 5_000)
        assert clock.due(now_us + FIRST_US - 1) is None
        now_us += FIRST_US
    assert clock.due(now_us) is None
    assert clock.due(now_us - FIRST_US + EACH_US) is not None


def test_time_requests_speed_up_without_answers() -> None:
    clock, now_us = VehicleClock(), 10 * S
    for _ in range(FIRST_ANSWERS):
        trip(clock, now_us, now_us - S, now_us)
        now_us += FIRST_US
    silent = asked_within(clock, now_us, now_us + 45 * S)
    gaps = [after - before for before, after in pairwise(silent)]
    assert silent[0] == now_us - FIRST_US + EACH_US
    assert set(gaps[1:]) == {RETRY_US}, "a link that comes back is asked within this"
    assert silent[2] - (now_us - FIRST_US) <= MISSED_US + EACH_US


def test_a_vehicle_that_never_answers_is_not_flooded() -> None:
    asked = asked_within(VehicleClock(), 10 * S, 70 * S)
    assert 60 * S // RETRY_US - 20 <= len(asked) <= 60 * S // RETRY_US + 20


def test_doubt_triggers_a_bounded_number_of_time_requests() -> None:
    clock, now_us = VehicleClock(), 10 * S
    for _ in range(FIRST_ANSWERS):
        trip(clock, now_us, now_us - S, now_us)
        now_us += FIRST_US
    count = 0
    for at_us in range(now_us, now_us + 10 * S, 10_000):  # a stream whose stamps are always wrong
        clock.doubt(at_us)
        ts1 = clock.due(at_us)
        if ts1 is not None:
            count += 1
            clock.answer((at_us - S) * 1_000, ts1, at_us)
    assert 15 <= count <= 20


def test_an_answer_that_is_long_overdue_does_not_count() -> None:
    clock = VehicleClock()
    first = ask(clock, 10 * S)
    asked_within(clock, 11 * S, 40 * S)
    clock.answer(S * 1_000, first, 40 * S)
    assert clock.offset_us(40 * S) is None
