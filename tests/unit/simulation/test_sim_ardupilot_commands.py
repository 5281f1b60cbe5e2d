"""Answers of the simulated ArduCopter, compared with a recorded session (4.7.0-dev)."""

from collections.abc import Callable
from math import nan
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from recorded.trace import SECOND, Trace
from rtshcua.model.faults import FlightMode


@pytest.fixture
def copter(pilot: Callable[..., Any]) -> Any:
    return pilot("ardupilot").ready()


@pytest.fixture
def flying(copter: Any) -> Any:
    copter.take_off(10)
    return copter


@pytest.mark.parametrize(
    ("command", "params", "expected"),
    [
        (511, (33, 200_000), [0]),
        (511, (193, 1_000_000), [0]),
        (511, (230, 1_000_000), [2]),  # PX4's estimator message
        (512, (148,), [0]),
        (512, (242,), [0]),
        (512, (9999,), [4]),
        (9, (), [3]),
        (186, (12, 3), [3]),
        (34, (10, 2), [3]),
        (22, (0, 0, 0, 0, 0, 0, 10), [4]),  # disarmed
        (176, (1, 99), [4]),
        (176, (1, 5), [0]),
        (176, (1, 17), [0]),
        (176, (0, 5), [2]),
        (400, (1,), [0]),
        (400, (0,), [0]),
        (178, (1, 3, -1), [0]),
        (300, (), [4]),
        (20, (), [0]),
        (21, (), [0]),
        (512, (nan,), [4]),
    ],
)
def test_command_results_on_the_ground(
    copter: Any, command: int, params: tuple[float, ...], expected: list[int]
) -> None:
    assert copter.long(command, *params) == expected


@pytest.mark.parametrize(
    ("mode", "number"),
    [
        (FlightMode.GUIDED, 4),
        (FlightMode.LOITER, 5),
        (FlightMode.RETURN, 6),
        (FlightMode.LAND, 9),
        (FlightMode.BRAKE, 17),
        (FlightMode.MANUAL, 0),
    ],
)
def test_custom_modes_are_entered(copter: Any, mode: FlightMode, number: int) -> None:
    assert copter.mode(mode) == [0]
    copter.wait(1)
    assert copter.last("HEARTBEAT").custom_mode == number


def test_arming_before_ready_fails_with_a_text(pilot: Callable[..., Any]) -> None:
    early = pilot("ardupilot", station=False)
    assert early.arm() == [4]
    assert early.texts() == ["Arm: Accels inconsistent"]


@pytest.mark.parametrize("mode", [FlightMode.LAND, FlightMode.RETURN, FlightMode.BRAKE])
def test_arming_is_refused_in_modes_that_do_not_allow_it(copter: Any, mode: FlightMode) -> None:
    copter.mode(mode)
    assert copter.arm() == [4]
    assert copter.texts()[-1].endswith("mode not armable")


def test_takeoff_in_loiter_is_accepted_without_effect(copter: Any) -> None:
    copter.mode(FlightMode.LOITER)
    assert copter.arm() == [0]
    assert copter.long(22, 0, 0, 0, 0, 0, 0, 10) == [0]
    copter.wait(5)
    assert not copter.truth.in_air


@pytest.mark.parametrize(("frame", "result"), [(0, 2), (5, 2), (10, 2), (3, 0), (6, 0)])
def test_takeoff_requires_a_relative_frame(copter: Any, frame: int, result: int) -> None:
    copter.mode(FlightMode.GUIDED)
    copter.arm()
    assert copter.int(22, frame, [0, 0, 0, 0], 0, 0, 10) == [result]
    copter.wait(3)
    assert not copter.truth.in_air, "the motors run up first"
    copter.wait(1)
    assert copter.truth.in_air is (result == 0)


def test_command_results_in_the_air(flying: Any) -> None:
    assert flying.truth.mode is FlightMode.GUIDED
    assert flying.arm() == [0]
    assert flying.long(400, 0) == [4]
    assert flying.long(22, 0, 0, 0, 0, 0, 0, 20) == [4]
    assert flying.long(115, 90, 20, 1) == [0]
    assert flying.truth.armed


@pytest.mark.parametrize(("frame", "altitude"), [(3, 12), (6, 12), (None, 12), (0, 600), (5, 600)])
def test_reposition_honours_the_frame(flying: Any, frame: int | None, altitude: float) -> None:
    latitude, longitude = flying.config.home.globe(20, 0)
    up = altitude if altitude < 100 else 12.0
    altitude = up if altitude < 100 else up + flying.config.home.amsl_mm / 1000
    if frame is None:
        assert flying.long(192, -1, 0, 0, 0, latitude / 1e7, longitude / 1e7, altitude) == [0]
    else:
        assert flying.int(192, frame, [-1, 0, 0, 0], latitude, longitude, altitude) == [0]
    flying.wait(15)
    assert abs(flying.truth.north_mm - 20_000) < 800
    assert abs(flying.truth.up_mm - 12_000) < 300


