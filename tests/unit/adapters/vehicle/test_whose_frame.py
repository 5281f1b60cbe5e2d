"""Foreign frames under the vehicle's ids are ignored, and so are answers to other senders."""

from collections.abc import Callable
from typing import Any

import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.adapters.vehicle.link import SILENT_US
from rtshcua.codec.frames import Codec, is_addressed
from rtshcua.mavlink.enums import VEHICLES
from rtshcua.model.faults import FlightMode, PilotMode, SecondVoice, Voice
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.enforcement.frames import OURS, FrameSession
from rtshcua.onboard.ports import (
    CommandFailed,
    Crashed,
    LinkLost,
    Noted,
    Ready,
    Sent,
    Succeeded,
    TakenOver,
    VehicleUnfit,
)
from rtshcua.simulation.config import AutopilotKind, SimulationConfig
from rtshcua.virtual.vehicle import VirtualVehicle
from virtual.copying import copied
from virtual.flyer import Flyer, climbed
from virtual.policy import POLICY
from virtual.rows import rows
from virtual.sampling import each_once

S = 1_000_000
PX4, ARDUPILOT, NONE = mavlink.MAV_AUTOPILOT_PX4, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_AUTOPILOT_INVALID
OWN = {"px4": PX4, "ardupilot": ARDUPILOT}
Make = Callable[..., Any]


def beat(kind: int, autopilot: int, armed: bool = False, mode: int = 0) -> Any:
    return mavlink.MAVLink_heartbeat_message(kind, autopilot, 128 if armed else 0, mode, 4, 3)


def says(one: Flyer, message: Any, system: int = 1, component: int = 1) -> list[Any]:
    """Receive one more frame from the link."""
    events, _, _ = one.vehicle.driver.receive(Codec(system, component).pack(message), one.now_us)
    one.events += events
    return list(events)


def noted(one: Flyer) -> list[str]:
    return [each.text for each in one.events if isinstance(each, Noted)]


# ---------------------------------------------------------------- who is chosen

STRANGERS = [
    ("a ground station's script", mavlink.MAV_TYPE_GCS, PX4),
    ("another script", mavlink.MAV_TYPE_GCS, ARDUPILOT),
    ("a companion computer", mavlink.MAV_TYPE_ONBOARD_CONTROLLER, PX4),
    ("a gimbal", mavlink.MAV_TYPE_GIMBAL, ARDUPILOT),
    ("a gimbal without autopilot", mavlink.MAV_TYPE_GIMBAL, NONE),
    ("an antenna tracker", mavlink.MAV_TYPE_ANTENNA_TRACKER, ARDUPILOT),
    ("a camera", mavlink.MAV_TYPE_CAMERA, PX4),
]


@rows(("name", "kind", "autopilot"), STRANGERS)
def test_sender_other_than_a_vehicle_is_never_chosen(name: str, kind: int, autopilot: int) -> None:
    driver = Driver(POLICY, FrameSession())
    driver.receive(Codec(255, 1).pack(beat(kind, autopilot)), S)
    assert driver.flavour is None
    driver.receive(Codec(1, 1).pack(beat(2, PX4)), S)
    assert driver.system == 1


def test_every_type_of_the_dialect_is_a_vehicle_or_is_not() -> None:
    """A new type in the dialect must be classified."""
    others = {
        "ANTENNA_TRACKER", "GCS", "ONBOARD_CONTROLLER", "GIMBAL", "ADSB", "CAMERA", "CHARGING_STATION", "FLARM",
        "SERVO", "ODID", "BATTERY", "PARACHUTE", "LOG", "OSD", "IMU", "GPS", "WINCH", "ILLUMINATOR", "GRIPPER",
    }  # fmt: skip
    names = {
        number: entry.name.removeprefix("MAV_TYPE_")
        for number, entry in mavlink.enums["MAV_TYPE"].items()
        if not entry.name.endswith("ENUM_END")
    }
    assert {name for number, name in names.items() if number not in VEHICLES} == others


@rows(("name", "kind", "autopilot"), STRANGERS)
def test_the_gate_takes_no_other_heartbeat_for_the_vehicles(name: str, kind: int, autopilot: int) -> None:
    gate = FrameSession()
    on_ground = mavlink.MAVLink_extended_sys_state_message(0, 1)
    for each in (beat(2, PX4, armed=True), on_ground, beat(kind, autopilot)):
        gate.observe(Codec(1, 1).pack(each), 5 * S)
    assert not gate.stands(5 * S), "it is armed, whatever a gimbal says"


