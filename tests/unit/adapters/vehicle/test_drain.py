"""The drain of the charge per minute, measured from reports in whole percent."""

from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from reference import flat_case
from rtshcua.adapters.vehicle.drain import (
    LEAST_CHANGES,
    WINDOW_US,
    Consumption,
    DrainMeter,
    PaceMeter,
    drained,
    for_a_km,
)
from rtshcua.adapters.vehicle.telemetry import Telemetry
from rtshcua.decision.contracts import Energy
from rtshcua.decision.flying import MINUTE, MOST_DRAIN, over_ground
from rtshcua.model.flat.policy import Speeds
from rtshcua.model.flat.signal import DRAIN, NUMBER, Signal, SignalSource
from virtual.policy import BATTERY, POLICY, PROJECTION

S = 1_000_000


def measured(
    rate: int, seconds: int, *, start: int = 10_000, every_us: int = S, meter: DrainMeter | None = None
) -> int | None:
    """The drain measured after so many seconds at `rate` (1/10000 per minute), reported in percent."""
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


def test_drain_needs_several_changes_of_charge() -> None:
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


@given(st.integers(20, 190), st.integers(0, 99), st.sampled_from([100, 200, 500]))
def test_a_slow_drain_is_measured_once_the_charge_changed_often_enough(rate: int, start: int, step: int) -> None:
    """From 0.2 % a minute on, reported in any steps: accurate to a tenth at the end, and known from then on."""
    meter, known = DrainMeter(), 0
    each_s = step * 60 // rate + 1
    for second in range(0, 8 * each_s, max(1, each_s // 40)):
        left = 10_000 - start - rate * second // 60
        found = meter.take(left // step * step, second * S)
        known += found is not None
        assert found is not None or not known, "and stays known"
        assert found is None or found <= rate * 11 // 10 + 1
    assert found is not None
    assert abs(found - rate) * 10 <= rate + 10, (rate, found)


@given(st.integers(1, 12), st.integers(3, 20))
def test_ended_drain_is_bounded_by_charge_taken_plus_one_step(changes_s: int, count: int) -> None:
    meter = DrainMeter()
    for number in range(count + 1):
        meter.take(10_000 - 100 * number, number * changes_s * S)
    ended, left = count * changes_s, 10_000 - 100 * count
    for later in range(1, 61):
        found = meter.take(left, (ended + later) * S)
        in_window = [n * changes_s for n in range(1, count + 1) if ended + later - n * changes_s <= 60]
        first = min([*in_window, (count - 2) * changes_s])
        steps = (ended - first) // changes_s + 1
        assert found is not None
        assert found <= -(-100 * steps * 60 // (ended + later - first))
    assert meter.take(left, (ended + 61) * S) is None


def test_a_fall_at_once_is_a_finding_and_no_drain() -> None:
    meter = DrainMeter()
    known = measured(1_000, 50, meter=meter)
    assert known is not None
    assert meter.take(4_000, 51 * S) == known, "what was measured last is told until a new one is known"
    assert meter.take(5_000, 52 * S) == known, "nor is a rise"
    assert meter.take(None, 53 * S) is None
    assert meter.take(5_000, 54 * S) == known, "nor does a report without a charge end it"
    assert meter.take(5_000, 113 * S) is None, "but that it stands does"


@pytest.mark.parametrize(("every", "rise"), [(5, 200), (5, 300), (10, 100), (20, 100)])
def test_a_charge_that_rises_now_and_then_is_drained_all_the_same(every: int, rise: int) -> None:
    """An estimate from voltage does this; the drain was never or seldom known."""
    meter, known = DrainMeter(), list[int]()
    for second in range(300):
        left = (10_000 - 1_760 * second // 60) // 100 * 100
        found = meter.take(left + rise * (second % every == every - 1), second * S)
        assert found is not None or second < 20
        known += [] if found is None else [found]
    assert all(abs(each - 1_760) * 5 <= 1_760 for each in known[20:])


def test_drain_accepts_steps_of_at_most_ten_percent() -> None:
    meter, known = DrainMeter(), list[int | None]()
    for second in range(200):
        known.append(meter.take(-(-(10_000 - 1_760 * second // 60) // 1_000) * 1_000, second * S))
    assert known[-1] is not None
    assert abs(known[-1] - 1_760) * 10 <= 1_760
    meter = DrainMeter()
    assert {meter.take(10_000 - 1_100 * (second // 40), second * S) for second in range(200)} == {None}


def naive(reports: list[tuple[int, int | None]]) -> int | None:
    """The drain known after the last of these reports (time, charge), computed from all of them."""
    known = [(at_us, charge) for at_us, charge in reports if charge is not None]
    since = last = 0  # the last jump or pause of the charge, and its minimum
    rate, often = None, 0
    for now, (at_us, charge) in enumerate(known):
        least = min(each for _, each in known[last:now]) if now > last else charge
        fallen_us = next(us for us, each in known[last:] if each == least)
        gap_us = at_us - known[max(now - 1, 0)][0]
        step = 1_000 if at_us - fallen_us >= 5 * S else (at_us - fallen_us) * 200 // S
        if charge - least > 300 or least - charge > max(500 + 200 * gap_us // S, step):
            since = last = now
            fallen_us, least = at_us, charge
        elif charge < least:
            fallen_us, least = at_us, charge
        fell = [
            (us, each) for number, (us, each) in enumerate(known[: now + 1])
            if number > since and each < min(before for _, before in known[last:number])
        ]  # fmt: skip
        counted = [each for each in fell if at_us - each[0] <= 60 * S]
        counted = counted if len(counted) > 3 else fell[-3:]
        if len(counted) > 1:
            often = (counted[-1][0] - counted[0][0]) // (len(counted) - 1)
        if at_us - fallen_us > max(60 * S, 2 * often):
            rate = None
            if len(counted) > 1:
                since, counted = now, []
        if len(counted) >= 3:
            (first_us, before), (last_us, after) = counted[0], counted[-1]
            taken, us = before - after, last_us - first_us
            more = taken + -(-taken // (len(counted) - 1))
            rate = min(
                600_000 if us <= 0 else min(-(-amount * 60 * S // us), 600_000)
                for amount, us in ((taken, us), (more, at_us - first_us))
            )
    return rate if reports[-1][1] is not None else None


@given(st.lists(st.tuples(
    st.sampled_from([0, S, S, 2 * S, 5 * S, 30 * S]),
    st.sampled_from([None, 0, 0, 100, 100, 200, 500, 501, 1_000, 1_500, -100, -300, -301]),
), max_size=30))  # fmt: skip
def test_the_drain_is_what_the_least_charges_tell(steps: list[tuple[int, int | None]]) -> None:
    meter, reports, at_us, charge = DrainMeter(), list[tuple[int, int | None]](), 0, 10_000
    for later_us, fell in steps:
        at_us += later_us
        charge -= fell or 0
        reports.append((at_us, None if fell is None else charge))
        assert meter.take(reports[-1][1], at_us) == naive(reports)


@given(st.integers(400, 3_000), st.lists(st.integers(0, 300), min_size=1, max_size=40))
def test_no_rise_of_up_to_three_percent_hides_a_drain(rate: int, rises: list[int]) -> None:
    """In any pattern, if one report in four has the true value."""
    meter, known = DrainMeter(), False
    for second in range(100):
        left = 10_000 - rate * second // 60
        found = meter.take(left + (rises[second % len(rises)] if second % 4 else 0), second * S)
        assert found is not None or not known, "and it stays known"
        known = known or found is not None
    assert found is not None
    assert abs(found - rate) * 5 <= rate + 100, (rate, found)


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


def legs(meter: PaceMeter, *speeds: int, seconds: int = 60, climb: int = 0) -> tuple[int, int]:
    """The measured pace of flight at these speeds over ground (mm/s), reported ten times a second."""
    x = at_us = 0
    for speed in speeds:
        for _ in range(seconds * 10):
            meter.move(x, 0, climb * at_us // S, at_us)
            x, at_us = x + speed // 10, at_us + S // 10
    return meter.flown(0)


def test_pace_is_measured_only_in_steady_level_flight() -> None:
    time_us, way = legs(PaceMeter(), 0, 5_000, 0, 4_000)
    assert 100 * S <= time_us <= 120 * S
    assert 4_400 <= way * S // time_us <= 4_600
    assert legs(PaceMeter(), 900) == (0, 1), "drifting is no leg"
    assert legs(PaceMeter(), 5_000, climb=1_000) == (0, 1)
    up_and_down = [1_000, 2_500, 4_000, 2_500] * 20
    assert legs(PaceMeter(), *up_and_down, seconds=1) == (0, 1), "nor is setting off and arriving"
    assert legs(PaceMeter(), 5_000, seconds=10) == (0, 1), "and that is too short"


def test_a_place_that_is_not_known_or_too_old_begins_anew() -> None:
    for lost in (None, 0):
        meter = PaceMeter()
        legs(meter, 5_000, seconds=20)
        flown = meter.flown(0)
        meter.move(lost, lost, lost, 40 * S)
        meter.move(900_000, 0, 0, 41 * S)
        meter.move(905_000, 0, 0, 42 * S)
        meter.move(0, 0, 0, 30 * S)  # arrived late
        assert meter.flown(0) == flown


def flown_with(
    policy: Any, speed: int, rate: int, *, seconds: int = 120, asked: int = 0
) -> tuple[Consumption, int | None]:
    """The state after a leg at a speed over ground and a drain of `rate` a minute, reported in whole percent."""
    of, found = Consumption(policy.vehicle), None
    of.fly(asked)
    for second in range(seconds):
        of.move(second * speed, 0, 20_000, second * S)
        found = of.take((10_000 - rate * second // 60) // 100 * 100, second * S)
    return of, found


SPEEDS = Speeds(
    cruise=8_000, flight_us=16 * 60 * S, air=10_000, wind=5_000, homeward=8_000, acceleration=2_000,
    climb=2_000, descent=1_500, landing=500, landing_below=10_000,
)  # fmt: skip


@pytest.mark.parametrize(("asked", "counted_at"), [(0, 5_000), (3_000, 3_000), (6_000, 5_000)])
def test_slow_progress_raises_the_drain_of_the_return(asked: int, counted_at: int) -> None:
    """With more wind than declared, the drain per minute is as declared, but the drain per metre is higher."""
    policy = replace(POLICY, vehicle=replace(POLICY.vehicle, speeds=SPEEDS))
    assert over_ground(SPEEDS, asked or SPEEDS.homeward) == counted_at
    declared = drained(policy.vehicle)
    of, found = flown_with(policy, counted_at, declared, asked=asked)
    assert found is not None
    assert found * 10 <= declared * 11, "as declared"
    assert of.notes == []
    assert Consumption(policy.vehicle).summary == ()
    slow = counted_at * 2 // 5
    of, found = flown_with(policy, slow, declared, asked=asked)
    assert found is not None
    assert abs(found * 2 - declared * 5) * 10 <= declared * 5
    per_km = for_a_km(policy.vehicle, slow)
    assert abs(of.for_a_km[0] - per_km) * 5 <= per_km
    assert len(of.notes) == 1
    assert "of its charge for a km over ground" in of.notes[0]
    minute, km = of.summary
    assert minute.startswith(f"{declared / 100:.1f} % a minute declared, ")
    assert km.startswith(f"{for_a_km(policy.vehicle, counted_at) / 100:.1f} % a km declared, ")
    assert km.endswith(f"{of.for_a_km[0] / 100:.1f} % measured")
    assert all(len(line) <= 69 for line in of.summary)
    energy = Energy(flat_case.CONTRACTS[flat_case.GOTO], policy.vehicle, asked)
    for distance in (0, 100_000, 2_000_000):
        assert energy.way_home(distance, (0, 0), found) >= distance * per_km * 9 // 10 // 1_000_000


def test_fast_progress_does_not_lower_the_drain_per_minute() -> None:
    policy = replace(POLICY, vehicle=replace(POLICY.vehicle, speeds=SPEEDS))
    of, found = flown_with(policy, 9_000, 1_760)
    assert found is not None
    assert abs(found - 1_760) * 10 <= 1_760
    assert "of its charge a minute" in of.notes[-1]


def drained_policy() -> Any:
    source = SignalSource("BATTERY_STATUS", ("battery_remaining",), 100, 1, (-1,))
    signal = Signal(DRAIN, POLICY.slots, NUMBER, "ratio", 5 * S, (), (source,))
    return replace(POLICY, signals=(*POLICY.signals, signal), slots=POLICY.slots + 1)


def test_telemetry_reports_drain_and_warns_above_the_declared_value() -> None:
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
    assert "the way home is computed with the measured value" in telemetry.notes[-1]


def test_telemetry_counts_the_way_over_ground_too() -> None:
    policy = drained_policy()
    vehicle = replace(policy.vehicle, speeds=SPEEDS)
    telemetry, slot = Telemetry(replace(policy, vehicle=vehicle)), policy.slots - 1
    declared, north = drained(vehicle), PROJECTION.latitude
    for second in range(120):
        where = mavlink.MAVLink_global_position_int_message(
            0, north + second * 180, PROJECTION.longitude, 0, 20_000, 0, 0, 0, 0
        )  # about 2 m/s where 5 m/s are declared
        telemetry.read("GLOBAL_POSITION_INT", where, now_us=second * S)
        left = 100 - second * declared // 6_000
        message = mavlink.MAVLink_battery_status_message(0, 1, 1, 0, [0] * 10, 0, 0, 0, left)
        values = dict(telemetry.read("BATTERY_STATUS", message, now_us=second * S + 10))
    assert abs((values[slot] or 0) * 2 - 5 * declared) * 5 <= 5 * declared
    assert "for a km over ground" in telemetry.notes[-1]
