"""Telemetry becomes integers in canonical units, or "not known", never anything else."""

from math import inf, nan
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.vehicle.telemetry import Telemetry
from virtual.policy import BATTERY, FIX, HEIGHT, LINK, POLICY, POSITION_X, PROJECTION, WIND

HOME = (PROJECTION.latitude, PROJECTION.longitude)


def battery(percent: int) -> Any:
    return mavlink.MAVLink_battery_status_message(0, 0, 0, 0, [0] * 10, 0, 0, 0, percent)


def position(latitude: int, longitude: int, height: int = 20_000) -> Any:
    return mavlink.MAVLink_global_position_int_message(0, latitude, longitude, 0, height, 0, 0, 0, 0)


def wind(north: float, east: float) -> Any:
    return mavlink.MAVLink_wind_cov_message(0, north, east, 0, 0, 0, 0, 0, 0)


@pytest.mark.parametrize(("message", "values"), [
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
    read = dict(Telemetry(POLICY).read(message.get_type(), message))
    assert {slot: value and round(value, -1) for slot, value in read.items()} == {
        slot: value and round(value, -1) for slot, value in values.items()
    }
    assert all(value is None or type(value) is int for value in read.values())


def test_asks_often_enough_for_what_grows_stale_and_no_oftener_than_useful() -> None:
    intervals = Telemetry(POLICY).intervals
    assert intervals["GLOBAL_POSITION_INT"] == 125_000  # stale after 500 ms
    assert intervals["BATTERY_STATUS"] == 1_000_000  # stale after 5 s
    assert frozenset({"WIND_COV", "WIND"}) in Telemetry(POLICY).sources


def test_the_distance_from_home() -> None:
    telemetry = Telemetry(POLICY)
    assert telemetry.distance_from_home(*HOME) == 0
    assert abs(telemetry.distance_from_home(HOME[0] + 8_983, HOME[1]) - 100_000) < 20
