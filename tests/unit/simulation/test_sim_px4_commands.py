"""What the simulated PX4 answers: the table of a recorded session with the real one (v1.16.0)."""

from collections.abc import Callable
from math import nan
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.simulation.modes import Mode

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
def test_results_on_the_ground(px4: Any, command: int, params: tuple[float, ...], expected: list[int]) -> None:
    assert px4.long(command, *params) == expected


def test_custom_modes(px4: Any) -> None:
    for mode, number in [(Mode.LOITER, LOITER), (Mode.TAKEOFF, TAKEOFF), (Mode.RETURN, RETURN), (Mode.LAND, LAND)]:
        assert px4.mode(mode) == [0, 0]
        px4.wait(1)
        assert px4.last("HEARTBEAT").custom_mode == number


def test_bogus_modes_change_nothing(px4: Any) -> None:
    px4.long(176, 1, 99)
    px4.long(176, 1, 4, 99)
    px4.wait(1)
    assert px4.last("HEARTBEAT").custom_mode == LOITER


def test_arming_before_ready_is_temporarily_rejected(pilot: Callable[..., Any]) -> None:
    early = pilot("px4")
    assert early.arm() == [1]
    assert not early.truth.armed
    assert early.ready().arm() == [0]


def test_takeoff_while_disarmed_only_changes_the_mode_and_arming_starts_it(px4: Any) -> None:
    assert px4.long(22, -1, 0, 0, nan, nan, nan, AMSL + 10) == [0]
    px4.wait(5)
    assert (px4.truth.mode, px4.truth.in_air) == (Mode.TAKEOFF, False)
    assert px4.arm() == [0]
    px4.until(lambda: px4.truth.mode is Mode.LOITER)
    assert abs(px4.truth.up_mm - 10_000) < 900, "the mode changes a little before the height is reached"


def test_takeoff_altitude_is_above_sea(px4: Any) -> None:
    assert px4.arm() == [0]
    assert px4.long(22, -1, 0, 0, nan, nan, nan, 10) == [0]  # 478 m below the ground
    px4.wait(5)
    assert not px4.truth.in_air


def test_takeoff_without_altitude_takes_the_parameter(px4: Any) -> None:
    assert px4.arm() == [0]
    assert px4.long(22, -1, 0, 0, nan, nan, nan, nan) == [0]
    px4.until(lambda: px4.truth.mode is Mode.LOITER)
    px4.wait(3)
    assert abs(px4.truth.up_mm - 2_500) < 200


def test_armed_on_the_ground_disarms_by_itself(px4: Any) -> None:
    px4.arm()
    px4.wait(9)
    assert px4.truth.armed
    px4.wait(2)
    assert not px4.truth.armed


def test_in_the_air(flying: Any) -> None:
    assert flying.arm() == [0]
    assert flying.long(400, 0) == [1]
    assert flying.truth.armed


def test_reposition_needs_its_flag(flying: Any) -> None:
    latitude, longitude = flying.config.home.globe(20, 0)
    assert flying.int(192, 5, [-1, 0, 0, nan], latitude, longitude, AMSL + 10) == [3]
    flying.wait(5)
    assert abs(flying.truth.north_mm) < 500


@pytest.mark.parametrize("frame", [0, 3, 5, 6, 10])
def test_reposition_reads_every_frame_as_above_sea(flying: Any, frame: int) -> None:
    latitude, longitude = flying.config.home.globe(20, 0)
    assert flying.int(192, frame, [-1, 1, 0, nan], latitude, longitude, AMSL + 15) == [0]
    flying.wait(15)
    assert abs(flying.truth.north_mm - 20_000) < 300
    assert abs(flying.truth.up_mm - 15_000) < 300


def test_reposition_without_altitude_or_place_keeps_them(flying: Any) -> None:
    flying.go_to(40, 0, 10)
    flying.wait(4)
    assert flying.int(192, 5, [-1, 1, 0, nan], 2**31 - 1, 2**31 - 1, nan) == [0]
    flying.wait(8)
    where = flying.truth
    assert where.speed_mm_s < 50
    assert 10_000 < where.north_mm < 30_000
    assert abs(where.up_mm - 10_000) < 300


def test_reposition_on_the_ground_is_acknowledged_and_dropped(px4: Any) -> None:
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
    assert flying.truth.mode is Mode.GUIDED
    flying.wait(1.5)
    assert flying.truth.mode is Mode.LOITER


def test_set_mode_message_is_obeyed_and_never_acknowledged(flying: Any) -> None:
    assert all(f.name != "COMMAND_ACK" for f in flying.send(mavlink.MAVLink_set_mode_message(1, 1, LAND)))
    assert flying.truth.mode is Mode.LAND


def test_no_texts_until_a_ground_station_was_seen(pilot: Callable[..., Any]) -> None:
    alone = pilot("px4", station=False)
    assert alone.arm() == [1]
    alone.ready().arm()
    alone.wait(1)
    assert alone.texts() == []


def test_streams_run_unasked(px4: Any) -> None:
    names = {frame.name for frame in px4.seen}
    assert {"GLOBAL_POSITION_INT", "ESTIMATOR_STATUS", "WIND_COV", "EXTENDED_SYS_STATE", "DISTANCE_SENSOR"} <= names
    assert not {"EKF_STATUS_REPORT", "WIND"} & names
