"""Faults of real links and vehicles: refusals, losses, takeovers, garbage, silence."""

from collections.abc import Callable
from random import Random
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.codec.frames import Codec
from rtshcua.model.faults import BatteryLevel, FlightMode, GpsLoss, LinkDelay, LinkLoss, LinkSilence, PilotMode
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import (
    AirState,
    CommandFailed,
    LinkBack,
    LinkLost,
    Noted,
    Readings,
    Ready,
    Succeeded,
    TakenOver,
    VehicleAnswers,
)
from rtshcua.simulation.kinematics import Body
from rtshcua.simulation.place import HomePosition
from rtshcua.virtual.vehicle import SECOND
from virtual.policy import BATTERY, FIX, HEIGHT, POLICY, POSITION_X
from virtual.sampling import each_once

Make = Callable[..., Any]
#: `make test` uses one autopilot where the result does not depend on it
ONE_FLAVOUR = pytest.mark.parametrize("flavour", ["px4", pytest.param("ardupilot", marks=pytest.mark.soak)])
OTHER_FLAVOUR = pytest.mark.parametrize("flavour", ["ardupilot", pytest.param("px4", marks=pytest.mark.soak)])
COMMANDS = ("COMMAND_LONG", "COMMAND_INT")


#: our commands, all sent by the end of the leg or of the way home
OURS = (
    mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_NAV_TAKEOFF,
    mavlink.MAV_CMD_DO_REPOSITION, mavlink.MAV_CMD_DO_CHANGE_SPEED,
)  # fmt: skip


def of_command(frame: bytes, number: int) -> bool:
    (received,) = Codec(1, 1).parse(frame)
    return received.name in COMMANDS and received.message.command == number


def asks(frame: bytes) -> bool:
    """Whether the frame only requests a message."""
    return of_command(frame, mavlink.MAV_CMD_REQUEST_MESSAGE)


def test_pilot_takes_over_while_it_flies(aloft: Make, flavour: str) -> None:
    one = aloft()
    one.begin(MotionKind.FLY, (300_000, 0), altitude=20_000, speed=5_000)
    one.wait(3)
    one.vehicle.simulation.inject(PilotMode(0, FlightMode.POSITION))
    begun = one.now_us
    taken = one.until(TakenOver, 5)
    assert taken.how == {"px4": "Position", "ardupilot": "POSHOLD"}[flavour]
    assert taken.at_us - begun < 500_000  # the heartbeat was requested at 5 Hz
    assert not any(isinstance(event, (TakenOver, CommandFailed, Succeeded)) for event in one.wait(10))


@OTHER_FLAVOUR
def test_pilot_takes_over_after_the_last_command_succeeded(aloft: Make) -> None:
    one = aloft()
    one.wait(5)
    one.vehicle.simulation.inject(PilotMode(0, FlightMode.ALTITUDE))
    one.until(TakenOver, 5)


@pytest.mark.parametrize(
    ("kind", "flavour"), each_once([MotionKind.FLY, MotionKind.HOLD, MotionKind.HOME], ["px4", "ardupilot"])
)
def test_its_own_failsafe_takes_over(aloft: Make, kind: MotionKind) -> None:
    one = aloft()
    one.begin(kind, *([(300_000, 0)] if kind == MotionKind.FLY else []), altitude=20_000)
    one.wait(3)
    one.vehicle.simulation.inject(BatteryLevel(0, 300))
    assert one.until(TakenOver, 10).how in ("Land", "LAND", "landing", "another target"), "whatever shows first"


@ONE_FLAVOUR
def test_released_vehicle_receives_no_commands(aloft: Make) -> None:
    one = aloft()
    one.begin(MotionKind.FLY, (300_000, 0), altitude=20_000)
    one.vehicle.release()
    moving: list[str] = []
    one.vehicle.lose = lambda frame: moving.extend(f.name for f in Codec(1, 1).parse(frame)) or False
    one.wait(10)
    assert set(moving) == {"HEARTBEAT", "TIMESYNC"}


def test_refused_arming_fails_with_the_reason(flyer: Make, flavour: str) -> None:
    one = flyer()
    one.until(Ready)
    one.vehicle.simulation.inject(GpsLoss(0))
    one.wait(10)
    end = one.fly(MotionKind.CLIMB, altitude=20_000)
    assert isinstance(end, CommandFailed)
    assert end.reason in ("refused/temporarily", "refused/failed")
    if flavour == "ardupilot":  # PX4 says nothing to an onboard controller
        assert "requires position" in end.text
    assert not one.truth.armed
    assert one.truth.mode is not FlightMode.TAKEOFF, "nor does it take off once somebody else arms it"


