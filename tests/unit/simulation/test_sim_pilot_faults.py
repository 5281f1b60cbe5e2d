"""Takeovers without the mode switch, and motor stops."""

from collections.abc import Callable
from typing import Any

import pytest

from rtshcua.model import faults
from rtshcua.model.faults import FlightMode

S = 1_000_000


@pytest.fixture
def flying(pilot: Callable[..., Any], flavour: str) -> Any:
    p = pilot(flavour, noise=False)
    for number in (33, 87, 30, 245):
        p.long(511, number, 100_000)
    p.take_off(20)
    p.go_to(300, 0, 20)
    p.wait(6)
    return p


def inject(p: Any, kind: Callable[..., faults.Fault], *args: Any) -> None:
    p.simulation.inject(kind(p.simulation.now_us, *args))


def test_pilot_pause_stops_without_a_mode_change(flying: Any) -> None:
    mode, target = flying.truth.mode, flying.last("POSITION_TARGET_GLOBAL_INT").lat_int
    inject(flying, faults.PilotPause)
    flying.wait(7)
    assert (flying.truth.mode, flying.truth.speed_mm_s < 150) == (mode, True)
    assert (flying.last("POSITION_TARGET_GLOBAL_INT").lat_int == target) is not flying.px4
    assert not any(frame.name == "COMMAND_ACK" for frame in flying.wait(1)), "nobody here asked"


def test_pilot_target_shows_only_in_the_target_report(flying: Any) -> None:
    mode = flying.truth.mode
    inject(flying, faults.PilotGoto, 0, 200_000, 40_000)
    flying.wait(6)
    target = flying.last("POSITION_TARGET_GLOBAL_INT")
    assert (target.lat_int, target.lon_int) == flying.config.home.globe(0, 200)
    assert target.alt == pytest.approx(flying.config.home.amsl_mm / 1000 + 40, abs=0.01)
    assert flying.truth.mode is mode
    flying.wait(4)
    assert flying.truth.east_mm > 10_000
    assert flying.last("GLOBAL_POSITION_INT").vy > 200


def test_sticks_take_over_px4_and_only_shift_a_landing_copter(flying: Any) -> None:
    inject(flying, faults.PilotSticks, 2 * S)
    flying.wait(6)
    if flying.px4:
        assert flying.truth.mode is FlightMode.POSITION
        assert flying.truth.speed_mm_s < 150
        return
    assert flying.truth.mode is FlightMode.GUIDED
    assert flying.truth.speed_mm_s > 4_000
    assert abs(flying.truth.east_mm) < 300
    flying.mode(FlightMode.BRAKE)
    flying.wait(6)
    inject(flying, faults.PilotSticks, 2 * S)
    flying.wait(5)
    assert abs(flying.truth.east_mm) < 300
    flying.mode(FlightMode.LAND)
    flying.wait(1)
    inject(flying, faults.PilotSticks, 4 * S)
    flying.wait(8)
    assert flying.truth.mode is FlightMode.LAND
    assert 3_000 < flying.truth.east_mm < 6_000, "1.25 m/s at most"


def test_sticks_do_not_end_offboard(pilot: Callable[..., Any]) -> None:
    p = pilot("px4")
    p.take_off(10)
    latitude, longitude = p.config.home.globe(100, 0)
    for turn in range(30):
        p.target(latitude, longitude, 10)
        p.wait(0.1)
        if turn == 2:
            assert p.mode(FlightMode.GUIDED) == [0, 0]
            inject(p, faults.PilotSticks)
    assert p.truth.mode is FlightMode.GUIDED


def test_vehicle_killed_in_the_air_crashes(flying: Any) -> None:
    inject(flying, faults.Kill)
    flying.wait(1)
    assert not flying.truth.armed
    assert flying.last("GLOBAL_POSITION_INT").vz > 500
    assert not flying.last("HEARTBEAT").base_mode & 128
    flying.wait(4)
    assert (flying.truth.crashed, flying.truth.up_mm, flying.truth.in_air) == (True, 0, False)
    assert abs(flying.last("ATTITUDE").roll) > 1.2
    assert flying.last("EXTENDED_SYS_STATE").landed_state == 1