# ---------------------------------------------------------------- what is heard of it


@pytest.mark.slow
@pytest.mark.parametrize("kind", [(26, NONE), (18, NONE), (26, 0), (2, NONE)])
def test_non_autopilot_heartbeat_is_ignored_and_noted_once(aloft: Make, kind: tuple[int, int]) -> None:
    one = aloft()
    one.begin(MotionKind.FLY, (60_000, 0), altitude=20_000, speed=5_000)
    one.wait(2)
    before = one.vehicle.driver.seen.mode
    for _ in range(5):
        assert not any(isinstance(each, TakenOver | CommandFailed | Crashed) for each in says(one, beat(*kind)))
        one.wait(0.1)
    assert one.vehicle.driver.seen.mode == before
    assert one.vehicle.driver.seen.armed
    assert isinstance(one.until((Succeeded, CommandFailed, TakenOver), 60), Succeeded)
    assert len([text for text in noted(one) if text.startswith("two senders use the ids 1/1")]) == 1


def test_foreign_heartbeat_does_not_keep_the_link_alive(aloft: Make) -> None:
    one = aloft()
    one.vehicle.lose = lambda frame: True
    one.vehicle.hurt = lambda datagram: []
    for _ in range(20):
        says(one, beat(26, NONE))
        one.wait(SILENT_US / S / 10)
    assert any(isinstance(each, LinkLost) for each in one.events)


@pytest.mark.slow
@pytest.mark.parametrize("voice", [Voice.GIMBAL, Voice.ANSWERS])
def test_the_simulated_second_voice_does_no_harm_from_the_start(flavour: str, voice: Voice) -> None:
    one = Flyer(flavour, faults=(SecondVoice(0, voice),))
    one.up()
    assert isinstance(one.fly(MotionKind.FLY, (60_000, 0), altitude=20_000, speed=5_000), Succeeded)
    assert isinstance(one.fly(MotionKind.LAND), Succeeded)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [(2, ARDUPILOT), (13, PX4), (1, ARDUPILOT), (13, ARDUPILOT)])
def test_second_vehicle_with_the_same_ids_prevents_readiness(flavour: str, kind: tuple[int, int]) -> None:
    if kind == (2, OWN[flavour]):
        kind = (2, PX4)
    one = Flyer(flavour)
    while one.vehicle.driver.flavour is None:
        one.wait(0.02)
    says(one, beat(*kind))
    one.wait(60)
    assert not any(isinstance(each, Ready) for each in one.events)
    assert (one.vehicle.driver.unready or "").startswith("two senders use the ids 1/1")


# ---------------------------------------------------------------- whom an answer is for

ADDRESSED = [(1, OURS, True), (0, 0, True), (0, OURS, True), (1, 0, True), (2, OURS, False), (255, OURS, False),
             (1, 190, False), (255, 190, False), (2, 0, False)]  # fmt: skip


@rows(("system", "component", "ours"), ADDRESSED)
def test_a_message_is_for_us_by_system_and_component(system: int, component: int, ours: bool) -> None:
    ack = mavlink.MAVLink_command_ack_message(176, 0, 0, 0, system, component)
    assert is_addressed(ack, 1, OURS) == ours


def test_a_message_without_target_is_for_everybody() -> None:
    assert is_addressed(mavlink.MAVLink_param_value_message(b"A", 1.0, 9, 1, 0), 1, OURS)


@pytest.mark.slow
@pytest.mark.parametrize("target", [(2, OURS), (255, OURS), (1, 190)])
def test_a_denial_to_somebody_else_refuses_no_command(aloft: Make, target: tuple[int, int]) -> None:
    one = aloft()
    one.vehicle.hurt = lambda datagram: [] if datagram == b"" else [datagram]
    lost: list[bytes] = []
    one.vehicle.lose = lambda frame: bool(lost.append(frame)) or Codec(9, 9).parse(frame)[0].name != "COMMAND_LONG"
    one.begin(MotionKind.LAND)
    for command in (176, 192, 22, 400):
        events = says(one, mavlink.MAVLink_command_ack_message(command, 4, 0, 0, *target))
        assert not any(isinstance(each, CommandFailed) for each in events)
    one.vehicle.lose = lambda frame: False
    assert isinstance(one.until((Succeeded, CommandFailed), 90), Succeeded)