@pytest.mark.parametrize("kind", [MotionKind.FLY, MotionKind.COVER, MotionKind.HOLD])
def test_disarmed_vehicle_fails_a_leg(flyer: Make, kind: MotionKind) -> None:
    one = flyer()
    one.until(Ready)
    end = one.fly(kind, *([(30_000, 0)] if kind != MotionKind.HOLD else []), altitude=20_000)
    assert (type(end), end.reason) == (CommandFailed, "disarmed")


def goes_on(one: Any, command: int) -> None:
    """Whatever was lost, the vehicle flies a leg and returns home."""
    assert isinstance(one.fly(MotionKind.FLY, (40_000, 0), altitude=20_000, speed=5_000), Succeeded)
    if command == mavlink.MAV_CMD_DO_SET_MODE:
        assert isinstance(one.fly(MotionKind.HOME), Succeeded)


@pytest.mark.slow
@pytest.mark.parametrize(("command", "flavour"), each_once(OURS, ["px4", "ardupilot"]))
def test_lost_acknowledgements_change_nothing(flyer: Make, command: int) -> None:
    """An obeyed command without acknowledgement is detected by its effect; a refused retry does not count."""

    def drop(datagram: bytes) -> list[bytes]:
        found = Codec(1, 1).parse(datagram)
        lost = any(f.name == "COMMAND_ACK" and f.message.command == command for f in found)
        return [] if lost and len(dropped) < 2 and not dropped.append(1) else [datagram]

    dropped: list[int] = []
    one = flyer()
    one.vehicle.hurt = drop
    one.up()
    goes_on(one, command)


@pytest.mark.slow
@pytest.mark.parametrize(("command", "flavour"), each_once(OURS, ["ardupilot", "px4"]))
def test_lost_commands_are_sent_again(flyer: Make, flavour: str, command: int) -> None:
    confirmations: list[int] = []

    def lose(frame: bytes) -> bool:
        if not of_command(frame, command) or len(confirmations) >= 2:
            return False
        confirmations.append(getattr(Codec(1, 1).parse(frame)[0].message, "confirmation", len(confirmations)))
        return True

    one = flyer()
    if (flavour, command) == ("px4", mavlink.MAV_CMD_DO_SET_MODE):
        one.up()  # it stands in Hold already, so that the effect is there whether the command arrives or not
    one.vehicle.lose = lose
    if not one.truth.armed:
        one.up()
    goes_on(one, command)
    assert confirmations in ([], [0, 1])


@ONE_FLAVOUR
def test_flies_on_a_poor_and_slow_link(flyer: Make) -> None:
    one = flyer(faults=(LinkLoss(0, 2_000), LinkDelay(0, 300_000)), seed=5)
    one.up()
    assert isinstance(one.fly(MotionKind.FLY, (40_000, 30_000), altitude=20_000, speed=5_000), Succeeded)
    assert isinstance(one.fly(MotionKind.HOME), Succeeded)


@OTHER_FLAVOUR
def test_unanswered_command_neither_succeeds_nor_fails(flyer: Make) -> None:
    """Reports arrive, but our frames do not reach the vehicle, so the command's state stays unknown."""
    one = flyer()
    one.until(Ready)
    one.vehicle.lose = lambda frame: True
    token = one.begin(MotionKind.CLIMB, altitude=20_000)
    happened = one.wait(30)
    assert "the vehicle is heard but answers nothing" in [event.text for event in happened if isinstance(event, Noted)]
    assert not any(isinstance(event, (Succeeded, CommandFailed, LinkLost)) for event in happened)
    assert [event.answers for event in happened if isinstance(event, VehicleAnswers)] == [False]
    one.vehicle.lose = lambda frame: False
    assert one.until((Succeeded, CommandFailed), 60) == Succeeded(one.now_us, token)
    assert [event.answers for event in one.events if isinstance(event, VehicleAnswers)] == [False, True]


def test_airborne_vehicle_is_ready_once_it_answers(aloft: Make) -> None:
    """The fallback depends on the known state; while the vehicle does not answer, no command would arrive."""
    one = aloft()
    one.vehicle.lose = lambda frame: True
    one.vehicle.driver = Driver(POLICY, one.vehicle.frames, fence=False)
    happened = one.wait(30)
    assert [event.answers for event in happened if isinstance(event, VehicleAnswers)] == [False]
    assert not any(isinstance(event, (Ready, LinkLost)) for event in happened)
    assert one.vehicle.driver.unready == "the vehicle answers no request"
    one.vehicle.lose = lambda frame: False
    before = len(one.events)
    one.until(Ready, 10)
    told = [event.values for event in one.events[before:] if isinstance(event, Readings)]
    known = {slot for values in told for slot, value in values if value is not None}
    assert known >= {BATTERY, HEIGHT, FIX, POSITION_X}, "one report of each kind"
    token = one.begin(MotionKind.HOME)
    assert one.until((Succeeded, CommandFailed, TakenOver), 120) == Succeeded(one.now_us, token)


