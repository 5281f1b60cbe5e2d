"""Missions on the simulated vehicle: start, pause, resume, refusal, and reports of progress."""

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.model.faults import FlightMode
from virtual import plans as p

Pilots = Callable[..., Any]
SURVEY = [p.takeoff(10), p.waypoint(30, 0, 12), p.waypoint(30, 25, 12, hold=3), p.RETURN]


def loaded(a: Any, rows: list[Any]) -> Any:
    assert p.upload(a, p.mission(a, rows))[1] == 0
    a.wait(0.5)
    return a


def armed(a: Any) -> Any:
    if not a.px4:
        assert a.mode(FlightMode.GUIDED) == [0]
        assert a.arm() == [0]
    return a


def start(a: Any) -> list[int]:
    result: list[int] = a.long(mavlink.MAV_CMD_MISSION_START, 0, 0)
    return result


def reached(a: Any) -> list[int]:
    return [f.message.seq for f in a.seen if f.name == "MISSION_ITEM_REACHED"]


def place(a: Any) -> tuple[float, float, float]:
    return a.truth.north_mm / 1000, a.truth.east_mm / 1000, a.truth.up_mm / 1000


def test_survey_is_flown_and_ends_at_home(pilot: Pilots, flavour: str) -> None:
    a = armed(loaded(pilot(flavour, cruise_mm_s=8_000).ready(), SURVEY))
    first = 0 if a.px4 else 1
    assert start(a) == [0]
    assert a.truth.armed
    a.until(lambda: first in reached(a))
    assert place(a)[2] == pytest.approx(10, abs=1.5)
    a.until(lambda: first + 1 in reached(a))
    assert place(a) == pytest.approx((30, 0, 12), abs=2.5)
    at_us = a.simulation.now_us
    a.until(lambda: first + 2 in reached(a))
    assert place(a) == pytest.approx((30, 25, 12), abs=2.5)
    assert a.simulation.now_us - at_us > 3_000_000
    assert a.last("MISSION_CURRENT").mission_state in (3, 5)
    a.until(lambda: not a.truth.armed)
    assert place(a) == pytest.approx((0, 0, 0), abs=1)
    a.wait(1.5)
    assert reached(a) == list(range(first, first + 4))
    if a.px4:
        assert a.last("MISSION_CURRENT").mission_state == 5
        assert a.truth.mode is FlightMode.LOITER
    else:
        assert a.last("MISSION_CURRENT").mission_state == 5
        assert a.truth.mode is FlightMode.MISSION
        texts = [text for text in a.texts() if text.startswith("Mission:")]
        assert texts == ["Mission: 1 Takeoff", "Mission: 1 Takeoff", "Mission: 2 WP", "Mission: 3 WP", "Mission: 4 RTL"]


def test_current_item_and_state_are_reported(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour).ready()
    a.long(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, 200_000)
    a.wait(1)
    assert (a.last("MISSION_CURRENT").total, a.last("MISSION_CURRENT").mission_state) == (0, 1)
    loaded(a, SURVEY)
    assert (a.last("MISSION_CURRENT").total, a.last("MISSION_CURRENT").mission_state) == (4, 2)
    start(armed(a))
    a.wait(3)
    assert a.last("MISSION_CURRENT").mission_state == 3
    a.until(lambda: 1 in reached(a))
    assert a.last("MISSION_CURRENT").seq == 2
    a.mode(FlightMode.LOITER)
    a.wait(0.5)
    assert a.last("MISSION_CURRENT").mission_state == 4


def test_mission_pauses_and_resumes(pilot: Pilots, flavour: str) -> None:
    a = armed(loaded(pilot(flavour).ready(), [p.takeoff(10), p.waypoint(60, 0, 10), p.waypoint(60, 40, 10)]))
    start(a)
    a.until(lambda: place(a)[0] > 20)
    assert a.mode(FlightMode.LOITER)[-1] == 0
    a.wait(8)
    held = place(a)
    assert held[0] < 40
    a.wait(5)
    assert place(a) == pytest.approx(held, abs=0.5)
    assert a.mode(FlightMode.MISSION)[-1] == 0
    last = 2 if a.px4 else 3
    a.until(lambda: last in reached(a))
    assert place(a) == pytest.approx((60, 40, 10), abs=2.5)
    a.wait(6)
    assert a.truth.in_air
    assert a.truth.mode is (FlightMode.LOITER if a.px4 else FlightMode.MISSION)
    assert reached(a).count(last) == 1


