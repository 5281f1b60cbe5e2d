"""Our end of the link: a frame refused by the boundary fails the manoeuvre; received frames are verified first."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from hostile.target import KEY, UTC_US, Target, greeting
from rtshcua.adapters.vehicle.link import VehicleLink
from rtshcua.codec.frames import Codec
from rtshcua.mavlink.framing import FLAG_SIGNED, FLAGS, unsigned
from rtshcua.mavlink.radio import UnsignedRadio
from rtshcua.mavlink.signing import SignedLink, SigningState
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.enforcement.frames import NO_SESSION, NO_VEHICLE, NOT_COVERED, FrameSession
from rtshcua.onboard.ports import Command, CommandFailed, Sent

LAND = Command(5, "land", MotionKind.LAND, (), (), 0, 0)
HOLD = Command(6, "hover", MotionKind.HOLD, (), (), 0, 0)


def test_frame_refused_by_boundary_fails_the_command() -> None:
    target = Target("px4", keyed=False)
    assert target.driver.begin(LAND, 7)[0] == [], "its mode is asked for"
    failed = [event for event in target.driver.tick(50_007)[0] if isinstance(event, CommandFailed)]
    assert failed == [CommandFailed(50_007, 5, NO_SESSION.slug)]
    assert not [event for event in target.driver.tick(10_000_000)[0] if isinstance(event, CommandFailed)], "told once"
    target.frames.open(LAND)
    target.now_us = 11_000_000
    target.receive(target.says(mavlink.MAVLink_attitude_message(11_900, 0, 0, 0, 0, 0, 0)))  # later frames are current:
    target.receive(target.says(greeting("px4")[0]))  # its mode is known
    assert target.driver.begin(LAND, 11_000_000)[0] == []
    events, _ = target.driver.tick(11_050_000)
    assert Sent(11_050_000, 5) in events


def test_another_command_than_the_permitted_one_does_not_leave() -> None:
    target = Target("ardupilot", keyed=False)
    target.frames.open(LAND)
    assert target.driver.begin(HOLD, 7) == ([CommandFailed(7, 6, NOT_COVERED.slug)], [])


def test_a_retry_after_the_session_was_closed_does_not_leave() -> None:
    target = Target("ardupilot", keyed=False)
    target.receive(target.says(mavlink.MAVLink_heartbeat_message(2, 3, 129, 4, 4, 3)))
    target.receive(target.says(mavlink.MAVLink_extended_sys_state_message(0, 2)))
    target.frames.open(LAND)
    target.driver.begin(LAND, 0)
    assert Sent(50_000, 5) in target.driver.tick(50_000)[0]
    target.frames.close()
    target.now_us = 1_500_000
    target.sent.clear()
    target.receive(target.says(mavlink.MAVLink_attitude_message(2_400, 0, 0, 0, 0, 0, 0)))  # later frames are current
    target.receive(target.says(mavlink.MAVLink_heartbeat_message(2, 3, 129, 4, 4, 3)))
    events, due = target.driver.tick(1_600_000)
    failed = [event for event in (*target.events, *events) if isinstance(event, CommandFailed)]
    assert failed == [CommandFailed(1_500_000, 5, NO_SESSION.slug)], "by what came after it was due"
    frames = [*target.sent, *due]
    messages = [received.message for frame in frames for received in Codec(9, 9).parse(frame)]
    assert mavlink.MAV_CMD_DO_SET_MODE not in [getattr(message, "command", None) for message in messages]


def test_with_a_key_whatever_leaves_is_signed() -> None:
    target = Target("px4", keyed=True)
    target.frames.open(LAND)
    frames = target.driver.begin(LAND, 0)[1] + target.driver.tick(5_000_000)[1]
    peer = SignedLink(KEY, SigningState(0, {}), UTC_US, 0)
    assert len(frames) > 1
    assert all(frame[FLAGS] & FLAG_SIGNED and peer.accept(frame, 5_000_000) for frame in frames)


def test_the_boundary_learns_of_the_vehicle_from_proved_frames_alone() -> None:
    theirs = SignedLink(KEY, SigningState(0, {}), UTC_US, 0)
    frames = FrameSession()
    link = VehicleLink(frames, SignedLink(KEY, SigningState(0, {}), UTC_US, 0))
    heartbeat = Codec(1, 1).pack(greeting("px4")[0])
    own = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)
    assert link.parse(heartbeat, 0) == []
    assert link.pack([own], 0) == ([], [NO_VEHICLE])
    assert [received.signed for received in link.parse(theirs.sign(heartbeat, 0), 0)] == [True]
    link.settle(1)
    assert [len(part) for part in link.pack([own], 0)] == [1, 0]


def test_an_unsigned_radio_is_heard_at_its_worst() -> None:
    link = VehicleLink(FrameSession(), UnsignedRadio(SignedLink(KEY, SigningState(0, {}), UTC_US, 0)))
    radio, told = Codec(1, 68), []
    for txbuf in (80, 20, 100):
        (received,) = link.parse(radio.pack(mavlink.MAVLink_radio_status_message(200, 200, txbuf, 0, 0, 0, 0)), 0)
        told.append(received.message.txbuf)
    assert told == [80, 20, 20]
    theirs = SignedLink(KEY, SigningState(0, {}), UTC_US, 0)
    signed = theirs.sign(radio.pack(mavlink.MAVLink_radio_status_message(200, 200, 90, 0, 0, 0, 0)), 0)
    assert [received.message.txbuf for received in link.parse(signed, 0)] == [90], "a signed one is believed"


@pytest.mark.parametrize(
    ("system", "component", "name", "named", "heard"),
    [
        (51, 68, "RADIO_STATUS", None, True),  # a SiK radio belongs to no vehicle
        (1, 68, "RADIO_STATUS", None, True),
        (51, 68, "RADIO_STATUS", 1, False),  # several vehicles: the link is ambiguous
        (51, 1, "RADIO_STATUS", None, False),
        (52, 68, "RADIO_STATUS", None, False),
        (51, 68, "HEARTBEAT", None, False),
    ],
)
def test_radio_status_is_accepted_only_from_a_radio(
    system: int, component: int, name: str, named: int | None, heard: bool
) -> None:
    link = VehicleLink(FrameSession(), None, named)
    link.settle(1)
    status = mavlink.MAVLink_radio_status_message(200, 200, 80, 0, 0, 0, 0)
    frame = Codec(system, component).pack(status if name == "RADIO_STATUS" else greeting("px4")[0])
    assert [each.name for each in link.parse(frame, 0)] == ([name] if heard else [])


def test_a_vehicle_may_be_system_51_itself() -> None:
    link = VehicleLink(FrameSession())
    link.settle(51)
    assert [each.name for each in link.parse(Codec(51, 1).pack(greeting("px4")[0]), 0)] == ["HEARTBEAT"]


def test_logged_frames_have_no_signature() -> None:
    signed = SignedLink(KEY, SigningState(0, {}), UTC_US, 0).sign(Codec(1, 1).pack(greeting("px4")[0]), 0)
    assert len(unsigned(signed)) == len(signed) - 13
    assert [received.signed for received in Codec(9, 9).parse(unsigned(signed))] == [False]
