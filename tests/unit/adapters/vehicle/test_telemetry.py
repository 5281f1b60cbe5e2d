"""Telemetry becomes integers in canonical units, or "not known"."""

from itertools import pairwise
from math import inf, nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.vehicle.preflight import distance_from_home
from rtshcua.adapters.vehicle.source_time import SourceTime
from rtshcua.adapters.vehicle.telemetry import Telemetry, UnknownSource
from rtshcua.codec.frames import ReceivedFrame
from rtshcua.decision.prepare import prepare
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import NUMBER, Signal, SignalSource
from rtshcua.onboard.ports import Readings
from rtshcua.onboard.runtime.monitor import StateMonitor
from virtual.policy import BATTERY, FIX, HEIGHT, LINK, POLICY, POSITION_X, PROJECTION, WIND
from virtual.rows import rows

S = 1_000_000
HOME = (PROJECTION.latitude, PROJECTION.longitude)


def battery(percent: int) -> Any:
    return mavlink.MAVLink_battery_status_message(0, 0, 0, 0, [0] * 10, 0, 0, 0, percent)


def position(latitude: int, longitude: int, height: int = 20_000) -> Any:
    return mavlink.MAVLink_global_position_int_message(0, latitude, longitude, 0, height, 0, 0, 0, 0)


def wind(north: float, east: float) -> Any:
    return mavlink.MAVLink_wind_cov_message(0, north, east, 0, 0, 0, 0, 0, 0)


@rows(("message", "values"), [
    (battery(57), {BATTERY: 5_700}),
    (battery(-1), {BATTERY: None}),
    (position(*HOME), {HEIGHT: 20_000, POSITION_X: 0, POSITION_X + 1: 0}),
    (position(HOME[0] + 900, HOME[1], -50), {HEIGHT: -50, POSITION_X: 0, POSITION_X + 1: 10_018}),
    (position(0, 0), {HEIGHT: 20_000, POSITION_X: None, POSITION_X + 1: None}),
    (wind(3.0, -4.0), {WIND: 5_000}),
    (wind(nan, 1.0), {WIND: None}),
    (wind(1.0, inf), {WIND: None}),
    (wind(3e38, 0.0), {WIND: None}),
    (mavlink.MAVLink_wind_message(10.0, 2.5, 0.0), {WIND: 2_500}),
    (mavlink.MAVLink_radio_status_message(1, 1, 80, 1, 1, 0, 0), {LINK: 8_000}),
    (mavlink.MAVLink_radio_status_message(1, 1, 255, 1, 1, 0, 0), {LINK: None}),
    (mavlink.MAVLink_gps_raw_int_message(0, 2, 0, 0, 0, 0, 0, 0, 0, 0), {FIX: 2}),
    (mavlink.MAVLink_ping_message(0, 0, 0, 0), {}),
])  # fmt: skip
def test_reads_what_the_policy_declares(message: Any, values: dict[int, int | None]) -> None:
    telemetry = Telemetry(POLICY)
    telemetry.read(message.get_type(), message)  # a battery counts from its second report on
    read = dict(telemetry.read(message.get_type(), message))
    assert {slot: value and round(value, -1) for slot, value in read.items()} == {
        slot: value and round(value, -1) for slot, value in values.items()
    }
    assert all(value is None or type(value) is int for value in read.values())


def test_position_is_continuous_across_longitude_180() -> None:
    there = replace(PROJECTION, longitude=1_799_999_000)
    east = Telemetry(replace(POLICY, projection=there))
    here = Telemetry(POLICY)
    for step in range(-3000, 3000, 250):
        crossing = there.longitude + step
        wrapped = crossing - 3_600_000_000 if crossing > 1_800_000_000 else crossing
        message = position(HOME[0], wrapped)
        expected = position(HOME[0], PROJECTION.longitude + step)
        assert east.read("GLOBAL_POSITION_INT", message) == here.read("GLOBAL_POSITION_INT", expected)
        assert distance_from_home(there, HOME[0], wrapped) == distance_from_home(PROJECTION, HOME[0], expected.lon)
    beyond = dict(east.read("GLOBAL_POSITION_INT", position(HOME[0], 1_800_000_001)))
    assert beyond[POSITION_X] is beyond[POSITION_X + 1] is None, "no longitude is beyond 180 degrees"