def test_second_start_repeats_the_mission(pilot: Pilots, flavour: str) -> None:
    a = armed(loaded(pilot(flavour).ready(), [p.takeoff(5), p.waypoint(8, 0, 5)]))
    last = 1 if a.px4 else 2
    start(a)
    a.until(lambda: last in reached(a))
    a.mode(FlightMode.LOITER)
    a.wait(1)
    assert start(a) == [0]
    a.until(lambda: reached(a).count(last) == 2)


def test_repeated_start_has_no_effect(pilot: Pilots) -> None:
    a = armed(loaded(pilot("ardupilot").ready(), [p.takeoff(5), p.waypoint(8, 0, 5), p.RETURN]))
    start(a)
    a.until(lambda: 2 in reached(a))
    a.wait(1)
    assert start(a) == [0]
    assert a.mode(FlightMode.MISSION) == [0]
    a.until(lambda: not a.truth.armed, seconds=120)


def test_land_item_lands(pilot: Pilots, flavour: str) -> None:
    land = (21, p.RELATIVE, (0, 0, 0, 0), 15, 5, 0)
    a = armed(loaded(pilot(flavour).ready(), [p.takeoff(6), land]))
    start(a)
    a.until(lambda: a.truth.in_air)
    a.until(lambda: not a.truth.armed)
    assert place(a) == pytest.approx((15, 5, 0), abs=2.5)
    here = pilot(flavour).ready()
    armed(loaded(here, [p.takeoff(6), p.waypoint(12, 0, 6), (21, 2, (0, 0, 0, 0), 0, 0, 0)]))
    start(here)
    here.until(lambda: here.truth.in_air)
    here.until(lambda: not here.truth.armed)
    assert place(here) == pytest.approx((12, 0, 0), abs=2.5)


def test_speed_jump_and_camera_items(pilot: Pilots, flavour: str) -> None:
    offset = 0 if flavour == "px4" else 1
    rows = [
        p.takeoff(5),
        (178, 2, (1, 2, -1, 0), 0, 0, 0),
        (2000, 2, (0, 0, 1, 0), 0, 0, 0),
        p.waypoint(10, 0, 5),
        p.waypoint(0, 10, 5),
        (177, 2, (3 + offset, 1, 0, 0), 0, 0, 0),
        (93, 2, (2, 0, 0, 0), 0, 0, 0),
        (17, p.RELATIVE, (0, 0, 0, 0), 5, 5, 5),
    ]
    a = armed(loaded(pilot(flavour).ready(), rows))
    start(a)
    fastest = 0
    for _ in range(300):
        a.wait(0.2)
        fastest = max(fastest, a.truth.speed_mm_s)
    assert fastest < 2_300
    assert [reached(a).count(number + offset) for number in (3, 4)] == [2, 2]
    assert reached(a).count(2 + offset) == (1 if a.px4 else 0)
    assert reached(a).count(7 + offset) == 0
    assert place(a) == pytest.approx((5, 5, 5), abs=1)


def test_altitudes_above_sea_are_converted(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour)
    amsl = a.config.home.amsl_mm / 1000
    armed(loaded(a.ready(), [p.takeoff(5), p.waypoint(10, 0, amsl + 9, frame=p.AMSL), p.waypoint(20, 0, 9)]))
    start(a)
    a.until(lambda: (1 if a.px4 else 2) in reached(a))
    assert place(a)[2] == pytest.approx(9, abs=1.1)


def test_set_current_selects_an_item(pilot: Pilots, flavour: str) -> None:
    a = armed(loaded(pilot(flavour).ready(), SURVEY))
    start(a)
    a.until(lambda: a.truth.up_mm > 9_500)
    number = 2 if a.px4 else 3
    a.send(mavlink.MAVLink_mission_set_current_message(1, 1, number))
    assert a.last("MISSION_CURRENT").seq == number
    a.until(lambda: number in reached(a))
    assert reached(a).count(number - 1) == 0
    assert "WPM: WP CURR CMD: Not in list" not in a.texts()
    a.send(mavlink.MAVLink_mission_set_current_message(1, 1, 99))
    assert "WPM: WP CURR CMD: Not in list" in a.texts()
    if not a.px4:
        assert a.long(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, 2) == [0]
        assert a.long(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, 99) == [4]