@pytest.mark.parametrize(("frame", "moves"), [(6, True), (3, True), (5, True), (10, False)])
def test_position_target_honours_the_frame(flying: Any, frame: int, moves: bool) -> None:
    latitude, longitude = flying.config.home.globe(20, 0)
    altitude = 10 + flying.config.home.amsl_mm / 1000 if frame == 5 else 10
    flying.target(latitude, longitude, altitude, frame=frame)
    flying.wait(15)
    assert (abs(flying.truth.north_mm - 20_000) < 300) is moves
    assert abs(flying.truth.up_mm - 10_000) < 300


def test_position_target_is_ignored_on_the_ground_and_outside_guided(copter: Any) -> None:
    latitude, longitude = copter.config.home.globe(20, 0)
    copter.mode(FlightMode.GUIDED)
    copter.arm()
    copter.target(latitude, longitude, 10)
    copter.wait(4)
    assert not copter.truth.in_air
    copter.long(22, 0, 0, 0, 0, 0, 0, 10)
    copter.wait(10)
    copter.mode(FlightMode.LOITER)
    copter.target(latitude, longitude, 10)
    copter.wait(5)
    assert abs(copter.truth.north_mm) < 300


def test_pause_and_brake_stop_the_vehicle(flying: Any) -> None:
    for stop in (lambda: flying.long(193, 0), lambda: flying.mode(FlightMode.BRAKE)):
        flying.mode(FlightMode.GUIDED)
        flying.go_to(flying.truth.north_mm / 1000 + 100, 0, 10)
        flying.wait(5)
        assert flying.truth.speed_mm_s > 4_000
        assert stop() == [0]
        flying.wait(5)
        assert flying.truth.speed_mm_s < 150
        assert flying.long(193, 1) == [0 if flying.truth.mode is FlightMode.GUIDED else 4]


def test_pause_keeps_mode_and_later_targets(flying: Any) -> None:
    flying.long(511, 87, 100_000)
    flying.go_to(200, 0, 10)
    flying.wait(5)
    asked = flying.last("POSITION_TARGET_GLOBAL_INT")
    assert flying.long(193, 0) == [0]
    flying.wait(6)
    assert (flying.truth.mode, flying.truth.speed_mm_s < 150) == (FlightMode.GUIDED, True)
    assert flying.last("POSITION_TARGET_GLOBAL_INT").lat_int == asked.lat_int
    north = flying.truth.north_mm
    flying.go_to(0, 100, 10)
    flying.wait(5)
    assert abs(flying.truth.north_mm - north) < 300, "a target that comes in a pause is not flown to"
    assert flying.last("POSITION_TARGET_GLOBAL_INT").lat_int != asked.lat_int, "but it is kept"
    assert flying.long(193, 2) == [2]
    assert flying.long(193, 1) == [0]
    flying.wait(5)
    assert flying.truth.east_mm > 5_000


def speeds(name: str) -> dict[float, int]:
    """Recorded northward speeds in cm/s, by seconds after the greatest one."""
    reports = [h for h in Trace(name, wall=True).of_vehicle if h.name == "GLOBAL_POSITION_INT"]
    since_us = max(reports, key=lambda each: int(each.message.vx)).at_us
    return {(h.at_us - since_us) / SECOND: h.message.vx for h in reports}


def steer(pilot: Any, north_m_s: float) -> list[Any]:
    velocity = (0, 1, 1, 1, 0x0DC7, 0, 0, 0, north_m_s, 0, 0, 0, 0, 0, 0, 0)
    received: list[Any] = pilot.send(mavlink.MAVLink_set_position_target_local_ned_message(*velocity))
    return received


def leg_at_5_6_m_s(flying: Any) -> None:
    for message in (33, 87):
        flying.long(511, message, 100_000)
    flying.go_to(250, 0, 10)
    flying.wait(1)
    flying.long(178, 1, 5.6, -1)
    flying.wait(5)
    assert flying.truth.speed_mm_s == pytest.approx(5_600, abs=200)


@pytest.mark.parametrize("name", ["arducopter-velocity-takeover", "arducopter-pause-takeover"])
def test_velocity_or_pause_in_a_leg_matches_the_recording(flying: Any, name: str) -> None:
    """From 5.6 m/s. The mode stays; a velocity ends the target report, a pause keeps it."""
    leg_at_5_6_m_s(flying)
    real, told, velocity = speeds(name), [], "velocity" in name
    for tenth in range(70):
        if velocity and tenth < 40:
            steer(flying, -3)
        elif not velocity and tenth == 0:
            assert flying.long(193, 0) == [0]
        told += [f for f in flying.wait(0.1) if f.name == "POSITION_TARGET_GLOBAL_INT"]
        seconds = (tenth + 1) / 10
        then = real[min(real, key=lambda at, seconds=seconds: abs(at - seconds))]
        assert flying.last("GLOBAL_POSITION_INT").vx == pytest.approx(then, abs=120 if velocity else 75), seconds
    assert flying.last("HEARTBEAT").custom_mode == 4
    assert len(told) == (0 if velocity else 70)