def test_asks_often_enough_for_what_grows_stale_and_no_oftener_than_useful() -> None:
    rates = Telemetry(POLICY).rates
    assert rates["GLOBAL_POSITION_INT"].asked == 100_000  # stale after 500 ms, and used to observe effects
    assert rates["BATTERY_STATUS"].asked == 1_000_000  # stale after 5 s
    assert frozenset({"WIND_COV", "WIND"}) in Telemetry(POLICY).sources


def test_the_distance_from_home() -> None:
    assert distance_from_home(PROJECTION, *HOME) == 0
    assert abs(distance_from_home(PROJECTION, HOME[0] + 8_983, HOME[1]) - 100_000) < 20


AUTOPILOT, COMPANION = 1, 191


def radio(rssi: int) -> Any:
    return mavlink.MAVLink_radio_status_message(1, 1, rssi, 1, 1, 0, 0)


def test_position_and_charge_come_only_from_the_autopilot() -> None:
    telemetry = Telemetry(POLICY)
    assert telemetry.read("BATTERY_STATUS", battery(99), COMPANION) == ()
    assert telemetry.read("GLOBAL_POSITION_INT", position(*HOME), COMPANION) == ()


def test_another_component_does_not_replace_what_the_autopilot_reports() -> None:
    telemetry = Telemetry(POLICY)
    assert telemetry.read("WIND_COV", wind(3.0, 4.0), COMPANION) == ((WIND, 5_000),)
    own = mavlink.MAVLink_wind_message(10.0, 12.0, 0.0)
    assert telemetry.read("WIND", own) == ((WIND, 12_000),)
    assert telemetry.read("WIND_COV", wind(3.0, 4.0), COMPANION) == ()


def test_the_radio_speaks_where_the_autopilot_does_not() -> None:
    assert Telemetry(POLICY).read("RADIO_STATUS", radio(80), 68) == ((LINK, 8_000),)


def one_of(number: int, percent: int, function: int = 0) -> Any:
    return mavlink.MAVLink_battery_status_message(number, function, 0, 0, [0] * 10, 0, 0, 0, percent)


def charge(telemetry: Telemetry, number: int, percent: int, function: int = 0, at_us: int = 0) -> Any:
    """The charge after one battery report; () if the report does not change it."""
    return telemetry.read("BATTERY_STATUS", one_of(number, percent, function), now_us=at_us)


def test_of_several_flight_batteries_the_one_with_the_least_charge_counts() -> None:
    for function in (mavlink.MAV_BATTERY_FUNCTION_UNKNOWN, mavlink.MAV_BATTERY_FUNCTION_ALL,
                     mavlink.MAV_BATTERY_FUNCTION_PROPULSION):  # fmt: skip
        telemetry = Telemetry(POLICY)
        assert charge(telemetry, 0, 81, function) == charge(telemetry, 1, 21, function) == ()
        assert charge(telemetry, 0, 80, function) == (), "it is not known yet whether there is another"
        assert charge(telemetry, 1, 20, function) == ((BATTERY, 2_000),)
        assert charge(telemetry, 0, 79, function) == ((BATTERY, 2_000),)
        assert charge(telemetry, 1, -1, function) == ((BATTERY, None),)
        assert charge(telemetry, 0, 79, function) == ((BATTERY, None),)
        assert telemetry.batteries.notes == [
            "the vehicle has 2 batteries: 0 with 80 %, 1 with 20 %, and the one with the least charge counts"
        ]


def test_a_battery_that_feeds_no_motor_does_not_count() -> None:
    telemetry = Telemetry(POLICY)
    for _ in range(2):
        assert charge(telemetry, 0, 5, mavlink.MAV_BATTERY_FUNCTION_PAYLOAD) == ()
        flying = charge(telemetry, 1, 80, 1)
        assert charge(telemetry, 2, -1, mavlink.MAV_BATTERY_FUNCTION_AVIONICS) == ()
    assert flying == ((BATTERY, 8_000),)
    assert telemetry.batteries.summary == (
        "0 with 5 % (payload, which does not count), 1 with 80 %, 2 with an unknown charge (avionics, which does not "
        "count)"
    )


STALE_US = next(each.stale_us for each in POLICY.signals if each.slot == BATTERY)