def test_start_without_a_mission_is_refused(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour).ready()
    assert start(a) == [2 if a.px4 else 4]
    assert a.mode(FlightMode.MISSION)[-1] == (1 if a.px4 else 4)
    assert not a.truth.armed


def test_px4_start_is_denied_until_the_mission_is_checked(pilot: Pilots) -> None:
    a = pilot("px4").ready()
    p.upload(a, SURVEY)
    assert start(a) == [2]
    a.wait(0.3)
    assert start(a) == [0]


def test_px4_accepts_but_does_not_fly_a_mission_outside_the_fence(pilot: Pilots) -> None:
    a = pilot("px4").ready()
    p.upload(a, p.square(60), p.FENCE)
    a.wait(0.5)
    assert p.upload(a, [p.takeoff(10), p.waypoint(300, 0, 12)])[1] == 0
    a.wait(0.5)
    assert start(a) == [2]
    p.upload(a, [], p.FENCE)
    a.wait(0.5)
    assert start(a) == [0]
    a.send(mavlink.MAVLink_command_long_message(1, 1, 400, 0, 0, 21196, 0, 0, 0, 0, 0))
    p.upload(a, [p.waypoint(20_000, 0, 12), p.RETURN])
    a.wait(0.5)
    assert start(a) == [2]


def test_px4_denies_start_when_it_cannot_arm(pilot: Pilots) -> None:
    a = pilot("px4", battery=500).ready()
    loaded(a, SURVEY)
    assert start(a) == [1]
    assert not a.truth.armed


def test_px4_takes_off_for_a_mission_of_waypoints(pilot: Pilots) -> None:
    a = loaded(pilot("px4").ready(), [p.waypoint(20, 0, 8), p.waypoint(20, 10, 8)])
    assert start(a) == [0]
    a.until(lambda: reached(a) == [0, 1])
    assert place(a) == pytest.approx((20, 10, 8), abs=2.5)


def test_px4_starts_from_the_named_item(pilot: Pilots) -> None:
    a = loaded(pilot("px4").ready(), SURVEY)
    assert a.long(mavlink.MAV_CMD_MISSION_START, 9) == [2]
    assert a.long(mavlink.MAV_CMD_MISSION_START, 2) == [0]
    a.until(lambda: 3 in reached(a))
    assert reached(a) == [2, 3]


def test_px4_leaves_mission_mode_when_the_mission_is_cleared(pilot: Pilots) -> None:
    a = loaded(pilot("px4").ready(), [p.takeoff(10), p.waypoint(500, 0, 10)])
    start(a)
    a.until(lambda: a.truth.north_mm > 20_000)
    a.send(mavlink.MAVLink_mission_clear_all_message(1, 1, p.MISSION))
    a.wait(0.5)
    assert a.truth.mode is FlightMode.LOITER


def test_arducopter_waits_on_the_ground_for_mission_start(pilot: Pilots) -> None:
    a = armed(loaded(pilot("ardupilot").ready(), SURVEY))
    assert a.mode(FlightMode.MISSION) == [0]
    a.wait(5)
    assert not a.truth.in_air
    assert start(a) == [0]
    a.until(lambda: a.truth.in_air)
    assert a.send(mavlink.MAVLink_mission_clear_all_message(1, 1, p.MISSION))[-1].message.type == 1


def test_arducopter_auto_cannot_arm_and_requires_a_takeoff_item(pilot: Pilots) -> None:
    a = loaded(pilot("ardupilot").ready(), SURVEY)
    assert start(a) == [0]
    assert a.arm() == [4]
    assert "Arm: AUTO mode not armable" in a.texts()
    b = armed(loaded(pilot("ardupilot").ready(), [p.waypoint(10, 0, 5), p.waypoint(20, 0, 5)]))
    assert start(b) == [4]


def test_takeoff_below_the_current_height_ends_at_once(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour)
    a.take_off(15)
    loaded(a, [p.takeoff(10), p.waypoint(20, 0, 15)])
    assert start(a) == [0]
    a.wait(0.5)
    assert reached(a) == [0 if a.px4 else 1]
    assert a.truth.up_mm > 14_000


def test_px4_takeoff_mode_climbs_to_its_parameter(pilot: Pilots) -> None:
    a = pilot("px4").ready()
    a.send(mavlink.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", 7.0, 9))
    assert a.arm() == [0]
    assert a.mode(FlightMode.TAKEOFF) == [0, 0]
    a.until(lambda: abs(a.truth.up_mm - 7_000) < 300)
