"""The measurement time of a frame: never later than the true time or the frame's arrival."""

from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from reference.stamped_link import LinkKind, StampedVehicle
from rtshcua.adapters.vehicle.source_time import APART_US, DRIFT_US, EACH_US, GAP_US, STEP_US, SourceTime
from rtshcua.codec.frames import ReceivedFrame, kind_of
from rtshcua.mavlink import dialect
from virtual.rows import rows

S = 1_000_000
UNIX_US = 1_767_225_600_000_000


class Ear:
    """Frames into a `SourceTime` whose clock is known at 10 s: the vehicle's is `offset_us` behind ours."""

    def __init__(self, offset_us: int = 6 * S) -> None:
        self.source = SourceTime()
        self.offset_us = offset_us
        self.number = 0
        self.synchronise(10 * S)

    def synchronise(self, now_us: int) -> None:
        """A round trip that takes no time."""
        ts1 = self.source.clock.due(now_us)
        if ts1 is not None:
            self.hear(mavlink.MAVLink_timesync_message((now_us - self.offset_us) * 1_000, ts1), now_us)

    def hear(self, message: Any, now_us: int, *, component: int = 1, number: int | None = None) -> int | None:
        """Receive a frame; `number` is its sequence number, by default the next one."""
        if number is None:
            number = self.number = (self.number + 1) % 256 if component == 1 else 0
        return self.source.of(ReceivedFrame(message, message.get_type(), 1, component, number, False, b""), now_us)

    def place(self, made_us: int, now_us: int, number: int | None = None) -> int | None:
        return self.hear(place((made_us - self.offset_us) // 1_000), now_us, number=number)


def place(boot_ms: int) -> Any:
    return mavlink.MAVLink_global_position_int_message(boot_ms % (1 << 32), 0, 0, 0, 0, 0, 0, 0, 0)


def gps(time_usec: int, fix: int = 3) -> Any:
    return mavlink.MAVLink_gps_raw_int_message(time_usec, fix, 0, 0, 0, 0, 0, 0, 0, 0)


def system_time(unix_us: int, boot_ms: int) -> Any:
    return mavlink.MAVLink_system_time_message(unix_us, boot_ms)


def radio() -> Any:
    return mavlink.MAVLink_radio_status_message(1, 1, 80, 1, 1, 0, 0)


def sensor(boot_ms: int) -> Any:
    return mavlink.MAVLink_distance_sensor_message(boot_ms, 0, 0, 0, 0, 0, 0, 0)


HEARTBEAT = mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 0, 3)


@rows(("message", "made_us"), [
    (place(4_000), 10 * S),
    (place(1_000), 7 * S),  # 3 s on the way
    (gps(3_900_000), 9_900_000),
    (mavlink.MAVLink_wind_cov_message(3_990_001, 0, 0, 0, 0, 0, 0, 0, 0), 9_990_001),
    (mavlink.MAVLink_attitude_message(3_999, 0, 0, 0, 0, 0, 0), 9_999_000),
    (mavlink.MAVLink_servo_output_raw_message(3_999_999, 0, 0, 0, 0, 0, 0, 0, 0, 0), 9_999_999),
    (system_time(UNIX_US, 3_800), 9_800_000),
    (mavlink.MAVLink_timesync_message(0, 3_700_000_000), 9_700_000),  # a request of the vehicle's own
])  # fmt: skip
def test_a_stamp_is_moved_to_our_clock(message: Any, made_us: int) -> None:
    ear = Ear()
    assert ear.hear(message, 10 * S) == made_us - DRIFT_US


def test_source_time_is_unknown_before_the_first_answer() -> None:
    source = SourceTime()
    assert source.unready == "the vehicle's clock is not known yet: no TIMESYNC answer"
    for number, message in enumerate([place(4_000), HEARTBEAT, gps(4_000_000), radio()]):
        frame = ReceivedFrame(message, message.get_type(), 1, 68 if number == 3 else 1, number, False, b"")
        assert source.of(frame, 10 * S) is None
    assert Ear().source.unready is None


def test_a_message_without_a_stamp_is_as_old_as_the_stamp_before_it() -> None:
    ear = Ear()
    assert ear.place(11 * S, 11 * S + 40_000) == 11 * S - 5 * DRIFT_US
    for message in (HEARTBEAT, mavlink.MAVLink_extended_sys_state_message(0, 1)):
        assert ear.hear(message, 11 * S + 90_000) == 11 * S - 5 * DRIFT_US
    ear.place(11 * S - 500_000, 11 * S + 95_000)  # an older stamp does not date the next frame
    assert ear.hear(HEARTBEAT, 11 * S + 99_000) == 11 * S - 5 * DRIFT_US


def test_an_estimate_of_the_wind_that_does_not_change_grows_old() -> None:
    """ArduCopter repeats the last estimate of a flight indefinitely: it must not count as fresh."""
    ear = Ear()

    def wind(speed: float, made_us: int) -> int | None:
        ear.place(made_us, made_us + 10_000)
        return ear.hear(mavlink.MAVLink_wind_message(10.0, speed, 0.0), made_us + 20_000)

    first = wind(3.0, 10_100_000)
    assert first is not None
    assert wind(3.0, 10_600_000) == first
    assert wind(3.0, 20_600_000) == first
    later = wind(3.1, 21_000_000)
    assert later is not None
    assert later > 20_600_000
    assert wind(3.0, 21_500_000) > later  # type: ignore[operator]


def test_burst_after_a_stall_is_as_old_as_the_stall() -> None:
    ear = Ear()
    before = ear.place(10_100_000, 10_110_000)
    assert ear.hear(HEARTBEAT, 10_990_000) == before, "it may have been sent just after"
    assert ear.hear(radio(), 10_990_000, component=68) == before
    assert ear.place(10_200_000, 10_990_000) == 10_200_000 - 4 * DRIFT_US
    assert ear.hear(HEARTBEAT, 10_990_000) == 10_200_000 - 4 * DRIFT_US
    assert ear.hear(radio(), 10_990_000, component=68) == 10_200_000 - 4 * DRIFT_US


def test_overtaken_message_has_the_age_of_its_predecessor() -> None:
    ear = Ear()
    ear.place(10_100_000, 10_110_000, number=10)
    ear.place(10_200_000, 10_210_000, number=12)
    ear.place(10_300_000, 10_310_000, number=14)
    assert ear.hear(HEARTBEAT, 10_320_000, number=11) == 10_100_000 - DRIFT_US
    assert ear.hear(HEARTBEAT, 10_320_000, number=13) == 10_200_000 - DRIFT_US
    assert ear.hear(HEARTBEAT, 10_320_000, number=15) == 10_300_000 - 2 * DRIFT_US
    held_us = 220_000 + DRIFT_US
    assert ear.hear(radio(), 10_330_000, component=68) == 10_330_000 - held_us, "the link was seen to hold one so long"


def test_overtaken_stamp_does_not_date_earlier_messages() -> None:
    ear = Ear()
    ear.place(10_100_000, 10_110_000, number=10)
    ear.place(10_300_000, 10_400_000, number=13)
    ear.hear(gps(4_000_000), 10_410_000, number=15)  # of an old fix
    ear.place(10_350_000, 10_420_000, number=14)
    assert ear.hear(HEARTBEAT, 10_430_000, number=11) == 10_100_000 - DRIFT_US
    assert ear.hear(HEARTBEAT, 10_430_000, number=16) == 10_350_000 - 2 * DRIFT_US


def test_link_delay_is_that_of_the_last_seconds() -> None:
    ear = Ear()

    def age_us(now_us: int) -> int:
        """The age given to a frame of another component."""
        at_us = ear.hear(radio(), now_us, component=68)
        assert at_us is not None
        return now_us - at_us

    for step in range(100):
        now_us = 11 * S + 100_000 * step
        ear.synchronise(now_us)
        ear.place(now_us - (700_000 if step == 20 else 30_000), now_us)
        if step == 21:
            assert age_us(now_us) < 100_000, "what came late was numbered late: it was measured late"
    ear.place(20_900_000 - 200_000, 20_950_000, number=ear.number - 2)  # an overtaken frame
    assert age_us(20_950_000) > 200_000
    for step in range(1, 40):
        now_us = 21 * S + 100_000 * step
        ear.synchronise(now_us)
        ear.place(now_us - 30_000, now_us)
    assert 30_000 < age_us(now_us) < 60_000


def test_after_a_silence_the_order_begins_anew() -> None:
    ear = Ear()
    before = ear.place(10_100_000, 10_110_000, number=100)
    number = 20  # 176 frames on, or 80 back
    assert ear.hear(HEARTBEAT, 10_110_000 + GAP_US + 1, number=number) == before
    now_us = 10_120_000 + GAP_US
    fresh = ear.place(now_us, now_us, number=21)
    assert fresh is not None
    assert now_us - fresh < 20_000
    assert ear.hear(HEARTBEAT, now_us + 1_000, number=22) == fresh
    assert ear.hear(HEARTBEAT, now_us + 2_000, number=110) == fresh, "frames in between were lost"


@rows("lost", [80, 127, 128, 200, 255, 256, 900])
def test_frame_after_a_gap_comes_after_the_backlog(lost: int) -> None:
    """After a stall the queued frames are read at once, then new ones; frames in between are lost."""
    ear = Ear()
    for step in range(5):
        ear.place(10_100_000 + 100_000 * step, 40 * S)
    behind, number = ear.source.place, ear.number + lost
    fresh = ear.place(40_010_000, 40_020_000, number=number % 256)
    assert ear.source.place > behind
    behind = ear.source.place
    assert ear.hear(HEARTBEAT, 40_030_000, number=(number + 1) % 256) == fresh
    assert ear.source.place > behind


def test_a_stamp_that_does_not_advance_is_the_same_measurement() -> None:
    ear = Ear()
    first = ear.hear(gps(3_900_000), 10 * S)
    for second in range(11, 40):
        ear.synchronise(second * S)
        ear.offset_us += 30_000  # the vehicle's clock is slow, so each answer moves its stamps later
        assert ear.hear(gps(3_900_000), second * S) == first
    assert (ear.hear(gps(33_000_000), 40 * S) or 0) > 39 * S


def test_stamp_of_zero_is_unknown() -> None:
    ear = Ear()
    sent = ear.place(10_050_000, 10_060_000)
    for now_us in (10_070_000, 10_080_000):
        assert ear.hear(gps(0), now_us) == sent


def test_ms_since_boot_wrap_after_49_days() -> None:
    wrap_us = (1 << 32) * 1_000
    ear = Ear(offset_us=20 * S - wrap_us)  # the counter turns over at 20 s of our clock
    for now_us in range(10 * S, 30 * S, 500_000):
        ear.synchronise(now_us)
        at_us = ear.place(now_us - 300_000, now_us)
        assert at_us is not None
        assert 0 <= now_us - 300_000 - at_us <= DRIFT_US * (EACH_US // STEP_US + 2) + 1_000
    before = ear.hear(place((1 << 32) - 1_000), 30 * S)
    assert before is not None
    assert 0 <= 19 * S - before < 20_000, "just before it turned over"


def test_us_since_boot_in_32_bits_wrap_after_71_minutes() -> None:
    ear = Ear(offset_us=20 * S - (1 << 32))
    servo = mavlink.MAVLink_servo_output_raw_message(1_000_000, 0, 0, 0, 0, 0, 0, 0, 0, 0)
    ear.synchronise(21 * S + 500_000)
    assert ear.hear(servo, 21 * S + 500_000) == 21 * S - DRIFT_US


def test_unix_time_is_translated_by_system_time() -> None:
    ear = Ear()
    sent = ear.place(10 * S, 10 * S)
    assert ear.hear(gps(UNIX_US + 3_900_000), 10 * S) == sent, "nothing translates it yet: when it was sent, at least"
    ear.hear(system_time(UNIX_US + 3_950_400, 3_950), 10 * S)
    assert ear.hear(gps(UNIX_US + 3_960_000), 10 * S) == 9_959_000 - DRIFT_US, "in whole ms, and early rather than late"
    assert ear.hear(gps(UNIX_US - 5 * S), 10 * S) == S - 1_000 - DRIFT_US


def test_stamp_far_ahead_is_ignored_and_triggers_a_time_request() -> None:
    ear = Ear()
    for step in range(10):
        ear.synchronise(10 * S + step * 200_000)
    now_us = 12_500_000
    assert ear.source.clock.due(now_us) is None
    sent = ear.place(12_490_000, now_us)
    assert ear.hear(gps(now_us - ear.offset_us + APART_US + 100_000), now_us) == sent
    assert ear.source.clock.due(now_us) is not None


def test_excess_clock_drift_only_raises_ages() -> None:
    ear = Ear()
    ahead_us = 50_000
    assert ear.hear(place(4_000 + ahead_us // 1_000), 10 * S) == 10 * S
    assert ear.place(10_100_000, 10_120_000) == 10_100_000 - ahead_us


def test_a_small_correction_costs_no_good_frame() -> None:
    """The clock ran 300 ms fast within a second: a later measurement never gets an earlier time."""
    ear = Ear()
    for step in range(6):
        ear.synchronise(10 * S + step * 100_000)
    before = ear.place(11 * S, 11 * S)
    ear.offset_us -= 300_000
    ear.synchronise(11_600_000)
    assert not ear.source.stepped
    times = [ear.place(now_us - 50_000, now_us) for now_us in range(11_650_000, 13 * S, 50_000)]
    assert times == sorted(times)
    assert before is not None
    assert times[0] is not None
    assert before <= times[0] <= 11_600_000


def test_a_vehicle_whose_clock_was_set_forward_is_not_believed_to_be_young() -> None:
    ear = Ear()
    for step in range(6):
        ear.synchronise(10 * S + step * 100_000)
    ear.offset_us -= 5 * S
    ear.synchronise(12 * S)
    assert ear.source.stepped
    assert ear.source.unready is None
    assert ear.place(9 * S, 12 * S + 1) == 9 * S - DRIFT_US, "3 s on the way"


def test_an_autopilot_that_started_again() -> None:
    ear = Ear()
    for step in range(6):
        ear.synchronise(10 * S + step * 100_000)
    ear.offset_us = 99 * S
    stale = ear.place(100 * S, 100 * S, number=0)
    assert stale is not None
    assert stale < 10 * S, "an old time rather than a wrong one"
    ear.synchronise(100 * S)
    assert ear.place(100_010_000, 100_010_000) == 100_010_000 - DRIFT_US
    assert ear.hear(HEARTBEAT, 100_020_000) == 100_010_000 - DRIFT_US


def test_another_component_has_a_clock_of_its_own() -> None:
    ear = Ear()
    assert ear.hear(sensor(900_000), 10_010_000, component=158) is not None, "whatever its stamp says"
    sent = ear.place(10_050_000, 10_060_000)
    assert ear.hear(sensor(900_100), 10_070_000, component=158) == sent
    later = ear.place(10_150_000, 10_160_000)
    assert ear.hear(sensor(900_100), 10_170_000, component=158) == sent, "it hangs"
    assert ear.hear(sensor(900_200), 10_170_000, component=158) == later


def test_stamps_of_addressed_messages_are_ignored() -> None:
    ear = Ear()
    sent = ear.place(10_050_000, 10_060_000)
    ping = mavlink.MAVLink_ping_message(3_000_000, 1, 1, 191)
    target = mavlink.MAVLink_set_position_target_global_int_message(
        3_000, 1, 1, 6, 0, 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    )
    assert ear.hear(ping, 10_070_000) == sent
    assert ear.hear(target, 10_070_000) == sent


def test_equal_stamps_and_growing_ones_never_go_back_on_a_steady_link() -> None:
    """The state monitor ignores older values: a better time estimate must not make it drop good frames."""
    vehicle = StampedVehicle(3, LinkKind(up_us=20_000, down_us=20_000, jitter_us=15_000, ordered=True), ppm=-20_000)
    source, last_us, dropped, count = SourceTime(), 0, 0, 0
    for arrival in vehicle.run(source, 60):
        at_us = source.of(arrival.frame, arrival.came_us)
        if arrival.frame.name == "GLOBAL_POSITION_INT" and at_us is not None:
            count += 1
            dropped += at_us < last_us
            last_us = max(last_us, at_us)
    assert count > 1_000
    assert dropped * 200 < count


links = st.builds(
    LinkKind,
    up_us=st.integers(0, 400_000),
    down_us=st.integers(0, 3_000_000),
    jitter_us=st.sampled_from([0, 1_000, 30_000, 200_000, 400_000]),
    loss=st.sampled_from([0, 0, 5, 30, 70]),
    ordered=st.booleans(),
)


@given(
    links,
    st.integers(0, 1 << 30),
    st.integers(-30_000, 9_900),
    st.sampled_from([0, 1, 3 * S, (1 << 32) * 1_000 - 5 * S]),
)
def test_age_is_never_underestimated(link: LinkKind, seed: int, ppm: int, uptime_us: int) -> None:
    """For any reordering and delay within the range of the sequence numbers (127 frames, half a second)."""
    vehicle, source = StampedVehicle(seed, link, ppm, uptime_us=uptime_us), SourceTime()
    known = 0
    for arrival in vehicle.run(source, 12):
        at_us = source.of(arrival.frame, arrival.came_us)
        if at_us is None:
            continue
        known += 1
        assert at_us <= arrival.came_us
        assert at_us <= arrival.measured_us, (arrival, at_us - arrival.measured_us)
    assert known > 10 or link.loss == 70 or link.down_us > 1_000_000


@given(st.integers(0, 1 << 30), st.integers(-1_000, 1_000))
def test_on_a_good_link_ages_are_right_to_some_ms(seed: int, ppm: int) -> None:
    """The error is the uplink delay, the allowed drift between two round trips, and for frames without a stamp
    the time since the last stamp.
    """
    vehicle, source = StampedVehicle(seed, LinkKind(loss=2), ppm), SourceTime()
    for arrival in vehicle.run(source, 12):
        at_us = source.of(arrival.frame, arrival.came_us)
        if arrival.came_us < vehicle.start_us + S:
            continue
        assert at_us is not None
        late_us = (arrival.measured_us if arrival.stamped else arrival.sent_us) - at_us
        assert 0 <= late_us < (40_000 if arrival.stamped else 400_000)


def kinds() -> list[Any]:
    every = [dialect.load().messages[name].id for name in dialect.load().messages]
    return [kind for kind in map(kind_of, every) if kind is not None]


@settings(max_examples=settings().max_examples * 2)
@given(st.data())
def test_hostile_frames_do_not_raise_or_lower_ages(data: st.DataObject) -> None:
    ear = Ear()
    now_us = 10 * S
    for _ in range(data.draw(st.integers(1, 8))):
        now_us += data.draw(st.integers(0, 3 * S))
        kind = data.draw(st.sampled_from(kinds()))
        size = kind.fields.size
        payload = data.draw(st.binary(min_size=size, max_size=size))
        try:
            message = kind.build(*kind.fields.unpack(payload))
        except (UnicodeDecodeError, ValueError):
            continue
        component = data.draw(st.sampled_from([1, 1, 1, 68, 158]))
        frame = ReceivedFrame(message, kind.name, 1, component, data.draw(st.integers(0, 255)), False, b"")
        at_us = ear.source.of(frame, now_us)
        assert at_us is None or at_us <= now_us
        ear.source.clock.due(now_us)
    assert ear.source.clock.offset_us(now_us) is not None
    at_us = ear.place(now_us, now_us)
    assert at_us is None or at_us <= now_us