def test_a_flight_battery_that_falls_silent_makes_the_charge_unknown() -> None:
    telemetry = Telemetry(POLICY)
    for _ in range(2):
        charge(telemetry, 0, 80)
        charge(telemetry, 1, 70)
    for _ in range(2):
        assert charge(telemetry, 0, 79, at_us=STALE_US + 1) == ((BATTERY, 7_000),), "the other may still come"
    assert charge(telemetry, 0, 79, at_us=STALE_US + 1) == ((BATTERY, None),)
    assert charge(telemetry, 1, 60, at_us=STALE_US + 1) == ((BATTERY, 6_000),)


@pytest.mark.parametrize("function", [mavlink.MAV_BATTERY_FUNCTION_ALL, mavlink.MAV_BATTERY_FUNCTION_PAYLOAD])
def test_single_report_of_a_new_battery_is_ignored(function: int) -> None:
    """A foreign frame on a link without a key, or an odd one of the vehicle; also one that reports that the
    battery feeds no motor. Such a frame every other minute is no battery either.
    """
    telemetry = Telemetry(POLICY)
    charge(telemetry, 0, 80)
    telemetry.batteries.armed = True
    for second in range(1, 300):
        if second % 70 == 5:
            assert charge(telemetry, 7, 1, function, second * S) == ()
            assert charge(telemetry, 0, 1, mavlink.MAV_BATTERY_FUNCTION_PAYLOAD, second * S) == ()
        assert charge(telemetry, 0, 80, 1, second * S) == ((BATTERY, 8_000),)
    assert telemetry.batteries.notes == []


@pytest.mark.parametrize("every", [6, 7, 10, 30, 60])
def test_staleness_of_a_battery_follows_its_report_interval(every: int) -> None:
    """A smart battery on a slow bus, or a link that loses its reports."""
    telemetry, said = Telemetry(POLICY), dict[int, Any]()
    for second in range(5 * every):
        if second % every == 0 and second < 4 * every:
            charge(telemetry, 1, 5, at_us=second * S)
        said[second] = charge(telemetry, 0, 90, at_us=second * S)
    begun = every
    assert {said[each] for each in range(begun)} == {()}, "until it is known whether it counts nothing is"
    assert {said[each] for each in range(begun, 4 * every)} == {((BATTERY, 500),)}
    for second in range(5 * every, 8 * every + 1):
        said[second] = charge(telemetry, 0, 90, at_us=second * S)
    ends = 3 * every + min(3 * every, 60)
    assert said[ends] == ((BATTERY, 500),), "the next one may still come"
    assert {said[each] for each in range(ends + 1, 8 * every)} == {((BATTERY, None),)}


def test_new_battery_before_arming_is_awaited_for_one_minute() -> None:
    telemetry = Telemetry(POLICY)
    assert [charge(telemetry, 0, 90, at_us=second * S) for second in (0, 1)] == [(), ((BATTERY, 9_000),)]
    assert charge(telemetry, 7, 5, at_us=2 * S) == ((BATTERY, None),)
    for second in range(3, 200):
        known = charge(telemetry, 0, 90, at_us=second * S)
        assert known == ((BATTERY, None if second <= 62 else 9_000),)
        assert telemetry.batteries.awaited(second * S) == (7 if second <= 62 else None)
        if second == 100:
            charge(telemetry, 7, 5, at_us=second * S)


Reports = list[tuple[int, int, int | None]]


def silent(reports: Reports, battery: int, heard: int, until: int, most_us: int) -> bool:
    """Whether a battery whose report is the one at `heard` is silent when that at `until` comes."""
    others = [each for each in reports[heard + 1 : until + 1] if each[1] != battery]
    return len(others) >= 3 and reports[until][0] - reports[heard][0] > most_us


