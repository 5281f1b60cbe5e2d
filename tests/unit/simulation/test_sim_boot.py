"""The boot sequence, and refusals to arm."""

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.model import faults
from rtshcua.model.faults import FlightMode
from rtshcua.simulation.config import Boot

S = 1_000_000
PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK
STREAMS = (1, 24, 33, 193, 230, 242)


def watched(pilot: Callable[..., Any], flavour: str, **config: Any) -> Any:
    p = pilot(flavour, boot=Boot.RECORDED, **config)
    for number in STREAMS:
        p.long(511, number, 100_000)
    return p


#: seconds, HEARTBEAT.system_status, fix type, estimator flags, pre-arm bit; None: no message yet
COMING_UP = {
    "px4": [
        (0.15, 0, 3, None, None),
        (1.0, 0, 3, 0x480, False),
        (2.2, 0, 3, 0x0E5, False),
        (4.5, 3, 3, 0x3FF, False),
        (6.0, 3, 3, 0x3FF, True),
    ],
    "ardupilot": [
        (2.0, 1, 0, None, None),
        (4.2, 3, 0, 0x400, False),
        (5.8, 3, 0, 0x000, False),
        (9.0, 3, 0, 0x0A7, False),
        (12.0, 3, 6, 0x0A7, False),
        (25.0, 3, 6, 0x0A7, True),
        (41.0, 3, 6, 0x0A7, True),
        (43.0, 3, 6, 0x33F, True),
    ],
}


def test_estimator_and_sensors_come_up_step_by_step(pilot: Callable[..., Any], flavour: str) -> None:
    p = watched(pilot, flavour)
    for seconds, *expected in COMING_UP[flavour]:
        p.seen.clear()
        p.wait(seconds - p.simulation.now_us / S)
        names = {frame.name for frame in p.seen}
        estimator = "ESTIMATOR_STATUS" if p.px4 else "EKF_STATUS_REPORT"
        flags = p.last(estimator).flags if estimator in names else None
        prearm = None
        if "SYS_STATUS" in names:
            prearm = bool(p.last("SYS_STATUS").onboard_control_sensors_health & PREARM)
        assert [p.last("HEARTBEAT").system_status, p.last("GPS_RAW_INT").fix_type, flags, prearm] == expected, seconds


def test_arducopter_sends_positions_before_they_are_valid(pilot: Callable[..., Any]) -> None:
    p = watched(pilot, "ardupilot")
    told = []
    for seconds in (2, 4, 12, 21):
        p.seen.clear()
        p.wait(seconds - p.simulation.now_us / S)
        seen = [f.message for f in p.seen if f.name == "GLOBAL_POSITION_INT"]
        told.append([bool(seen), *([bool(seen[-1].lat), bool(seen[-1].relative_alt)] if seen else [])])
    assert told == [[False], [True, False, False], [True, True, False], [True, True, True]]


def test_arming_during_boot_is_refused(pilot: Callable[..., Any], flavour: str) -> None:
    p = watched(pilot, flavour)
    refused = [1 if p.px4 else 4]
    p.wait(1.9)
    assert p.arm() == refused
    if p.px4:
        assert p.texts() == ["Arming denied: system is starting up", "Arming denied: no valid global position"]
        p.wait(4)
        assert p.arm() == [0]
        return
    assert p.texts()[-1] == "Arm: Accels inconsistent"
    p.wait(25)
    p.mode(FlightMode.ALTITUDE)
    assert p.mode(FlightMode.GUIDED) == [4]
    assert p.arm() == [0], "a mode that needs no position can be armed in without one"
    assert p.long(400, 0) == [0]
    p.wait(17)
    assert p.mode(FlightMode.GUIDED) == [0]
    assert p.arm() == [0]


@pytest.mark.parametrize(
    ("fault", "px4", "copter"),
    [
        (faults.GpsLoss(2 * S), "GPS fix too low", "GPS 1: Bad fix"),
        (faults.GpsGlitch(2 * S, 50_000, 0), "no valid global position", "Need Position Estimate"),
        (faults.BatteryLevel(2 * S, 700), "battery too low", "Battery 1 below minimum arming capacity"),
    ],
)
def test_arming_refusals_name_the_reason(
    pilot: Callable[..., Any], flavour: str, fault: Any, px4: str, copter: str
) -> None:
    p = pilot(flavour, faults=(fault,)).ready()
    p.long(511, 1, 100_000)
    p.mode(FlightMode.LOITER)
    p.wait(12)
    assert p.arm() == [1 if p.px4 else 4]
    assert (f"Arming denied: {px4}" if p.px4 else f"Arm: {copter}") in p.texts()
    assert not p.last("SYS_STATUS").onboard_control_sensors_health & PREARM


def test_armed_vehicle_on_the_ground_disarms(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour).ready()
    p.arm()
    p.wait(9.5)
    assert p.truth.armed
    p.wait(1)
    assert not p.truth.armed


def test_vehicle_spooling_up_does_not_disarm(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour).ready()
    p.mode(FlightMode.GUIDED)
    p.arm()
    p.wait(9)
    p.long(22, -1, 0, 0, 0, 0, 0, 500 if p.px4 else 10)
    p.wait(4)
    assert p.truth.in_air