def test_airborne_vehicle_without_time_is_ready(aloft: Make) -> None:
    """The vehicle answers and can be landed, but its reports have no age."""
    one = aloft()
    one.vehicle.lose = lambda frame: Codec(1, 1).parse(frame)[0].name == "TIMESYNC"
    one.vehicle.driver = Driver(POLICY, one.vehicle.frames, fence=False)
    began_us = one.now_us
    assert 5 * SECOND <= one.until(Ready, 20).at_us - began_us <= 11 * SECOND


def test_overtaken_heartbeat_is_not_a_takeover(aloft: Make) -> None:
    """Both were sent between the same two stamps; only their sequence numbers show the order."""
    one = aloft()
    one.begin(MotionKind.FLY, (100_000, 0), altitude=20_000, speed=5_000)
    one.wait(3)
    last: list[Any] = []
    overtaken: list[bytes] = []

    def overtake(datagram: bytes) -> list[bytes]:
        for received in Codec(1, 1).parse(datagram):
            if received.name == "HEARTBEAT":
                older, last[:] = list(last), [received.message]
                if older and older[0].custom_mode != received.message.custom_mode:
                    codec = Codec(received.system, received.component)
                    frames = [codec.pack(older[0]) for _ in range(received.sequence or 256)]
                    overtaken.append(frames[-1])
                    return [datagram, frames[-1]]
        return [datagram]

    one.vehicle.hurt = overtake
    one.wait(1)
    token = one.begin(MotionKind.HOME)
    assert one.until((Succeeded, CommandFailed, TakenOver), 120) == Succeeded(one.now_us, token)
    assert overtaken


@ONE_FLAVOUR
def test_a_link_that_fails_upward_first_and_then_downward_is_lost(aloft: Make) -> None:
    """A radio at the end of its range first loses the uplink, then the downlink."""
    one = aloft()
    one.begin(MotionKind.HOLD)
    one.wait(1)
    one.vehicle.lose = lambda frame: True
    noted = one.until(Noted, 10)
    while noted.text != "the vehicle is heard but answers nothing":
        noted = one.until(Noted, 10)
    one.vehicle.simulation.inject(LinkSilence(one.vehicle.simulation.now_us, 5_000_000))
    begun = one.now_us
    answering = sum(isinstance(event, VehicleAnswers) for event in one.events)
    lost = one.until(LinkLost, 3)
    assert 900_000 <= lost.at_us - begun <= 1_400_000
    one.vehicle.lose = lambda frame: False
    said = one.until((LinkBack, Noted, VehicleAnswers), 10)
    assert isinstance(said, LinkBack), "not that the vehicle answers again, before it was heard"
    assert one.until(VehicleAnswers, 3).answers, "it goes on to answer nothing until it is heard to answer"
    assert sum(isinstance(event, VehicleAnswers) for event in one.events) == answering + 1


@OTHER_FLAVOUR
def test_a_command_that_is_never_answered_while_questions_are_has_failed(flyer: Make) -> None:
    one = flyer()
    one.until(Ready)
    one.vehicle.lose = lambda frame: of_command(frame, mavlink.MAV_CMD_COMPONENT_ARM_DISARM)
    end = one.fly(MotionKind.CLIMB, altitude=20_000)
    assert (type(end), end.reason) == (CommandFailed, "unknown/no-answer")


@ONE_FLAVOUR
def test_a_hurried_vehicle_is_given_more_time(flyer: Make) -> None:
    waits = []
    for slack in (1, 4):
        one = flyer()
        one.vehicle.driver._commander.slack = slack
        one.until(Ready)
        begun = one.now_us
        one.vehicle.lose = lambda frame: of_command(frame, mavlink.MAV_CMD_COMPONENT_ARM_DISARM)
        assert one.fly(MotionKind.CLIMB, altitude=20_000).reason == "unknown/no-answer"
        waits.append(one.now_us - begun)
    assert 3.5 < waits[1] / waits[0] < 4.5