def test_velocity_expires_without_renewal(flying: Any) -> None:
    """GUID_TIMEOUT: 3 s after the last one. Other modes than GUIDED ignore it."""
    flying.mode(FlightMode.BRAKE)
    steer(flying, 3)
    flying.wait(2)
    assert flying.truth.speed_mm_s < 100
    flying.mode(FlightMode.GUIDED)
    steer(flying, 3)
    flying.wait(2.5)
    assert flying.truth.speed_mm_s > 2_500
    flying.wait(4)
    assert flying.truth.speed_mm_s < 150


def test_local_target_is_flown_to(flying: Any) -> None:
    flying.send(mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 0x0DF8, 20, 5, -12, *[0.0] * 8))
    flying.wait(15)
    assert (flying.truth.north_mm, flying.truth.east_mm) == pytest.approx((20_000, 5_000), abs=500)


def test_target_is_reported_in_modes_that_have_one(copter: Any) -> None:
    def told() -> list[Any]:
        return [f.message for f in copter.wait(1) if f.name == "POSITION_TARGET_GLOBAL_INT"]

    assert copter.long(511, 87, 200_000) == [0]
    copter.take_off(10)
    assert not told(), "none in a takeoff"
    copter.go_to(80, 0, 12)
    assert len(told()) in (5, 6)
    target = told()[-1]
    assert (target.coordinate_frame, target.type_mask) == (0, 0xFDF8)
    assert target.alt == pytest.approx(copter.config.home.amsl_mm / 1000 + 12, abs=0.01)
    assert (target.lat_int, target.lon_int) == copter.config.home.globe(80, 0)
    copter.mode(FlightMode.LOITER)
    assert not told(), "none in LOITER"
    copter.mode(FlightMode.GUIDED)
    assert not told(), "none before one is given"
    copter.mode(FlightMode.RETURN)
    assert told()
    copter.mode(FlightMode.LAND)
    assert not told()


def test_selecting_the_current_mode_has_no_effect(flying: Any) -> None:
    flying.go_to(100, 0, 10)
    flying.wait(5)
    assert flying.mode(FlightMode.GUIDED) == [0]
    flying.wait(5)
    assert flying.truth.speed_mm_s > 4_000
    assert flying.mode(FlightMode.LOITER) == [0]
    assert flying.long(17) == [0]


def test_set_mode_message_is_acknowledged_with_its_own_number(flying: Any) -> None:
    answers = flying.send(mavlink.MAVLink_set_mode_message(1, 1, 9))
    assert [(f.message.command, f.message.result) for f in answers if f.name == "COMMAND_ACK"] == [(11, 0)]
    assert flying.truth.mode is FlightMode.LAND


def test_default_streams_are_heartbeat_timesync_and_radio(copter: Any) -> None:
    copter.wait(20)
    assert {frame.name for frame in copter.seen} == {"HEARTBEAT", "RADIO_STATUS", "TIMESYNC"}
    asked = [frame.message for frame in copter.seen if frame.name == "TIMESYNC"]
    assert [(m.tc1, m.ts1 % 10) for m in asked] == [(0, 1)] * len(asked)
    assert len(asked) in (2, 3), "every 10 s, its system id added to its time"


def test_data_stream_request_overrides_an_interval(copter: Any) -> None:
    def count(name: str) -> int:
        return sum(frame.name == name for frame in copter.wait(2))

    copter.long(511, 33, 50_000)
    assert count("GLOBAL_POSITION_INT") in (40, 41)
    copter.send(mavlink.MAVLink_request_data_stream_message(1, 1, mavlink.MAV_DATA_STREAM_ALL, 5, 1))
    assert count("GLOBAL_POSITION_INT") in (10, 11)
    copter.send(mavlink.MAVLink_request_data_stream_message(1, 1, mavlink.MAV_DATA_STREAM_ALL, 5, 0))
    assert count("GLOBAL_POSITION_INT") == 0


def test_speed_set_before_the_first_target_is_lost(flying: Any) -> None:
    assert flying.long(178, 1, 2, -1) == [0]
    flying.go_to(100, 0, 10)
    flying.wait(6)
    assert flying.truth.speed_mm_s > 4_500, "`pos_control_start` takes WPNAV_SPEED again, as recorded"
    assert flying.long(178, 1, 2, -1) == [0]
    flying.go_to(200, 0, 10)
    flying.wait(6)
    assert flying.truth.speed_mm_s < 2_200
