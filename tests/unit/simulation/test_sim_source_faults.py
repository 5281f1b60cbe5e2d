"""Faults of the vehicle's measurements and reports."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.model import faults
from rtshcua.model.faults import FlightMode
from rtshcua.simulation.autopilot import Taker

S = 1_000_000
AHRS = 0x20_0000


@pytest.fixture
def flying(pilot: Callable[..., Any], flavour: str) -> Any:
    p = pilot(flavour, noise=False)
    for number in (1, 24, 33, 147, 193, 230):
        p.long(511, number, 100_000)
    p.take_off(20)
    return p


def inject(p: Any, kind: Callable[..., faults.Fault], *args: Any) -> None:
    p.simulation.inject(kind(p.simulation.now_us, *args))


def estimator(p: Any) -> Any:
    return p.last("ESTIMATOR_STATUS" if p.px4 else "EKF_STATUS_REPORT")


# --------------------------------------------------------------------------------------------- gps-drift


def test_drifting_receiver_displaces_the_vehicle(flying: Any) -> None:
    before = flying.last("GLOBAL_POSITION_INT").lon
    inject(flying, faults.GpsDrift, 0, 500, 20 * S)
    flying.wait(30)
    assert flying.truth.east_mm == pytest.approx(-10_000, abs=300)
    assert abs(flying.last("GLOBAL_POSITION_INT").lon - before) < 10, "it believes that it stays"
    assert estimator(flying).flags & 0x10
    flying.wait(5)
    assert flying.truth.east_mm == pytest.approx(-10_000, abs=300), "what it strayed by stays"


def test_receiver_without_fix_does_not_drift(flying: Any) -> None:
    inject(flying, faults.GpsLoss, 2 * S)
    flying.wait(0.1)
    flying.simulation.inject(faults.GpsDrift(flying.simulation.now_us, 0, 2_000, S))
    flying.wait(8)
    assert abs(flying.truth.east_mm) < 1_000


# --------------------------------------------------------------------------------------------- estimator


def test_unhealthy_estimator_reports_it_and_continues(flying: Any) -> None:
    if not flying.px4:
        flying.mode(FlightMode.LOITER)
    inject(flying, faults.EstimatorUnhealthy)
    flying.wait(0.5)
    flags = estimator(flying).flags
    assert flags == (0x825 if flying.px4 else 0)
    assert not flying.last("SYS_STATUS").onboard_control_sensors_health & AHRS
    assert flying.last("SYS_STATUS").onboard_control_sensors_present & AHRS
    assert flying.last("GPS_RAW_INT").fix_type >= 3
    stamp = flying.last("GLOBAL_POSITION_INT").time_boot_ms
    assert (flying.truth.mode is FlightMode.LAND) is flying.px4, "ArduCopter waits for a second"
    flying.wait(0.7)
    assert flying.last("GLOBAL_POSITION_INT").time_boot_ms - stamp >= 500, "it goes on"
    truth = flying.truth
    assert (truth.mode, truth.taken_over_by) == (FlightMode.LAND, Taker.FAILSAFE)
    text = "Failsafe: no global position, landing blindly\t" if flying.px4 else "EKF Failsafe: changed to LAND Mode"
    assert text in flying.texts()
    assert flying.mode(FlightMode.LOITER)[-1] != 0


def test_estimator_that_recovers_in_time_is_trusted_again(pilot: Callable[..., Any]) -> None:
    p = pilot("ardupilot", noise=False)
    for number in (1, 33, 193):
        p.long(511, number, 100_000)
    p.take_off(20)
    p.go_to(100, 0, 20)
    inject(p, faults.EstimatorUnhealthy, 700_000)
    p.wait(3)
    assert estimator(p).flags == 0x33F
    assert p.last("SYS_STATUS").onboard_control_sensors_health & AHRS
    assert (p.truth.mode, p.truth.taken_over_us) == (FlightMode.GUIDED, None)
    p.until(lambda: abs(p.truth.north_mm - 100_000) < 1_500, 60)


# ------------------------------------------------------------------------------------------ battery-cell


def test_failed_cell_lowers_the_voltage_more_under_load(flying: Any) -> None:
    def volts() -> Any:
        return flying.last("BATTERY_STATUS").voltages[0]

    before, percent = volts(), flying.last("BATTERY_STATUS").battery_remaining
    inject(flying, faults.BatteryCell, 1_200)
    flying.wait(0.3)
    assert 1_200 + 100 < before - volts() < 1_200 + 250, "half as much again of what hovering takes off"
    assert abs(flying.last("BATTERY_STATUS").battery_remaining - percent) <= 1
    hovering = volts()
    flying.mode(FlightMode.LAND)
    flying.until(lambda: not flying.truth.armed)
    flying.wait(0.5)
    assert volts() - hovering > 350, "without load it comes back, more than a sound one does"


def test_failed_cell_triggers_the_failsafe_of_copter_only(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour, noise=False)
    if not p.px4:
        p.send(mavlink.MAVLink_param_set_message(1, 1, b"BATT_FS_LOW_ACT", 2, 2))
    p.take_off(20)
    inject(p, faults.BatteryCell, 6_000)
    p.wait(9)
    assert p.truth.mode is not FlightMode.RETURN
    p.wait(3)
    assert (p.truth.mode is FlightMode.RETURN) is not p.px4
    assert (p.truth.taken_over_by is Taker.FAILSAFE) is not p.px4


# ------------------------------------------------------------------------------------------------ pillar


def test_moving_pillar_hits_the_vehicle(flying: Any) -> None:
    inject(flying, faults.Pillar, 0, 30_000, 2_000, 60_000, None, 4_000, 270)
    flying.wait(1)
    first = flying.truth.distance_to_obstacle_mm
    flying.wait(2)
    assert first - flying.truth.distance_to_obstacle_mm == pytest.approx(8_000, abs=300)
    flying.wait(5)
    assert flying.truth.crashed
    assert flying.truth.distance_to_obstacle_mm == 0


def test_removed_pillar_is_not_an_obstacle(flying: Any) -> None:
    assert flying.truth.distance_to_obstacle_mm is None
    inject(flying, faults.Pillar, 0, 30_000, 2_000, 10_000, 2 * S, 1_000, 0)
    flying.wait(1)
    across, above = 28.0, flying.truth.up_mm / 1000 - 10.0
    assert flying.truth.distance_to_obstacle_mm / 1000 == pytest.approx((across**2 + above**2) ** 0.5, abs=0.2)
    flying.wait(2)
    assert flying.truth.distance_to_obstacle_mm is None


def test_pillar_moves_during_a_stall(flying: Any) -> None:
    inject(flying, faults.Pillar, 0, 60_000, 2_000, 60_000, None, 5_000, 270)
    inject(flying, faults.Stall, 4 * S)
    flying.wait(0.1)
    first = flying.truth.distance_to_obstacle_mm
    flying.wait(3)
    assert first - flying.truth.distance_to_obstacle_mm == pytest.approx(15_000, abs=200)


# ------------------------------------------------------------------------------------------------- stuck


def test_stuck_message_keeps_values_with_new_time_stamps(flying: Any) -> None:
    flying.go_to(100, 0, 20)
    flying.wait(4)
    inject(flying, faults.MessageStuck, "GLOBAL_POSITION_INT", 3 * S)
    flying.wait(0.3)
    flying.seen.clear()
    flying.wait(2)
    stuck = [f.message for f in flying.seen if f.name == "GLOBAL_POSITION_INT"]
    assert len({(m.lat, m.lon, m.vx, m.relative_alt) for m in stuck}) == 1
    assert stuck[0].vx > 200
    stamps = [m.time_boot_ms for m in stuck]
    assert stamps == sorted(set(stamps))
    assert flying.simulation.now_us // 1_000 - stamps[-1] <= 100
    attitudes = [f.message for f in flying.seen if f.name == "GPS_RAW_INT"]
    assert len({m.lat for m in attitudes}) > 3, "others tell what is"
    flying.wait(2)
    assert flying.last("GLOBAL_POSITION_INT").lat != stuck[0].lat


def test_heartbeat_can_be_stuck(flying: Any) -> None:
    inject(flying, faults.MessageStuck, "HEARTBEAT")
    flying.wait(0.1)
    told = flying.last("HEARTBEAT").custom_mode
    flying.mode(FlightMode.LAND)
    flying.wait(3)
    assert flying.truth.mode is FlightMode.LAND
    assert flying.last("HEARTBEAT").custom_mode == told


def test_unknown_message_cannot_be_stuck(flying: Any) -> None:
    inject(flying, faults.MessageStuck, "ADSB_VEHICLE", S)
    assert flying.wait(2)


# ------------------------------------------------------------------------------------------------- stale


def test_stale_measurements_have_old_time_stamps(flying: Any) -> None:
    flying.go_to(200, 0, 20)
    flying.wait(4)
    inject(flying, faults.StaleSource, 800_000, 6 * S)
    was: dict[int, int] = {}
    for _ in range(40):
        flying.wait(0.1)
        was[flying.simulation.now_us // 1_000] = flying.truth.north_mm
    message = flying.last("GLOBAL_POSITION_INT")
    now_ms = flying.simulation.now_us // 1_000
    assert 800 <= now_ms - message.time_boot_ms <= 900
    north_m, _ = flying.config.home.local(message.lat, message.lon)
    assert north_m * 1_000 == pytest.approx(was[round(message.time_boot_ms, -2)], abs=700)
    assert flying.last("GPS_RAW_INT").time_usec // 1_000 < now_ms - 700
    beats = [f for f in flying.seen[-400:] if f.name == "HEARTBEAT"]
    assert beats, "what is no measurement goes on"
    flying.wait(3)
    assert flying.simulation.now_us // 1_000 - flying.last("GLOBAL_POSITION_INT").time_boot_ms <= 100


def test_age_of_stale_measurements_grows_from_zero(flying: Any) -> None:
    inject(flying, faults.StaleSource, 2 * S)
    ages = []
    for _ in range(30):
        flying.wait(0.1)
        ages.append(flying.simulation.now_us // 1_000 - flying.last("GLOBAL_POSITION_INT").time_boot_ms)
    assert ages[0] <= 200
    assert all(later - earlier <= 100 for earlier, later in pairwise(ages)), "time never runs back"
    assert 2_000 <= ages[-1] <= 2_200
