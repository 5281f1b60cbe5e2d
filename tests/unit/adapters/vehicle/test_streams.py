"""Streams are planned for the capacity of a link, and their delivery is measured."""

from typing import Any

import pytest

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.streams import MEASURE_US, SHARE, StreamRequests, frame_octets, plan_streams
from rtshcua.codec.frames import Codec
from rtshcua.decision.rates import Rate
from rtshcua.mavlink.framing import SIGNATURE

S = 1_000_000
POSITION, TIME = "GLOBAL_POSITION_INT", "SYSTEM_TIME"
RATES = {POSITION: Rate(100_000, 250_000), "GPS_RAW_INT": Rate(50_000, 100_000), "HEARTBEAT": Rate(100_000, S)}


def test_message_size_is_counted_as_sent() -> None:
    beat = Codec(1, 191).pack(messages.heartbeat())
    assert frame_octets("HEARTBEAT", signed=False) == len(beat) == 21
    assert frame_octets("HEARTBEAT", signed=True) == 21 + SIGNATURE
    assert frame_octets(POSITION, signed=False) == 12 + 28
    assert frame_octets("GPS_RAW_INT", signed=False) == 12 + 52, "its extensions are sent too"


def test_with_room_for_all_each_comes_as_asked() -> None:
    plan = plan_streams(RATES, None, signed=False)
    assert plan.intervals == {name: rate.asked for name, rate in RATES.items()}
    assert plan.octets == 40 * 10 + 64 * 20 + 21 * 10
    assert plan.least == 40 * 4 + 64 * 10 + 21
    assert plan.fits
    assert plan_streams(RATES, 5_760, signed=False) == (plan.intervals, plan.octets, plan.least, 5_760)


@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("capacity", [1_200, 1_500, 1_920, 5_760])
def test_stream_plan_fits_the_link_and_the_required_rates(capacity: int, signed: bool) -> None:
    plan = plan_streams(RATES, capacity, signed=signed)
    for name, rate in RATES.items():
        assert rate.asked <= plan.intervals[name] <= rate.suffices
    if plan.fits:
        assert plan.octets <= capacity * SHARE // 100
        assert plan.shortfall is None


def test_overloaded_link_names_sufficient_baud_rate() -> None:
    plan = plan_streams(RATES, 960, signed=True)
    assert not plan.fits
    assert plan.shortfall is not None
    assert "carries 960 octets" in plan.shortfall
    assert str(plan.least) in plan.shortfall
    assert plan.shortfall.endswith("; 19200 baud would")


class Line:
    """A line of limited capacity: excess frames are dropped. It delivers requested and unrequested streams."""

    def __init__(self, capacity: int | None, unasked: dict[str, int]) -> None:
        self.plan = plan_streams(RATES, capacity, signed=False)
        self.streams = StreamRequests(self.plan, ())
        self.every = dict(unasked)
        self.asked: list[tuple[str, int]] = []
        self.now_us = self.room = 0

    def run(self, seconds: float) -> None:
        capacity = self.plan.capacity or 1_000_000
        for _ in range(round(seconds * 100)):
            self.now_us += S // 100
            self.room = min(self.room + capacity // 100, 512)
            for name, us in self.every.items():
                octets = frame_octets(name, signed=False)
                if us > 0 and self.now_us % us < S // 100 and octets <= self.room:
                    self.room -= octets
                    self.streams.heard(name, self.now_us, octets)
            for message in self.streams.due(1, self.now_us):
                self._obey(message)
                self.streams.answered(True, self.now_us)

    def _obey(self, message: Any) -> None:
        names = {messages.number_of(name): name for name in (*RATES, *self.every)}
        name = names[int(message.param1)]
        self.asked.append((name, int(message.param2)))
        self.every[name] = int(message.param2)


def test_delivered_rates_are_measured_and_noted_once() -> None:
    line = Line(None, {})
    line.run(3 * MEASURE_US / S)
    assert line.streams.measured is not None
    octets, came = line.streams.measured
    assert abs(octets - line.plan.octets) < line.plan.octets // 20
    assert abs(came["GPS_RAW_INT"] - 50_000) < 2_000
    assert line.streams.notes == [f"streams: 1890 bytes/s requested, {octets} bytes/s received in all"]


def test_other_rates_that_are_needed_under_way_are_asked_for() -> None:
    line = Line(None, {})
    line.run(2 * MEASURE_US / S)
    before = len(line.asked)
    line.streams.replan(plan_streams({**RATES, "HEARTBEAT": Rate(50_000, S)}, None, signed=False))
    line.run(1)
    assert line.asked[before:] == [("HEARTBEAT", 50_000)], "the others are as they were"
    line.streams.replan(plan_streams(RATES, 960, signed=False))
    assert "carries 960 octets" in line.streams.notes[-1]


def test_unrequested_streams_are_turned_off_for_lack_of_room() -> None:
    """As PX4 does on a companion's port: its own streams fill the line."""
    line = Line(2_400, {"ATTITUDE_QUATERNION": 20_000, "HIGHRES_IMU": 20_000, "TIMESYNC": 100_000})
    line.run(4 * MEASURE_US / S)
    assert ("HIGHRES_IMU", -1) in line.asked
    assert ("ATTITUDE_QUATERNION", -1) in line.asked
    assert all(name != "TIMESYNC" for name, _ in line.asked), "that is an answer"
    assert any("turned off on this link" in note for note in line.streams.notes)
    line.run(3 * MEASURE_US / S)
    assert line.streams.measured is not None
    octets, came = line.streams.measured
    assert octets <= 2_400
    assert came["GPS_RAW_INT"] < 60_000


@pytest.mark.parametrize(("capacity", "unasked"), [(None, 20_000), (92_160, 20_000), (5_760, 1_000_000)])
def test_unrequested_streams_with_room_are_left_on(capacity: int | None, unasked: int) -> None:
    """A ground station may use the same streams."""
    line = Line(capacity, {"HIGHRES_IMU": unasked})
    line.run(4 * MEASURE_US / S)
    assert all(interval >= 0 for _, interval in line.asked)
