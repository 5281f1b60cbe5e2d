"""A run restarted in the air requests missing reports instead of waiting, because the vehicle flies on."""

from functools import cache
from typing import Any

import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.vehicle.driver import WHO_US
from rtshcua.adapters.vehicle.messages import number_of
from rtshcua.adapters.vehicle.streams import ANSWER_US, StreamRequests, plan_streams
from rtshcua.codec.frames import Codec
from rtshcua.decision.rates import Rate
from rtshcua.mavlink.modes import Px4Mode
from rtshcua.model.faults import LinkLoss, PilotGoto
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.left import CommandInForce, Left
from rtshcua.onboard.ports import Command, Readings, Ready, TakenOver
from rtshcua.simulation.config import AutopilotKind, SimulationConfig
from rtshcua.virtual.vehicle import VirtualVehicle
from virtual.copying import copied
from virtual.flyer import Flyer
from virtual.policy import BATTERY, FIX, HEIGHT, POLICY, POSITION_X, SIGNALS

MS, S = 1_000, 1_000_000


@cache
def left_climbing(flavour: str) -> Flyer:
    """A vehicle whose run ended during a climb."""
    one = Flyer(flavour)
    one.until(Ready)
    one.begin(MotionKind.CLIMB, altitude=20_000)
    while one.truth.up_mm < 8_000:
        one.wait(0.1)
    one.wait(0.07)
    return one


def begun_again(one: Flyer, policy: Policy = POLICY) -> Flyer:
    before = one.vehicle
    assert before.driver.flavour is not None
    one.vehicle = VirtualVehicle(
        policy, SimulationConfig(flavour=AutopilotKind(before.driver.flavour.name)), before.clock
    )
    one.vehicle.simulation = before.simulation
    one.events.clear()
    driver = one.vehicle.driver
    driver.resumes = driver.hurries = True
    driver.left = Left((CommandInForce(Command(1, "takeoff", MotionKind.CLIMB, (), (), 20_000, 0)),))
    return one


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
@pytest.mark.parametrize("phase_ms", [0, 250, 500, 750])
def test_a_restart_in_the_air_is_soon_ready(flavour: str, phase_ms: int) -> None:
    """The next heartbeat or report of PX4 may take a second, and ArduCopter reports no target here:
    that took up to 3 s, at 6 m/s. A radio cannot be asked for its status, which counts here: 0.5 s.
    """
    one = copied(left_climbing(flavour))
    one.wait(phase_ms / 1_000)
    begun_us = begun_again(one).now_us
    ready = one.until(Ready, 1)
    assert ready.others == ""
    assert ready.at_us - begun_us <= 600 * MS


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
@pytest.mark.parametrize("phase_ms", [0, 250, 610])
def test_link_without_radio_is_ready_at_once(flavour: str, phase_ms: int) -> None:
    """The fallback depends on the position: before the estimator confirmed it, the vehicle landed on the spot."""
    one = copied(left_climbing(flavour))
    one.wait(phase_ms / 1_000)
    begun_us = begun_again(one, replace(POLICY, signals=SIGNALS[:-1])).now_us
    assert one.until(Ready, 1).at_us - begun_us <= 280 * MS
    read = {slot for each in one.events if isinstance(each, Readings) for slot, value in each.values if value}
    assert {BATTERY, HEIGHT, FIX, POSITION_X} <= read
    assert one.vehicle.driver.seen.located


def test_foreign_target_is_seen_without_waiting() -> None:
    one = copied(left_climbing("ardupilot"))
    one.vehicle.simulation.inject(PilotGoto(0, 100_000, 0, 30_000))
    one.wait(0.2)
    assert begun_again(one).until(Ready, 0.6).others == "another target"


def test_lossy_link_waits_for_a_target_report() -> None:
    one = copied(left_climbing("ardupilot"))
    one.vehicle.simulation.inject(LinkLoss(0, 3_000))
    one.vehicle.simulation.inject(PilotGoto(0, 100_000, 0, 30_000))
    one.wait(0.2)
    assert begun_again(one).until(Ready, 10).others == "another target"


@pytest.mark.parametrize(("armed", "taken"), [(False, []), (True, ["Return"])])
def test_landing_during_a_silence_is_not_a_takeover(armed: bool, taken: list[str]) -> None:
    """The last report of flight is old, and the first new one reports stopped motors in another mode."""
    one = begun_again(copied(left_climbing("px4")))
    one.until(Ready, 1)
    one.vehicle.hurt = lambda datagram: ()
    one.wait(5)
    beat = mavlink.MAVLink_heartbeat_message(2, 12, 128 if armed else 0, Px4Mode.RETURN, 4, 3)
    codec = Codec(1, 1)
    for _ in range(2):
        one.events += one.vehicle.driver.receive(codec.pack(beat), one.now_us).events
    assert [event.how for event in one.events if isinstance(event, TakenOver)] == taken


def questions(frames: Any) -> list[tuple[int, int]]:
    """The requested messages, with the systems that they are requested from."""
    received = [each for frame in frames for each in Codec(1, 1).parse(frame)]
    return [
        (each.message.target_system, int(each.message.param1))
        for each in received
        if getattr(each.message, "command", None) == mavlink.MAV_CMD_REQUEST_MESSAGE
    ]


@pytest.mark.parametrize("hurries", [True, False])
def test_sender_is_identified_before_its_heartbeat(hurries: bool) -> None:
    driver = VirtualVehicle(POLICY, SimulationConfig()).driver
    driver.hurries = hurries
    position = mavlink.MAVLink_global_position_int_message(1, 0, 0, 0, 0, 0, 0, 0, 0)
    says = Codec(7, 1)
    asked = [questions(driver.receive(says.pack(position), at_us).answers) for at_us in (1, WHO_US, WHO_US + 1)]
    assert asked == ([[(7, 0)], [], [(7, 0)]] if hurries else [[], [], []])
    others = Codec(8, 154).pack(position)  # no autopilot
    assert driver.receive(others, 10 * S).answers == []


def test_missing_reports_are_requested_once_per_interval() -> None:
    rates = {name: Rate(S // 4, S) for name in ("BATTERY_STATUS", "GPS_RAW_INT", "SYS_STATUS")}
    streams = StreamRequests(plan_streams(rates, None, signed=False), [frozenset({name}) for name in rates])
    assert streams.due_once(1, 0) == []  # no report is awaited yet
    streams.renew(S)
    streams.heard("GPS_RAW_INT", S)
    missing = ["ATTITUDE", "BATTERY_STATUS", "EXTENDED_SYS_STATE", "GLOBAL_POSITION_INT", "HEARTBEAT", "SYS_STATUS"]

    def asked(now_us: int) -> list[int]:
        return [int(message.param1) for message in streams.due_once(1, now_us)]

    assert set(asked(S)) <= {number_of(name) for name in missing}
    assert number_of("BATTERY_STATUS") in {int(each) for each in asked(S + ANSWER_US)}
    assert asked(S + ANSWER_US + 1) == []
