"""Answers of the simulated PX4, compared with a recorded session (v1.16.0)."""

import struct
from collections.abc import Callable
from itertools import pairwise
from math import nan
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.model.faults import FlightMode
from virtual.sampling import each_once

AMSL = 488.0
LOITER, TAKEOFF, RETURN, LAND = 50593792, 33816576, 84148224, 100925440


@pytest.fixture
def px4(pilot: Callable[..., Any]) -> Any:
    return pilot("px4").ready()


@pytest.fixture
def flying(px4: Any) -> Any:
    px4.take_off(10)
    return px4


@pytest.mark.parametrize(
    ("command", "params", "expected"),
    [
        (511, (33, 200_000), [0]),
        (511, (230, 1_000_000), [0]),
        (511, (193, 1_000_000), [4]),  # ArduPilot's estimator message
        (511, (0, 100_000), [4]),  # the heartbeat's rate is fixed
        (511, (436, 100_000), [0]),
        (512, (436,), [2]),
        (512, (0,), [0]),
        (512, (87,), [2]),  # no content yet
        (512, (148,), [0]),
        (512, (242,), [0]),
        (512, (9999,), [2]),
        (9, (), [3]),
        (193, (0,), [3]),
        (115, (90, 20, 1), [3]),
        (300, (), [2]),
        (176, (1, 99), [0, 0]),
        (176, (1, 4, 99), [0, 1]),
        (176, (1, 4, 3), [0, 0]),
        (176, (1, 6), [0, 1]),  # offboard without a stream of targets
        (400, (1,), [0]),
        (400, (0,), [0]),
        (22, (-1, 0, 0, nan, nan, nan, AMSL + 10), [0]),
        (178, (1, 3, -1), [0]),
        (186, (AMSL + 12,), [0]),
        (520, (1,), [0]),
        (20, (), [0]),
        (21, (), [0]),
        (176, (1, nan, nan), [0, 0]),
        (512, (nan,), [2]),
    ],
)
def test_command_results_on_the_ground(px4: Any, command: int, params: tuple[float, ...], expected: list[int]) -> None:
    assert px4.long(command, *params) == expected


def test_custom_modes_are_entered(px4: Any) -> None:
    for mode, number in [
        (FlightMode.LOITER, LOITER),
        (FlightMode.TAKEOFF, TAKEOFF),
        (FlightMode.RETURN, RETURN),
        (FlightMode.LAND, LAND),
    ]:
        assert px4.mode(mode) == [0, 0]
        px4.wait(1)
        assert px4.last("HEARTBEAT").custom_mode == number


def test_unknown_modes_have_no_effect(px4: Any) -> None:
    px4.long(176, 1, 99)
    px4.long(176, 1, 4, 99)
    px4.wait(1)
    assert px4.last("HEARTBEAT").custom_mode == LOITER


def test_arming_before_ready_is_temporarily_rejected(pilot: Callable[..., Any]) -> None:
    early = pilot("px4")
    assert early.arm() == [1]
    assert not early.truth.armed
    assert early.ready().arm() == [0]


def test_takeoff_while_disarmed_begins_when_armed(px4: Any) -> None:
    assert px4.long(22, -1, 0, 0, nan, nan, nan, AMSL + 10) == [0]
    px4.wait(5)
    assert (px4.truth.mode, px4.truth.in_air) == (FlightMode.TAKEOFF, False)
    assert px4.arm() == [0]
    px4.until(lambda: px4.truth.mode is FlightMode.LOITER)
    assert abs(px4.truth.up_mm - 10_000) < 900, "the mode changes a little before the height is reached"


def test_takeoff_altitude_is_above_sea(px4: Any) -> None:
    assert px4.arm() == [0]
    assert px4.long(22, -1, 0, 0, nan, nan, nan, 10) == [0]  # 478 m below the ground
    px4.wait(5)
    assert not px4.truth.in_air


