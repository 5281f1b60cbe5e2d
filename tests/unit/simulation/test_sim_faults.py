"""Each fault, and its effect as a client sees it."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.campaign.drawing import CampaignTally, FaultSpace, draw
from rtshcua.model import faults
from rtshcua.model.faults import FlightMode
from rtshcua.simulation.fault_syntax import OF_VEHICLE, format_fault, parse_fault
from rtshcua.simulation.surroundings import Wind
from virtual.rows import rows

S = 1_000_000


@pytest.fixture
def flying(pilot: Callable[..., Any], flavour: str) -> Any:
    p = pilot(flavour)
    for number in (24, 33, 147, 132, 231, 168, 230, 193):
        p.long(511, number, 100_000)
    p.take_off(20)
    return p


def inject(p: Any, kind: Callable[..., faults.Fault], *args: Any) -> None:
    p.simulation.inject(kind(p.simulation.now_us, *args))


def test_battery_level_fault_lowers_the_charge(flying: Any) -> None:
    inject(flying, faults.BatteryLevel, 2_000)
    flying.wait(1)
    assert flying.last("BATTERY_STATUS").battery_remaining in (19, 20)
    inject(flying, faults.BatteryLevel, 9_000)
    flying.wait(1)
    assert flying.last("BATTERY_STATUS").battery_remaining in (19, 20), "a battery does not fill"


def test_empty_battery_lands_and_then_falls(flying: Any) -> None:
    inject(flying, faults.BatteryLevel, 390)
    flying.wait(1)
    assert flying.truth.mode is FlightMode.LAND
    inject(flying, faults.BatteryLevel, 0)
    flying.wait(1)
    assert flying.truth.climb_mm_s < -5_000
    flying.wait(5)
    assert flying.truth.up_mm == 0


def test_low_battery_refuses_to_arm(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour, battery=500).ready()
    p.mode(FlightMode.LOITER)
    assert p.arm() == [1 if p.px4 else 4]
    assert p.texts()[-1] == (
        "Arming denied: battery too low" if p.px4 else "Arm: Battery 1 below minimum arming capacity"
    )


def test_gps_loss_is_reported_at_once_and_lands_later(flying: Any) -> None:
    flying.mode(FlightMode.LOITER)
    inject(flying, faults.GpsLoss)
    flying.wait(1)
    assert flying.last("GPS_RAW_INT").fix_type == 1
    assert flying.truth.mode is FlightMode.LOITER
    assert flying.simulation.now_us - flying.last("GLOBAL_POSITION_INT").time_boot_ms * 1000 < 200_000
    estimator = "ESTIMATOR_STATUS" if flying.px4 else "EKF_STATUS_REPORT"
    assert flying.last(estimator).flags & 16
    flying.wait(8)
    assert flying.truth.mode is FlightMode.LAND
    assert not flying.last(estimator).flags & 16
    assert flying.mode(FlightMode.LOITER)[-1] != 0
    flying.until(lambda: not flying.truth.armed)


def test_short_gps_loss_passes(flying: Any) -> None:
    flying.mode(FlightMode.LOITER)
    inject(flying, faults.GpsLoss, 2 * S)
    flying.wait(4)
    assert flying.last("GPS_RAW_INT").fix_type == (3 if flying.px4 else 6)
    assert flying.truth.mode is FlightMode.LOITER


def test_gps_jump_moves_the_report_and_then_the_vehicle(flying: Any) -> None:
    before = flying.last("GLOBAL_POSITION_INT").lat
    inject(flying, faults.GpsJump, 20_000, 0)
    flying.wait(0.2)
    assert flying.last("GLOBAL_POSITION_INT").lat - before > 1_500
    flying.wait(15)
    assert abs(flying.last("GLOBAL_POSITION_INT").lat - before) < 60
    assert abs(flying.truth.north_mm + 20_000) < 500


def test_wind_step_is_reported_in_the_flavours_message(flying: Any) -> None:
    inject(flying, faults.WindStep, 12_000, 270)
    flying.wait(1)
    if flying.px4:
        assert flying.last("WIND_COV").wind_y == pytest.approx(12, abs=0.02)  # from the west: towards the east
        assert flying.last("WIND_COV").wind_x == pytest.approx(0, abs=0.02)
    else:
        assert flying.last("WIND").speed == pytest.approx(12, abs=0.02)
        assert flying.last("WIND").direction == pytest.approx(-90, abs=0.1)


def test_storm_carries_the_vehicle_away(flying: Any) -> None:
    inject(flying, faults.WindStep, 25_000, 270)
    flying.wait(10)
    assert flying.truth.east_mm > 30_000


def test_link_delay_delays_both_directions(flying: Any) -> None:
    inject(flying, faults.LinkDelay, 300_000)
    flying.wait(1)
    assert flying.mode(FlightMode.LAND) == []
    flying.wait(0.28)
    assert flying.truth.mode is not FlightMode.LAND
    flying.wait(0.04)
    assert flying.truth.mode is FlightMode.LAND
    flying.wait(0.3)
    assert flying.last("COMMAND_ACK").result == 0


def test_link_loss_drops_frames(flying: Any) -> None:
    inject(flying, faults.LinkLoss, 4_000)
    flying.wait(0.1)
    received = len(flying.wait(20))
    inject(flying, faults.LinkLoss, 0)
    flying.wait(0.1)
    assert 0.5 < received / len(flying.wait(20)) < 0.7


def test_link_silence_drops_all_frames(flying: Any) -> None:
    inject(flying, faults.LinkSilence, 5 * S)
    flying.wait(0.1)
    assert flying.wait(4.8) == []
    assert flying.mode(FlightMode.LAND) == []
    assert flying.wait(1)
    assert flying.truth.mode is not FlightMode.LAND


def test_radio_reports_link_quality(flying: Any) -> None:
    assert flying.last("RADIO_STATUS").txbuf == 100
    inject(flying, faults.LinkQuality, 2_500)
    flying.wait(1.1)
    assert (flying.last("RADIO_STATUS").txbuf, flying.last("RADIO_STATUS").rssi) == (25, 63)
    radio = next(frame for frame in flying.seen if frame.name == "RADIO_STATUS")
    assert (radio.system, radio.component) == (51, 68)


def test_obstacle_is_reported_by_the_range_finder(flying: Any) -> None:
    assert flying.last("DISTANCE_SENSOR").current_distance == 4_000
    inject(flying, faults.Obstacle, 3_000, 2 * S)
    flying.wait(1)
    assert flying.last("DISTANCE_SENSOR").current_distance == 300
    flying.wait(2)
    assert flying.last("DISTANCE_SENSOR").current_distance == 4_000


def test_pilot_mode_switch_takes_over(flying: Any) -> None:
    flying.go_to(100, 0, 20)
    flying.wait(4)
    inject(flying, faults.PilotMode)
    flying.wait(6)
    assert flying.last("HEARTBEAT").custom_mode == (3 << 16 if flying.px4 else 16)
    assert flying.truth.speed_mm_s < 100


def test_configured_faults_happen_on_time(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour, faults=(faults.BatteryLevel(3 * S, 5_000), faults.BatteryLevel(2 * S, 7_000)))
    p.wait(1.9)
    assert p.truth.battery > 9_900
    p.wait(0.2)
    assert 6_900 < p.truth.battery <= 7_000
    p.wait(1)
    assert 4_900 < p.truth.battery <= 5_000


@rows(
    ("text", "expected"),
    [
        ("battery,at=20s,level=15%", faults.BatteryLevel(20 * S, 1_500)),
        ("battery,at=0s,level=12.5%", faults.BatteryLevel(0, 1_250)),
        ("gps-loss,at=1min", faults.GpsLoss(60 * S)),
        ("gps-loss,at=10s,for=1500ms", faults.GpsLoss(10 * S, 1_500_000)),
        ("gps-jump,at=1s,north=-20m,east=0.5m", faults.GpsJump(S, -20_000, 500)),
        ("wind,at=20s,speed=12m/s,from=270deg", faults.WindStep(20 * S, 12_000, 270)),
        ("wind,at=20s,speed=12m/s,gust=1.5m/s", faults.WindStep(20 * S, 12_000, 0, 1_500)),
        ("link-delay,at=1s,delay=200ms", faults.LinkDelay(S, 200_000)),
        ("link-loss,at=1s,loss=30%", faults.LinkLoss(S, 3_000)),
        ("link-silence,at=1s", faults.LinkSilence(S)),
        ("link-quality,at=1s,quality=20%", faults.LinkQuality(S, 2_000)),
        ("obstacle,at=1s,distance=3m,for=4s", faults.Obstacle(S, 3_000, 4 * S)),
        ("battery-voltage,at=1s,voltage=10.2V", faults.BatteryVoltage(S, 10_200)),
        ("gps-glitch,at=1s,north=50m,east=-3m", faults.GpsGlitch(S, 50_000, -3_000)),
        (
            "pillar,at=0s,north=1m,east=-2m,radius=500mm,height=30m,for=2min",
            faults.Pillar(0, 1_000, -2_000, 500, 30_000, 120 * S),
        ),
        ("link-delay,at=1s,delay=200ms,for=3s,way=up", faults.LinkDelay(S, 200_000, 3 * S, faults.Direction.UP)),
        ("link-jitter,at=1s,jitter=80ms,way=down", faults.LinkJitter(S, 80_000, None, faults.Direction.DOWN)),
        ("link-reorder,at=1s,part=5%", faults.LinkReorder(S, 500)),
        ("link-loss,at=1s,loss=30%,for=9s,way=both", faults.LinkLoss(S, 3_000, 9 * S)),
        ("link-silence,at=1s,for=5s,way=down,held=yes", faults.LinkSilence(S, 5 * S, faults.Direction.DOWN, True)),
        ("link-silence,at=1s,held=no", faults.LinkSilence(S)),
        ("stall,at=1s,for=5s,shuffle=7", faults.Stall(S, 5 * S, 7)),
        ("stall,at=1s,for=5s", faults.Stall(S, 5 * S)),
        ("freeze,at=1s,for=2s", faults.Freeze(S, 2 * S)),
        ("mute,at=1s,message=GPS_RAW_INT,for=2s", faults.MessageSilence(S, "GPS_RAW_INT", 2 * S)),
        ("pilot-mode,at=1s,mode=land", faults.PilotMode(S, FlightMode.LAND)),
        ("pilot-pause,at=1s", faults.PilotPause(S)),
        ("pilot-goto,at=1s,north=100m,east=-3m,up=20m", faults.PilotGoto(S, 100_000, -3_000, 20_000)),
        ("pilot-sticks,at=1s,for=3s", faults.PilotSticks(S, 3 * S)),
        ("kill,at=1s", faults.Kill(S)),
        ("pilot,at=1s,mode=altitude", faults.PilotMode(S, FlightMode.ALTITUDE)),
        ("pilot,at=1s", faults.PilotMode(S, FlightMode.POSITION)),
    ],
)
def test_fault_texts_are_parsed(text: str, expected: faults.Fault) -> None:
    assert parse_fault(text) == expected


@rows(
    ("text", "message"),
    [
        ("", "no such fault"),
        ("rain,at=1s", "no such fault: `rain`"),
        ("wind,at=1s", "`wind` requires speed"),
        ("wind,at=1s,speed=12", "a number with a unit"),
        ("wind,at=1s,speed=12km/h", "a number with a unit"),
        ("battery,at=1s,level=5m", "a number with a unit"),
        ("battery,when=1s,level=5%", "has no parameter `when`"),
        ("pilot,at=1s,mode=upside-down", "no such mode"),
        ("battery,at=1s,level", "a number with a unit"),
        ("link-loss,at=1s,loss=3%,way=left", "no such way: `left`; expected one of both, up, down"),
        ("link-silence,at=1s,held=1", "`held` must be yes or no"),
        ("mute,at=1s,message=NOTHING", "no such message: `NOTHING`"),
        ("stall,at=1s", "`stall` requires for"),
        ("stall,at=1s,for=1s,shuffle=yes", "the seed of the shuffled order"),
    ],
)
def test_malformed_fault_texts_are_refused(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        parse_fault(text)


def test_gps_glitch_is_rejected_until_the_estimate_expires(flying: Any) -> None:
    flying.mode(FlightMode.LOITER)
    estimator = "ESTIMATOR_STATUS" if flying.px4 else "EKF_STATUS_REPORT"
    before = flying.last("GLOBAL_POSITION_INT").lat
    inject(flying, faults.GpsGlitch, 50_000, 0, 3 * S)
    flying.wait(2)
    assert flying.last("GPS_RAW_INT").lat - before > 3_500
    assert abs(flying.last("GLOBAL_POSITION_INT").lat - before) < 200
    assert flying.last(estimator).flags & (1 << 10 if flying.px4 else 1 << 15)
    flying.wait(2)
    assert abs(flying.last("GPS_RAW_INT").lat - before) < 200
    assert not flying.last(estimator).flags & (1 << 10 if flying.px4 else 1 << 15)
    assert flying.truth.mode is FlightMode.LOITER
    inject(flying, faults.GpsGlitch, 50_000, 0)
    flying.wait(10)
    assert flying.truth.mode is FlightMode.LAND


def test_vehicle_without_position_drifts_while_landing(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour, wind=Wind(5_000, 270))
    p.take_off(20)
    p.mode(FlightMode.LOITER)
    p.wait(3)
    held = p.truth
    assert abs(held.east_mm) < 1_500
    inject(p, faults.GpsLoss, 9 * S)
    p.wait(14)
    assert p.truth.mode is FlightMode.LAND
    assert p.truth.east_mm > held.east_mm + 10_000
    assert ("EKF Failsafe Cleared" in p.texts()) is not p.px4


def test_low_voltage_is_reported_and_ignored_by_default(pilot: Callable[..., Any]) -> None:
    p = pilot("ardupilot")
    p.long(511, 1, 100_000)
    p.take_off(15)
    inject(p, faults.BatteryVoltage, 10_200)
    p.wait(9)
    assert p.last("SYS_STATUS").voltage_battery == 10_200
    assert not any("attery" in text for text in p.texts())
    p.wait(2)
    assert p.texts()[-1] == "Battery Failsafe"
    assert p.texts()[-2].startswith("Battery 1 is low 10.20V used ")
    assert (p.truth.mode, p.last("HEARTBEAT").system_status) == (FlightMode.GUIDED, 5)
    p.mode(FlightMode.LAND)
    p.until(lambda: not p.truth.armed)
    p.mode(FlightMode.GUIDED)
    assert p.arm() == [4]
    assert p.texts()[-2:] == ["Arm: Battery 1 low voltage failsafe", "Arm: Battery failsafe"]


def test_low_voltage_threshold_is_a_parameter(pilot: Callable[..., Any]) -> None:
    p = pilot("ardupilot", battery=3_000)
    p.send(mavlink.MAVLink_param_set_message(1, 1, b"BATT_LOW_VOLT", 14.7, 9))
    p.take_off(15)
    assert "Battery Failsafe" in p.texts(), "it sags below under load"


@pytest.mark.parametrize(("action", "mode"), [(1, FlightMode.LAND), (2, FlightMode.RETURN)])
def test_low_voltage_action_is_a_parameter(pilot: Callable[..., Any], action: int, mode: FlightMode) -> None:
    p = pilot("ardupilot")
    p.send(mavlink.MAVLink_param_set_message(1, 1, b"BATT_FS_LOW_ACT", action, 9))
    p.take_off(15)
    inject(p, faults.BatteryVoltage, 10_200)
    p.wait(11)
    assert p.truth.mode is mode


def test_formatted_fault_parses_to_itself() -> None:
    space = FaultSpace(
        ("takeoff", "return_home"), {"px4": 60 * S, "ardupilot": 60 * S}, kinds=frozenset(OF_VEHICLE.values())
    )
    drawn = [draw(7, number, space, CampaignTally()) for number in range(400)]
    made = [replace(each.fault, at_us=7) for one in drawn for each in one.scenario.incidents]
    assert {type(each) for each in made} == set(OF_VEHICLE.values())
    for fault in made:
        assert parse_fault(format_fault(fault)) == fault, format_fault(fault)
