"""Answers to commands for cameras, gimbals and other payloads, as recorded from PX4 1.16 and ArduCopter 4.7: a table
by hand. Results: 0 accepted, 2 denied, 3 unsupported, 4 failed, 5 in progress; none: no answer.
"""

from collections.abc import Callable
from math import nan
from typing import Any

import pytest

NONE: list[int] = []
#: command, parameters, component; answers of PX4, of ArduCopter without camera and gimbal, and with both
TABLE: list[tuple[int, tuple[float, ...], int, list[int], list[int], list[int]]] = [
    (512, (259,), 1, [2], [0], [0]),
    (512, (260,), 1, [2], [0], [0]),
    (512, (262,), 1, [2], [0], [0]),
    (512, (280,), 1, [2], [0], [0]),
    (512, (285,), 1, [2], [0], [0]),
    (512, (158,), 1, [2], [4], [4]),
    (511, (263, 200_000), 1, [4], [2], [2]),
    (511, (158, 200_000), 1, [4], [2], [2]),
    (521, (1,), 1, NONE, [3], [3]),
    (521, (1,), 100, NONE, [3], [3]),
    (2000, (0, 0, 1, 1), 1, [3], [4], [0]),
    (2000, (0, 0, 1, 1), 100, NONE, [4], [0]),
    (2000, (0, 1, 3, 0), 1, [3], [4], [0]),
    (2001, (0,), 1, [3], [0], [0]),
    (2500, (0,), 1, [3], [4], [4]),
    (2501, (0,), 1, [3], [4], [4]),
    (530, (0, 0), 1, NONE, [3], [3]),
    (531, (0, 1), 1, NONE, [3], [0]),
    (203, (0, 0, 0, 0, 1), 1, NONE, [0], [0]),
    (2003, (1,), 1, NONE, [3], [3]),
    (206, (10,), 1, NONE, [0], [0]),
    (1001, (255, 190), 1, NONE, [4], [0]),
    (1000, (-45, 0, nan, nan), 1, NONE, [4], [0]),
    (1000, (-45, 0, nan, nan), 154, NONE, [4], [0]),
    (1000, (-120, 0, nan, nan), 1, NONE, [4], [0]),
    (205, (-45, 0, 0, 0, 0, 0, 2), 1, NONE, [4], [0]),
    (204, (2,), 1, NONE, [4], [0]),
    (195, (0, 0, 0, 0, 47.397, 8.545, 10), 1, [0], [0], [0]),
    (201, (3, 0, 0, 0, 47.397, 8.545, 10), 1, [0], [0], [0]),
    (197, (), 1, [0], [0], [0]),
    (198, (2,), 1, [3], [0], [0]),
    (211, (1, 0), 1, [5, 0], [4], [4]),
    (183, (9, 1500), 1, [3], [0], [0]),
    (183, (1, 1500), 1, [3], [4], [4]),
    (181, (0, 1), 1, [3], [0], [0]),
    (187, (0,), 1, [0], [3], [3]),
    (42600, (1,), 1, NONE, [4], [4]),
    (216, (1,), 1, [3], [0], [0]),
]


@pytest.mark.parametrize(
    ("flavour", "fitted", "column"),
    [("px4", {}, 3), ("ardupilot", {}, 4), ("ardupilot", {"camera": True, "gimbal": True}, 5)],
)
def test_every_payload_command_is_answered_as_recorded(
    pilot: Callable[..., Any], flavour: str, fitted: dict[str, bool], column: int
) -> None:
    p = pilot(flavour, **fitted).ready()
    for row in TABLE:
        command, params, component = row[:3]
        assert p.long(command, *params, component=component) == row[column], row
        p.wait(1)


def test_a_camera_beside_px4_changes_none_of_the_autopilots_answers(pilot: Callable[..., Any]) -> None:
    p = pilot("px4", camera=True, gimbal=True).ready()
    for command, params, component, expected, *_ in TABLE:
        if component == 1:
            assert p.long(command, *params) == expected, command


def test_px4_accepts_a_gripper_at_once_in_the_air(pilot: Callable[..., Any]) -> None:
    p = pilot("px4")
    p.take_off(10)
    assert p.long(211, 1, 0) == [0]


def test_arducopter_names_a_motors_channel(pilot: Callable[..., Any]) -> None:
    p = pilot("ardupilot").ready()
    p.long(183, 1, 1500)
    assert "ServoRelayEvent: Channel 1 is already in use" in p.texts()


@pytest.mark.parametrize(
    ("number", "name"),
    [
        (259, "CAMERA_INFORMATION"), (260, "CAMERA_SETTINGS"), (262, "CAMERA_CAPTURE_STATUS"),
        (271, "CAMERA_FOV_STATUS"), (280, "GIMBAL_MANAGER_INFORMATION"), (281, "GIMBAL_MANAGER_STATUS"),
        (285, "GIMBAL_DEVICE_ATTITUDE_STATUS"),
    ],
)  # fmt: skip
def test_arducopter_itself_sends_what_is_fitted_and_nothing_otherwise(
    pilot: Callable[..., Any], number: int, name: str
) -> None:
    for fitted in (False, True):
        p = pilot("ardupilot", camera=fitted, gimbal=fitted).ready()
        p.long(512, number)
        assert [frame.component for frame in p.seen if frame.name == name] == ([1] if fitted else [])


def test_a_place_of_interest_turns_a_standing_arducopter_until_its_next_target(pilot: Callable[..., Any]) -> None:
    p = pilot("ardupilot", gimbal=True)
    p.take_off(20)
    latitude, longitude = p.config.home.globe(0, 60)
    assert p.int(195, 5, [0, 0, 0, 0], latitude, longitude, p.config.home.amsl_mm / 1000) == [0]
    p.wait(3)
    p.long(512, 30)
    assert abs(p.last("ATTITUDE").yaw - 1.5708) < 0.05
    assert abs(p.simulation._autopilot.gimbal.pitch + 0.32) < 0.02  # 20 m down over 60 m
    p.go_to(-60, 0, 20)
    p.wait(5)
    p.long(512, 30)
    assert abs(abs(p.last("ATTITUDE").yaw) - 3.1416) < 0.1
    p.long(197)
    q = pilot("px4")
    q.take_off(20)
    before = q.simulation._autopilot.vehicle.body.yaw
    assert q.int(195, 5, [0, 0, 0, 0], latitude, longitude, 488) == [0]
    q.wait(3)
    assert abs(q.simulation._autopilot.vehicle.body.yaw - before) < 0.1
