"""Autopilot restarts: in the air the vehicle falls, on the ground it boots."""

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.model import faults
from rtshcua.model.faults import FlightMode
from rtshcua.simulation.config import Answers, Boot

S = 1_000_000
ASKED = (24, 33, 147)


def made(pilot: Callable[..., Any], flavour: str, **config: Any) -> Any:
    p = pilot(flavour, noise=False, **config)
    for number in ASKED:
        p.long(511, number, 100_000)
    return p


def reboot(p: Any) -> None:
    p.simulation.inject(faults.Reboot(p.simulation.now_us))
    p.wait(0.02)
    p.seen.clear()


def of_autopilot(p: Any) -> list[Any]:
    return [f for f in p.seen if f.component == 1]


def test_reboot_in_the_air_falls_silently(pilot: Callable[..., Any], flavour: str) -> None:
    p = made(pilot, flavour)
    p.take_off(40)
    reboot(p)
    p.wait(1.4)
    assert not of_autopilot(p)
    assert any(f.component == 68 for f in p.seen), "its radio goes on"
    assert not p.truth.armed
    assert p.truth.climb_mm_s < -8_000
    p.wait(5)
    assert (p.truth.up_mm, p.truth.crashed, p.truth.in_air) == (0, True, False)
    assert p.truth.taken_over_us is None, "nobody flies it"
    assert of_autopilot(p)


def test_reboot_resets_clock_modes_and_streams(pilot: Callable[..., Any], flavour: str) -> None:
    p = made(pilot, flavour)
    p.ready().mode(FlightMode.LAND)
    p.wait(2)
    reboot(p)
    p.wait(1.6)
    first = of_autopilot(p)[0]
    assert (first.sequence, first.name) == (0, "HEARTBEAT")
    p.wait(2)
    modes = p.simulation._autopilot.flavour.modes
    assert modes.mode(p.last("HEARTBEAT").custom_mode) is modes.start
    names = {f.name for f in of_autopilot(p)}
    if p.px4:
        assert 1_500 < p.last("GLOBAL_POSITION_INT").time_boot_ms < 2_200
    else:
        assert names <= {"HEARTBEAT", "TIMESYNC", "STATUSTEXT"}, "what was asked for is forgotten"
        p.seen.clear()
        p.long(511, 33, 100_000)
        p.wait(1)
        assert p.last("GLOBAL_POSITION_INT").time_boot_ms < 4_000


def test_vehicle_flies_again_after_a_reboot(pilot: Callable[..., Any], flavour: str) -> None:
    p = made(pilot, flavour)
    p.ready()
    reboot(p)
    p.mode(FlightMode.GUIDED)
    assert not [f for f in p.seen if f.name == "COMMAND_ACK"], "nobody hears it"
    p.wait(1.6)
    if p.px4:
        assert p.arm() == [1], "it is coming up"
    p.wait(1.5)
    p._take_off(10)
    assert p.truth.up_mm > 9_000


def test_stored_state_survives_a_reboot(pilot: Callable[..., Any], flavour: str) -> None:
    p = made(pilot, flavour).ready()
    name = b"RTL_RETURN_ALT" if p.px4 else b"RTL_ALT"
    p.send(mavlink.MAVLink_param_set_message(1, 1, name, 44 if p.px4 else 4_400, 9))
    reboot(p)
    p.wait(4)
    p.send(mavlink.MAVLink_param_request_read_message(1, 1, name, -1))
    assert p.last("PARAM_VALUE").param_value == (44 if p.px4 else 4_400)


def test_signing_continues_after_a_reboot(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour, signing_key=bytes(range(32)), usb=True)
    p.wait(3)

    def stamp(frame: Any) -> int:
        return int.from_bytes(frame.frame[-12:-6], "little")

    before = [stamp(f) for f in p.seen if f.signed][-1]
    reboot(p)
    p.wait(3)
    after = next(stamp(f) for f in p.seen if f.signed)
    assert (after - before) * 10 > (1_400_000 if p.px4 else 0)  # ArduCopter counts its frames


def test_reboot_takes_the_boot_time(pilot: Callable[..., Any]) -> None:
    p = pilot("px4", noise=False, boot=Boot.RECORDED)
    p.wait(8)
    reboot(p)
    p.wait(4)
    assert p.arm() == [1]
    p.wait(4)
    assert p.arm() == [0]


def test_reboot_drops_waiting_messages(pilot: Callable[..., Any], flavour: str) -> None:
    p = made(pilot, flavour, answers=Answers.RECORDED)
    p.wait(2.019)
    p.simulation.inject(faults.Reboot(p.simulation.now_us))
    p.seen.clear()
    for _ in range(5):
        p.long(512, 0)
    p.wait(1.4)
    assert len([f for f in p.seen if f.name == "COMMAND_ACK"]) < 5
    assert p.simulation.next_us is None


def test_receiver_faults_survive_a_reboot(pilot: Callable[..., Any], flavour: str) -> None:
    p = made(pilot, flavour)
    p.ready()
    p.simulation.inject(faults.GpsLoss(p.simulation.now_us))
    reboot(p)
    p.wait(4)
    p.long(511, 24, 100_000)
    p.wait(0.5)
    assert p.last("GPS_RAW_INT").fix_type < 3
    assert p.arm() == [1 if p.px4 else 4] or not p.px4  # ArduCopter starts in a mode that needs no position


@pytest.mark.parametrize("times", [1, 2])
def test_second_reboot_repeats_the_first(times: int, pilot: Callable[..., Any], flavour: str) -> None:
    p = made(pilot, flavour)
    p.ready()
    for _ in range(times):
        reboot(p)
        p.wait(0.5)
    p.wait(4)
    p._take_off(10)