@pytest.mark.parametrize("target", [(2, OURS), (255, 190)])
def test_answer_to_another_sender_does_not_prove_reception(flavour: str, target: tuple[int, int]) -> None:
    one = Flyer(flavour)
    one.vehicle.lose = lambda frame: True
    one.wait(1)
    says(one, mavlink.MAVLink_command_ack_message(512, 0, 0, 0, *target))
    one.wait(3)
    assert one.vehicle.driver.unready is not None
    assert not one.vehicle.driver._watch.answers


# ---------------------------------------------------------------- one frame that is forged, on a link without a key

ON_THE_GROUND, IN_AIR, LANDING = 1, 2, 4
MODES = {"px4": 0x0606_0000, "ardupilot": 9}


def own(one: Flyer, *, armed: bool = True, mode: int | None = None, state: int = 4) -> Any:
    """A heartbeat as the vehicle's own, with another mode, disarmed or critical."""
    flavour = "px4" if one.vehicle.driver.flavour.autopilot == PX4 else "ardupilot"
    told = one.vehicle.driver.seen.mode if mode is None else mode
    return mavlink.MAVLink_heartbeat_message(2, OWN[flavour], 128 if armed else 0, told, state, 3)


def elsewhere() -> Any:
    return mavlink.MAVLink_position_target_global_int_message(
        0, 5, 0, 473_000_000, 85_000_000, 600.0, 0, 0, 0, 0, 0, 0, 0, 0
    )


FORGED: dict[str, Callable[[Flyer], Any]] = {
    "another mode": lambda one: own(one, mode=99),
    "motors off": lambda one: own(one, armed=False),
    "a critical state": lambda one: own(one, state=5),
    "on the ground": lambda one: mavlink.MAVLink_extended_sys_state_message(0, ON_THE_GROUND),
    "landing": lambda one: mavlink.MAVLink_extended_sys_state_message(0, LANDING),
    "another target": lambda one: elsewhere(),
    "no fix": lambda one: mavlink.MAVLink_gps_raw_int_message(0, 0, 0, 0, 0, 0, 0, 0, 0, 0),
    "on its side": lambda one: mavlink.MAVLink_attitude_message(0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0),
}
BAD = TakenOver | CommandFailed | Crashed


@pytest.mark.slow
@pytest.mark.parametrize(("name", "after_s"), each_once(FORGED, (2.0, 2.31, 4.07)))
def test_forged_frame_does_not_end_a_leg(aloft: Make, name: str, after_s: float) -> None:
    one = aloft()
    one.begin(MotionKind.FLY, (60_000, 0), altitude=20_000, speed=5_000)
    one.wait(after_s)
    says(one, FORGED[name](one))
    end = one.until((Succeeded, CommandFailed, TakenOver, Crashed), 60)
    assert isinstance(end, Succeeded), end


def test_answers_that_are_held_back_make_no_forged_frame_count_for_longer(aloft: Make) -> None:
    """Regression: delayed TIMESYNC answers widened the time in which one frame counts as a takeover."""
    one = aloft()
    one.begin(MotionKind.FLY, (60_000, 0), altitude=20_000, speed=5_000)
    one.wait(2)
    one.vehicle.driver.source.clock._trips.extend([3 * S] * 8)
    says(one, FORGED["another mode"](one))
    end = one.until((Succeeded, CommandFailed, TakenOver, Crashed), 60)
    assert isinstance(end, Succeeded), end


@pytest.mark.parametrize("name", ["motors off", "on the ground"])
def test_forged_frame_does_not_end_a_takeoff(flavour: str, name: str) -> None:
    one = Flyer(flavour)
    one.until(Ready)
    one.begin(MotionKind.CLIMB, altitude=20_000)
    while not one.vehicle.driver.seen.armed:
        one.wait(0.02)
    one.wait(0.5)
    says(one, FORGED[name](one))
    assert isinstance(one.until((Succeeded, CommandFailed, TakenOver, Crashed), 60), Succeeded)


@pytest.mark.parametrize(
    ("says_", "each_us"), each_once((Voice.STRAYED, Voice.DISARMED), (100_000, 250_000, 1_000_000))
)
def test_contradicting_sender_in_flight_is_noted_and_ends_nothing(aloft: Make, says_: Voice, each_us: int) -> None:
    one = aloft()
    one.begin(MotionKind.FLY, (60_000, 0), altitude=20_000, speed=5_000)
    one.wait(2)
    one.vehicle.simulation.inject(SecondVoice(one.vehicle.simulation.now_us, says_, each_us, 20 * S))
    end = one.until((Succeeded, CommandFailed, TakenOver, Crashed), 60)
    assert isinstance(end, Succeeded), end
    if says_ is Voice.STRAYED:
        assert any(text.startswith("two senders use the ids 1/1") for text in noted(one))