@ONE_FLAVOUR
def test_stopping_short_is_a_failure(aloft: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """The vehicle stands but still reports our target."""
    one = aloft()
    one.begin(MotionKind.FLY, (200_000, 0), altitude=20_000, speed=5_000)
    one.wait(6)
    monkeypatch.setattr(Body, "track", lambda body, *_: body.crash())
    assert one.until(CommandFailed, 40).reason == "stopped-short"


@OTHER_FLAVOUR
def test_garbage_and_foreign_systems_change_nothing(flyer: Make) -> None:
    chance = Random(3)
    stranger = Codec(9, 1)
    neighbour = Codec(1, 154)

    def mix(datagram: bytes) -> list[bytes]:
        bent = bytearray(datagram)
        bent[chance.randrange(len(bent))] ^= 1 << chance.randrange(8)
        return [
            chance.randbytes(chance.randrange(1, 80)),
            datagram[: chance.randrange(len(datagram))],
            bytes(bent) if bent[0] == 0xFD else b"",
            stranger.pack(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)),
            stranger.pack(mavlink.MAVLink_global_position_int_message(1, 0, 0, 0, 99_000, 0, 0, 0, 0)),
            stranger.pack(mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 4)),
            neighbour.pack(mavlink.MAVLink_heartbeat_message(26, 8, 0, 77, 4, 3)),
            neighbour.pack(mavlink.MAVLink_extended_sys_state_message(0, 1)),
            neighbour.pack(mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 4)),
            datagram,
        ]

    one = flyer()
    one.until(Ready)
    one.vehicle.hurt = mix
    one.events.clear()
    assert isinstance(one.fly(MotionKind.CLIMB, altitude=20_000), Succeeded)
    assert isinstance(one.fly(MotionKind.FLY, (30_000, 0), altitude=20_000), Succeeded)
    assert isinstance(one.fly(MotionKind.LAND), Succeeded)
    assert all(
        abs(value) < 30_000 for e in one.events if isinstance(e, Readings) for slot, value in e.values if slot == 1
    )
    assert [e.airborne for e in one.events if isinstance(e, AirState)].count(True) == 1


@OTHER_FLAVOUR
def test_an_acknowledgement_for_somebody_else_is_not_ours(flyer: Make) -> None:
    autopilot = Codec(1, 1)
    refusal = mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 4, 0, 0, 255, 190)
    one = flyer()
    one.until(Ready)
    one.vehicle.hurt = lambda datagram: [autopilot.pack(refusal), datagram]
    assert isinstance(one.fly(MotionKind.CLIMB, altitude=20_000), Succeeded)


@ONE_FLAVOUR
def test_silence_is_noticed_and_so_is_its_end(aloft: Make) -> None:
    one = aloft()
    one.vehicle.simulation.inject(LinkSilence(one.vehicle.simulation.now_us, 14_000_000))
    begun = one.now_us
    lost = one.until(LinkLost, 10)
    assert 900_000 < lost.at_us - begun < 1_200_000
    assert lost.why == "silent"
    assert not any(isinstance(event, LinkLost) for event in one.wait(10))
    one.until(LinkBack, 4)


@OTHER_FLAVOUR
def test_streams_that_stop_are_asked_for_again(flyer: Make) -> None:
    one = flyer()
    one.until(Ready)
    one.vehicle.simulation._autopilot.streams.set(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, -1)
    one.wait(6)
    one.events.clear()
    one.wait(1)
    assert any(slot == 1 for event in one.events if isinstance(event, Readings) for slot, _ in event.values)


@ONE_FLAVOUR
def test_a_vehicle_far_from_the_policys_home_is_not_ready(flyer: Make) -> None:
    one = flyer(home=HomePosition(473_977_400, 85_475_900, 488_000))
    assert not any(isinstance(event, Ready) for event in one.wait(10))
    assert one.vehicle.driver.unready == "the vehicle is 150 m from the policy's home, more than 50 m"


def test_a_vehicle_without_a_fix_is_not_ready(flyer: Make) -> None:
    one = flyer(faults=(GpsLoss(0),))
    assert not any(isinstance(event, Ready) for event in one.wait(10))
    assert one.vehicle.driver.unready == "no 3D position fix"


def test_a_battery_too_low_to_arm_is_not_ready(flyer: Make) -> None:
    one = flyer(battery=500)
    assert not any(isinstance(event, Ready) for event in one.wait(10))
    assert one.vehicle.driver.unready is not None
    assert one.vehicle.driver.unready.startswith("the vehicle's checks before arming fail")


@pytest.mark.slow
def test_mode_change_before_arming_is_a_takeover(flyer: Make, flavour: str) -> None:
    one = flyer()
    one.until(Ready)
    armings: list[int] = []

    def lose(frame: bytes) -> bool:
        if of_command(frame, mavlink.MAV_CMD_COMPONENT_ARM_DISARM):
            armings.append(one.now_us)
            return True
        return False

    one.vehicle.lose = lose
    one.begin(MotionKind.CLIMB, altitude=20_000)
    one.wait(1)
    assert armings
    one.vehicle.simulation.inject(PilotMode(0, FlightMode.POSITION))
    one.until(TakenOver, 2)
    armings.clear()
    one.wait(10)
    assert armings == [], "nothing is sent again into the pilot's mode"