def usual(reports: Reports, battery: int) -> int | None:
    """The usual interval between reports of a battery; None if the battery does not count."""
    own = [index for index, each in enumerate(reports) if each[1] == battery]
    apart = [
        (reports[after][0] - reports[before][0], silent(reports, battery, before, after, STALE_US))
        for before, after in pairwise(own)
    ]
    counting = [number for number, (us, lost) in enumerate(apart) if us <= 60 * S or not lost]
    if not counting:
        return None
    times = sorted(us for us, _ in apart[counting[0] :][-5:])
    return times[(len(times) - 1) // 2]


def naive(reports: Reports, armed: list[bool], *, begun: bool) -> Any:
    """The charge after the last of these reports (time, battery, charge), from all of them; () if unchanged. `begun`:
    one before said something.
    """
    last = {battery: index for index, (_, battery, _) in enumerate(reports)}
    often = {battery: usual(reports, battery) for battery in last}
    now = len(reports) - 1

    def known(battery: int, index: int) -> bool:
        """Whether it is known whether a battery counts."""
        if often[battery] is not None or len([each for each in reports if each[1] == battery]) > 1:
            return True
        over = armed[-1] or reports[now][0] - reports[index][0] > 60 * S
        return over and silent(reports, battery, index, now, STALE_US)

    if not (begun and armed[-1]) and not all(known(*each) for each in last.items()):
        return ((BATTERY, None),) if begun else ()
    if often[reports[-1][1]] is None:
        return ()
    charges = []
    for battery, index in last.items():
        us = often[battery]
        if us is not None:
            lost = silent(reports, battery, index, now, max(STALE_US, min(3 * us, 60 * S)))
            charges.append(None if lost else reports[index][2])
    if None in charges:
        return ((BATTERY, None),)
    return ((BATTERY, min(each * 100 for each in charges if each is not None)),)


@given(st.lists(st.tuples(
    st.sampled_from([0, S, 2 * S, STALE_US, STALE_US + 1, 20 * S, 60 * S + 1]), st.sampled_from([0, 0, 1, 2, 3]),
    st.sampled_from([None, 20, 50, 90]), st.sampled_from([False, False, False, True]),
), max_size=20))  # fmt: skip
def test_charge_matches_the_naive_battery_model(steps: list[tuple[int, int, int | None, bool]]) -> None:
    telemetry, reports, armed, at_us, begun = Telemetry(POLICY), Reports(), list[bool](), 0, False
    for later_us, number, percent, arms in steps:
        at_us += later_us
        reports.append((at_us, number, percent))
        armed.append(arms or armed[-1:] == [True])
        telemetry.batteries.armed = armed[-1]
        said = charge(telemetry, number, -1 if percent is None else percent, at_us=at_us)
        assert said == naive(reports, armed, begun=begun)
        begun = begun or said != ()


def test_a_signal_may_name_one_battery() -> None:
    index = next(number for number, each in enumerate(POLICY.signals) if each.slot == BATTERY)
    charge = POLICY.signals[index]
    signals = list(POLICY.signals)
    signals[index] = replace(charge, sources=(replace(charge.sources[0], where=(("id", 1),)),))
    telemetry = Telemetry(replace(POLICY, signals=tuple(signals)))
    assert telemetry.read("BATTERY_STATUS", one_of(0, 20)) == ()
    assert telemetry.read("BATTERY_STATUS", one_of(1, 70)) == ((BATTERY, 7_000),)
    assert telemetry.read("BATTERY_STATUS", one_of(0, 10)) == ()


def test_range_finder_is_chosen_by_orientation() -> None:
    """Also if the downward one has the lower number; each has its own values."""

    def sees(instance: int, orientation: int, cm: int) -> Any:
        return mavlink.MAVLink_distance_sensor_message(0, 20, 4_000, cm, 0, instance, orientation, 0)

    ahead = SignalSource("DISTANCE_SENSOR", ("current_distance",), 10, 1, (), (("orientation", 0),))
    down = replace(ahead, where=(("orientation", 25),))
    signals = tuple(
        Signal(name, 20 + number, NUMBER, "length", 1_000_000, (), (source,))
        for number, (name, source) in enumerate((("ahead", ahead), ("down", down)))
    )
    telemetry = Telemetry(replace(POLICY, signals=(*POLICY.signals, *signals), slots=22))
    assert telemetry.read("DISTANCE_SENSOR", sees(0, 25, 150)) == ((21, 1_500),)
    assert telemetry.read("DISTANCE_SENSOR", sees(3, 0, 900)) == ((20, 9_000),)
    assert telemetry.read("DISTANCE_SENSOR", sees(2, 0, 800)) == ((20, 8_000),)
    assert telemetry.read("DISTANCE_SENSOR", sees(3, 0, 900)) == (), "the lowest number that looks ahead counts"
    assert telemetry.read("DISTANCE_SENSOR", sees(1, 12, 100)) == ()


@pytest.mark.parametrize("source", ["BATTERY_STATUS.nope", "NO_SUCH.x", "BATTERY_STATUS.voltages", "STATUSTEXT.text"])
def test_non_numeric_source_is_refused(source: str) -> None:
    message, field = source.split(".")
    (first, *others) = POLICY.signals
    read = replace(first, sources=(SignalSource(message, (field,), 1, 1, ()),))
    with pytest.raises(UnknownSource, match=f"`{source}`"):
        Telemetry(replace(POLICY, signals=(read, *others)))


def test_value_without_a_number_is_unknown() -> None:
    message = battery(50)
    message.battery_remaining = "50"
    telemetry = Telemetry(POLICY)
    telemetry.read("BATTERY_STATUS", message)
    assert telemetry.read("BATTERY_STATUS", message) == ((BATTERY, None),)


def gps(fix: int, at_us: int) -> Any:
    return mavlink.MAVLink_gps_raw_int_message(at_us, fix, 0, 0, 0, 0, 0, 0, 0, 0)


class Held:
    """The state monitor's values after frames in order; the vehicle started with our clock."""

    def __init__(self, policy: Policy) -> None:
        prepared = prepare(policy)
        assert not isinstance(prepared, Refusal)
        self._telemetry, self._source, self._monitor = Telemetry(policy), SourceTime(), StateMonitor(prepared)
        self._number = 0

    def hear(self, message: Any, now_us: int) -> tuple[int | None, int]:
        """The fix, and its age."""
        ts1 = self._source.clock.due(now_us)
        if ts1 is not None:
            self._of(mavlink.MAVLink_timesync_message(now_us * 1_000, ts1), now_us)
        at_us = self._of(message, now_us)
        assert at_us is not None
        self._monitor.update(Readings(at_us, self._telemetry.read(message.get_type(), message)))
        state = self._monitor.state(now_us)
        return state.values[FIX], state.ages[FIX]

    def _of(self, message: Any, now_us: int) -> int | None:
        self._number = (self._number + 1) % 256
        return self._source.of(ReceivedFrame(message, message.get_type(), 1, 1, self._number, False, b""), now_us)


def test_repeated_measurement_keeps_its_age() -> None:
    """A hanging receiver: the autopilot repeats its last measurement and fix."""
    held = Held(POLICY)
    assert held.hear(gps(3, S), S)[0] == 3
    for now_us in range(S, 60 * S, S // 5):
        fix, age_us = held.hear(gps(3, S), now_us)
        assert (fix, 0 <= age_us - (now_us - S) < 20_000) == (3, True)
    assert held.hear(gps(3, 60 * S), 60 * S)[1] < 20_000


def test_stamp_of_zero_is_unknown() -> None:
    held = Held(POLICY)
    for now_us in range(S, 10 * S, S // 5):
        fix, age_us = held.hear(gps(3, 0), now_us)
        assert (fix, age_us < S + 20_000) == (3, True), "as old as the last answer to TIMESYNC"


def test_repeated_no_fix_report_is_fresh() -> None:
    """ArduPilot reports a lost fix with the time of the last fix."""
    assert Held(POLICY).hear(gps(1, S), S)[0] == 1
    unknown = replace(POLICY.signals[2], sources=(SignalSource("GPS_RAW_INT", ("fix_type",), 1, 1, (0, 1, 2)),))
    for policy, none in (
        (POLICY, 1),
        (replace(POLICY, signals=(*POLICY.signals[:2], unknown, *POLICY.signals[3:])), None),
    ):
        held = Held(policy)
        assert held.hear(gps(3, S), S)[0] == 3
        for _ in range(2):
            assert held.hear(gps(1, S), S + 100_000)[0] == none


def test_unconfirmed_values_are_unknown() -> None:
    telemetry = Telemetry(POLICY)
    somewhere = position(*HOME)
    lost = telemetry.read("GLOBAL_POSITION_INT", somewhere, AUTOPILOT, frozenset({"lat", "lon"}))
    assert dict(lost) == {HEIGHT: 20_000, POSITION_X: None, POSITION_X + 1: None}
    every = frozenset(somewhere.fieldnames)
    assert dict(telemetry.read("GLOBAL_POSITION_INT", somewhere, AUTOPILOT, every))[HEIGHT] is None


def test_missing_wind_estimate_is_unknown() -> None:
    telemetry = Telemetry(POLICY)
    assert telemetry.read("WIND", mavlink.MAVLink_wind_message(-180.0, 0.0, 0.0)) == ((WIND, None),)
    assert telemetry.read("WIND", mavlink.MAVLink_wind_message(0.0, 0.0, 0.0)) == ((WIND, 0),)
    assert telemetry.read("WIND", mavlink.MAVLink_wind_message(-180.0, 2.0, 0.0)) == ((WIND, 2_000),)