@pytest.mark.parametrize("says_", [Voice.STRAYED])
def test_contradiction_on_the_ground_prevents_readiness(flavour: str, says_: Voice) -> None:
    one = Flyer(flavour, faults=(SecondVoice(0, says_, 250_000, 30 * S),))
    one.wait(20)
    assert not any(isinstance(each, Ready) for each in one.events)
    assert (one.vehicle.driver.unready or "").startswith("two senders use the ids 1/1")
    one.until(Ready, 60)


def test_takeover_is_detected_despite_a_contradicting_sender(aloft: Make) -> None:
    one = aloft()
    one.begin(MotionKind.FLY, (200_000, 0), altitude=20_000, speed=5_000)
    one.wait(2)
    one.vehicle.simulation.inject(SecondVoice(one.vehicle.simulation.now_us, Voice.STRAYED, 250_000, 60 * S))
    one.wait(4)
    one.vehicle.simulation.inject(PilotMode(one.vehicle.simulation.now_us, FlightMode.RETURN))
    assert isinstance(one.until((Succeeded, CommandFailed, TakenOver), 6), TakenOver)


# ---------------------------------------------------------------- what no waiting changes


def test_a_parameter_that_no_waiting_changes_is_told_once_and_soon(flavour: str) -> None:
    one = Flyer(flavour, return_mm=22_000)
    policy = replace(POLICY, vehicle=replace(POLICY.vehicle, return_altitude=80_000))
    one.vehicle = VirtualVehicle(policy, SimulationConfig(flavour=AutopilotKind(flavour), return_mm=22_000))
    told = one.until(VehicleUnfit, 30)
    one.wait(30)
    assert "returns at 22 m" in told.why
    assert sum(isinstance(each, VehicleUnfit) for each in one.events) == 1


def test_a_vehicle_that_only_needs_time_is_not_given_up(flavour: str) -> None:
    one = Flyer(flavour)
    one.until(Ready)
    assert not any(isinstance(each, VehicleUnfit) for each in one.events)


@pytest.mark.parametrize("next_", [None, MotionKind.HOME, MotionKind.LAND, MotionKind.FLY])
def test_takeover_is_detected_despite_forged_reports_of_our_mode(aloft: Make, next_: MotionKind | None) -> None:
    """Regression: a forged report refuted each true one, so the takeover was not detected for 10 s."""
    one = aloft()
    one.begin(MotionKind.FLY, (300_000, 0), altitude=20_000, speed=5_000)
    one.wait(4)
    ours = own(one, mode=one.vehicle.driver.seen.mode)
    one.vehicle.simulation.inject(PilotMode(0, FlightMode.POSITION))
    for beats in range(1_000):
        says(one, ours)
        one.wait(0.02)
        if next_ is not None and beats == 100:
            where = (200_000, 90_000) if next_ is MotionKind.FLY else None
            one.begin(next_, *((where,) if where else ()), altitude=25_000, speed=5_000)
        if any(isinstance(event, TakenOver | CommandFailed) for event in one.events):
            break
    assert any(isinstance(event, TakenOver) for event in one.events)
    assert one.truth.mode is FlightMode.POSITION


@pytest.mark.parametrize("kind", [MotionKind.HOLD, MotionKind.HOME, MotionKind.LAND])
def test_command_begun_after_one_report_of_a_left_mode_yields(
    kind: MotionKind,
) -> None:
    """No command of ours is running, as after a restart: the mode that is left counts as the earlier one."""
    one = copied(climbed("px4", 20_000))
    one.vehicle.driver._manoeuvre = None
    one.vehicle.simulation.inject(PilotMode(0, FlightMode.POSITION))
    for _ in range(400):
        one.wait(0.01)
        if one.vehicle.driver._left_mode is not None:
            break
    assert one.vehicle.driver._left_mode is not None
    token = one.begin(kind)
    one.wait(3)
    assert any(isinstance(event, TakenOver) for event in one.events)
    assert not any(isinstance(event, Sent) and event.token == token for event in one.events)
    assert one.truth.mode is FlightMode.POSITION