def test_takeoff_without_altitude_uses_the_parameter(px4: Any) -> None:
    assert px4.arm() == [0]
    assert px4.long(22, -1, 0, 0, nan, nan, nan, nan) == [0]
    px4.until(lambda: px4.truth.mode is FlightMode.LOITER)
    px4.wait(3)
    assert abs(px4.truth.up_mm - 2_500) < 200


def test_takeoff_in_the_air_climbs_from_the_current_height(flying: Any) -> None:
    """`Takeoff::set_takeoff_position`: the height of NAV_TAKEOFF is used once, even if the takeoff was interrupted."""
    before_mm = flying.truth.up_mm
    assert flying.long(22, -1, 0, 0, nan, nan, nan, AMSL + before_mm // 1_000 + 20) == [0]
    flying.wait(1)
    flying.mode(FlightMode.LOITER)
    flying.wait(3)
    held_mm = flying.truth.up_mm
    flying.mode(FlightMode.TAKEOFF)
    flying.until(lambda: flying.truth.mode is FlightMode.LOITER)
    flying.wait(3)
    assert abs(flying.truth.up_mm - held_mm - 2_500) < 200


def test_armed_vehicle_on_the_ground_disarms(px4: Any) -> None:
    px4.arm()
    px4.wait(9)
    assert px4.truth.armed
    px4.wait(2)
    assert not px4.truth.armed


def test_command_results_in_the_air(flying: Any) -> None:
    assert flying.arm() == [0]
    assert flying.long(400, 0) == [1]
    assert flying.truth.armed


def unflagged(flying: Any) -> list[int]:
    """Send it 20 m north by DO_REPOSITION without the flag that changes the mode."""
    latitude, longitude = flying.config.home.globe(20, 0)
    answers: list[int] = flying.int(192, 5, [-1, 0, 0, nan], latitude, longitude, AMSL + 10)
    return answers


def test_reposition_without_flag_is_unsupported_but_flown_in_hold(flying: Any) -> None:
    """Recorded: answer 3, then target and vehicle follow."""
    assert unflagged(flying) == [3]
    flying.wait(0.3)
    assert targets(flying.wait(0.3))[-1].lat_int == pytest.approx(flying.config.home.globe(20, 0)[0], abs=2)
    flying.wait(8)
    assert flying.truth.north_mm == pytest.approx(20_000, abs=1_000)


@pytest.mark.parametrize("mode", [FlightMode.LAND, FlightMode.RETURN, FlightMode.POSITION, FlightMode.TAKEOFF])
def test_reposition_without_its_flag_changes_no_mode(flying: Any, mode: FlightMode) -> None:
    """Only `Loiter::on_active` uses it, for half a second at most."""
    if mode is FlightMode.TAKEOFF:
        flying.long(22, 0, 0, 0, nan, nan, nan, AMSL + 30)
    else:
        flying.mode(mode)
    assert unflagged(flying) == [3]
    flying.wait(1)
    assert flying.truth.mode is mode
    flying.mode(FlightMode.LOITER)
    flying.wait(8)
    assert abs(flying.truth.north_mm) < 1_000


def test_entering_hold_flies_to_a_recent_reposition_target(flying: Any) -> None:
    flying.mode(FlightMode.LAND)
    unflagged(flying)
    flying.wait(0.3)
    flying.mode(FlightMode.LOITER)
    flying.wait(8)
    assert flying.truth.north_mm == pytest.approx(20_000, abs=1_000)


def test_later_release_answers_reposition_by_its_effect(pilot: Callable[..., Any]) -> None:
    flying = pilot("px4", release=(1, 18)).ready()
    flying.take_off(10)
    assert unflagged(flying) == [0]
    flying.mode(FlightMode.LAND)
    assert unflagged(flying) == [1]
    flying.wait(0.2)
    assert flying.truth.mode is FlightMode.LAND


@pytest.mark.parametrize("frame", [0, 3, 5, 6, 10])
def test_reposition_reads_every_frame_as_above_sea(flying: Any, frame: int) -> None:
    latitude, longitude = flying.config.home.globe(20, 0)
    assert flying.int(192, frame, [-1, 1, 0, nan], latitude, longitude, AMSL + 15) == [0]
    flying.wait(15)
    assert abs(flying.truth.north_mm - 20_000) < 300
    assert abs(flying.truth.up_mm - 15_000) < 300


def test_reposition_keeps_a_missing_altitude_or_place(flying: Any) -> None:
    flying.go_to(40, 0, 10)
    flying.wait(4)
    assert flying.int(192, 5, [-1, 1, 0, nan], 2**31 - 1, 2**31 - 1, nan) == [0]
    flying.wait(8)
    where = flying.truth
    assert where.speed_mm_s < 50
    assert 10_000 < where.north_mm < 30_000
    assert abs(where.up_mm - 10_000) < 300


def test_reposition_on_the_ground_is_acknowledged_without_effect(px4: Any) -> None:
    latitude, longitude = px4.config.home.globe(20, 0)
    assert px4.int(192, 5, [-1, 1, 0, nan], latitude, longitude, AMSL + 10) == [0]
    px4.wait(5)
    assert not px4.truth.in_air
    assert any("Reposition" in text for text in px4.texts())


def test_position_targets_fly_only_in_offboard(flying: Any) -> None:
    latitude, longitude = flying.config.home.globe(30, 0)
    for _ in range(10):
        flying.target(latitude, longitude, 10)
        flying.wait(0.2)
    assert abs(flying.truth.north_mm) < 500
    assert flying.long(176, 1, 6) == [0, 0]
    for _ in range(60):
        flying.target(latitude, longitude, 10)
        flying.wait(0.2)
    assert abs(flying.truth.north_mm - 30_000) < 300
    assert flying.truth.mode is FlightMode.GUIDED
    flying.wait(1.5)
    assert flying.truth.mode is FlightMode.LOITER


def test_set_mode_message_is_obeyed_and_never_acknowledged(flying: Any) -> None:
    assert all(f.name != "COMMAND_ACK" for f in flying.send(mavlink.MAVLink_set_mode_message(1, 1, LAND)))
    assert flying.truth.mode is FlightMode.LAND


def test_no_texts_before_a_ground_station_heartbeat(pilot: Callable[..., Any]) -> None:
    alone = pilot("px4", station=False)
    assert alone.arm() == [1]
    alone.ready().arm()
    alone.wait(1)
    assert alone.texts() == []


def test_streams_run_by_default(px4: Any) -> None:
    names = {frame.name for frame in px4.seen}
    assert {"GLOBAL_POSITION_INT", "ESTIMATOR_STATUS", "EXTENDED_SYS_STATE", "DISTANCE_SENSOR"} <= names
    assert not {"EKF_STATUS_REPORT", "WIND", "WIND_COV"} & names


def test_heartbeat_interval_is_constant(flying: Any) -> None:
    flying.wait(0.98)
    times = []
    for turn in range(500):
        if turn == 120:
            assert flying.long(511, 0, 100_000) == [4]
        if turn == 170:
            flying.mode(FlightMode.LAND)
        times += [flying.simulation.now_us for frame in flying.wait(0.02) if frame.name == "HEARTBEAT"]
    assert {after - before for before, after in pairwise(times)} == {1_000_000}


def test_requested_heartbeat_shows_a_new_mode_15_ms_late(flying: Any) -> None:
    """Recorded: Land was acknowledged at 2 ms, and a requested heartbeat showed Hold at 7 ms."""
    asked = mavlink.MAVLink_command_long_message(1, 1, 512, 0, 0, 0, 0, 0, 0, 0, 0)
    flying.mode(FlightMode.LAND)
    for wait, mode in ((0.005, LOITER), (0.009, LOITER), (0.001, LAND)):
        flying.wait(wait)
        answers = flying.send(asked)
        assert [f.name for f in answers] == ["HEARTBEAT", "COMMAND_ACK"]
        assert answers[0].message.custom_mode == mode


def test_land_cancelled_within_the_lag_hardly_shows(flying: Any) -> None:
    """Recorded: no heartbeat, landed state or target shows it."""
    latitude, longitude = flying.config.home.globe(20, 0)
    flying.wait(0.001)
    flying.mode(FlightMode.LAND)
    flying.wait(0.009)
    flying.int(192, 5, [-1, 1, 0, nan], latitude, longitude, AMSL + 10)
    told = flying.wait(5)
    assert {f.message.landed_state for f in told if f.name == "EXTENDED_SYS_STATE"} == {2}
    assert {f.message.custom_mode for f in told if f.name == "HEARTBEAT"} == {LOITER}


def test_current_mode_has_a_minimum_interval(px4: Any) -> None:
    assert px4.long(511, 436, 100_000) == [0]
    number = (436).to_bytes(3, "little")
    datagrams = px4.simulation.advance(px4.simulation.now_us + 20_000_000)
    told = [d for d in datagrams if d[7:10] == number]
    assert 34 <= len(told) <= 37
    assert int.from_bytes(told[-1][10:14], "little") == LOITER


def test_landed_state_reports_landing_at_once(flying: Any) -> None:
    assert flying.long(511, 245, 100_000) == [0]
    flying.mode(FlightMode.LAND)
    states = [f.message.landed_state for f in flying.wait(1) if f.name == "EXTENDED_SYS_STATE"]
    assert (len(states), set(states)) == (10, {4})


def test_selecting_hold_again_does_not_stop_a_reposition(flying: Any) -> None:
    flying.go_to(150, 0, 10)
    flying.wait(5)
    north = flying.truth.north_mm
    assert flying.mode(FlightMode.LOITER) == [0, 0]
    flying.send(mavlink.MAVLink_set_mode_message(1, 1, LOITER))
    assert flying.long(17) == [0]
    flying.wait(9)
    assert flying.truth.speed_mm_s > 4_500
    assert flying.truth.north_mm - north > 40_000


def targets(received: list[Any]) -> list[Any]:
    return [f.message for f in received if f.name == "POSITION_TARGET_GLOBAL_INT"]


NOWHERE = (2**31 - 1, 2**31 - 1, nan)


@pytest.mark.parametrize(
    ("mode", "as_int"),
    each_once(
        [FlightMode.LOITER, FlightMode.TAKEOFF, FlightMode.RETURN, FlightMode.LAND, FlightMode.MISSION], [False, True]
    ),
)
def test_reposition_without_a_place_stops(flying: Any, mode: FlightMode, as_int: bool) -> None:
    def pause() -> list[int]:
        return flying.int(192, 0, [-1, 1, 0, nan], *NOWHERE) if as_int else flying.pause()

    home = flying.config.home
    if mode is FlightMode.MISSION:
        upload(flying, [(16, 120, 0)])
        assert flying.long(300) == [0]
    elif mode is FlightMode.TAKEOFF:
        assert flying.long(22, -1, 0, 0, nan, nan, nan, AMSL + 60) == [0]
    else:
        flying.go_to(120, 0, 10)
        flying.wait(8)
        flying.mode(mode) if mode is not FlightMode.LOITER else None
    flying.wait(6 if mode is FlightMode.MISSION else 2)
    before = flying.truth
    assert pause() == [0]
    target = targets(flying.wait(1))[0]
    assert flying.truth.mode is FlightMode.LOITER
    flying.wait(9)
    assert flying.truth.speed_mm_s < 150
    assert abs(flying.truth.climb_mm_s) < 100
    told = home.local(target.lat_int, target.lon_int)
    assert abs(flying.truth.north_mm / 1000 - told[0]) < 2.5
    assert target.alt == pytest.approx(home.amsl_mm / 1000 + before.up_mm / 1000, abs=0.1), "the height of that moment"
    assert abs(flying.truth.up_mm - before.up_mm) < 300


def test_reposition_of_height_or_heading_keeps_the_target(flying: Any) -> None:
    place = flying.config.home.globe(150, 20)
    flying.go_to(150, 20, 10)
    flying.wait(4)
    assert flying.long(192, -1, 1, 0, nan, nan, nan, AMSL + 14) == [0]
    target = targets(flying.wait(1))[-1]
    assert (target.lat_int, target.lon_int, target.alt) == (*place, pytest.approx(AMSL + 14, abs=0.01))
    up = flying.truth.up_mm / 1000
    assert flying.long(192, -1, 1, 0, 1.0, nan, nan, nan) == [0]
    target = targets(flying.wait(1))[-1]
    assert (target.lat_int, target.lon_int, target.alt) == (*place, pytest.approx(AMSL + up, abs=0.2))
    flying.wait(6)
    assert flying.last("ATTITUDE").yaw == pytest.approx(1.0, abs=0.05)
    assert flying.truth.speed_mm_s > 4_500


def test_pause_outside_the_fence_is_refused(flying: Any) -> None:
    flying.send(mavlink.MAVLink_param_set_message(1, 1, b"GF_MAX_HOR_DIST", 30, 9))
    flying.send(mavlink.MAVLink_param_set_message(1, 1, b"GF_ACTION", struct.unpack("<f", struct.pack("<i", 1))[0], 6))
    flying.go_to(25, 0, 10)
    flying.wait(1)
    flying.send(mavlink.MAVLink_param_set_message(1, 1, b"GF_MAX_HOR_DIST", 2, 9))
    flying.wait(3)
    assert flying.truth.north_mm > 2_000
    assert flying.pause() == [0]
    flying.wait(2)
    assert flying.texts()[-1] == "Reposition is outside geofence\t"
    flying.wait(8)
    assert flying.truth.north_mm > 24_000


def test_target_is_reported_in_every_mode_that_has_one(px4: Any) -> None:
    assert not targets(px4.wait(2)), "none on the ground"
    px4.take_off(10)
    home, amsl = px4.config.home, px4.config.home.amsl_mm / 1000
    first = targets(px4.seen)[0]
    assert (first.coordinate_frame, first.type_mask, first.alt) == (5, 0, pytest.approx(amsl + 10, abs=0.01))
    px4.go_to(60, 30, 20)
    told = targets(px4.wait(5))
    assert len(told) == 50
    assert {(m.lat_int, m.lon_int, round(m.alt - amsl)) for m in told} == {(*home.globe(60, 30), 20)}
    px4.mode(FlightMode.LAND)
    assert {m.alt for m in targets(px4.wait(1))} == {0.0}
    px4.mode(FlightMode.RETURN)
    here = (px4.truth.latitude, px4.truth.longitude)
    climb = targets(px4.wait(1))
    assert {round(m.alt - amsl) for m in climb} == {30}
    assert abs(climb[-1].lat_int - here[0]) < 60
    px4.until(lambda: targets(px4.wait(0.1))[-1].lat_int == home.latitude)
    assert targets(px4.wait(1))[-1].alt == pytest.approx(amsl + 30, abs=0.01)
    px4.until(lambda: px4.last("EXTENDED_SYS_STATE").landed_state == 4)
    assert targets(px4.wait(1))[-1].alt == pytest.approx(amsl, abs=0.01)
    px4.until(lambda: not px4.truth.armed)
    px4.wait(0.5)
    assert not targets(px4.wait(1))


def upload(px4: Any, items: list[tuple[int, float, float]]) -> None:
    px4.send(mavlink.MAVLink_mission_count_message(1, 1, len(items), 0))
    for number, (command, north, east) in enumerate(items):
        place = px4.config.home.globe(north, east)
        px4.send(mavlink.MAVLink_mission_item_int_message(1, 1, number, 6, command, 0, 1, 0, 0, 0, nan, *place, 10, 0))
    px4.wait(0.5)
