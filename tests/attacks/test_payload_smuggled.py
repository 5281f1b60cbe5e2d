"""Threat: a compiler that was taken over signs, as a command to payload, one that moves, arms or reconfigures the
vehicle; or an adapter that was taken over floods the payload, addresses others, or goes on after its step.
"""

from math import nan
from typing import Any

import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from reference import payload_case as payload
from reference.world import START
from rtshcua.codec.frames import Codec
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.parameters import NAN, nearest_bits, value_of
from rtshcua.model.flat.contract import Addressee, Contract, Emission, EmissionMoment, MotionKind
from rtshcua.onboard.enforcement.frames import OURS, FrameSession
from rtshcua.onboard.enforcement.load import EnforcementMode, load
from rtshcua.onboard.enforcement.payload_gate import payload_of
from rtshcua.onboard.ports import Command
from virtual import case
from virtual.rows import rows

AT = START.monotonic_us
AUTOPILOT, CAMERA, ADAPTER = Codec(1, 1), Codec(1, 100), Codec(1, OURS)
ONE = nearest_bits(1, 1)
#: takeoff, landing, return, waypoint, reposition, speed, mode, mission, arming, termination, motor test, home, fence,
#: parameters, reboot, parachute, actuators, relays
SMUGGLED = (22, 21, 20, 16, 192, 178, 176, 300, 400, 185, 209, 179, 207, 180, 245, 246, 208, 187, 181, 184, 193, 34)


def emitting(contract: Contract, *emits: Emission) -> Contract:
    return replace(contract, emits=emits) if contract.name == "goto" else contract


def loads(*emits: Emission) -> bool:
    """Whether a bundle loads whose policy and mission are signed by trusted keys, and emit these commands."""
    policy = case.policy()
    policy = replace(
        policy, contracts=tuple(emitting(each, *emits) for each in policy.contracts),
        vehicle=replace(policy.vehicle, servos=(9,)),
    )  # fmt: skip
    steps = [replace(each, contract=emitting(each.contract, *emits)) for each in case.short_steps()]
    now = replace(START, utc_us=case.mission(steps).issued_at_us + 60_000_000)
    found = load(
        case.seal(case.mission(steps), policy), root=case.root()[0], vehicle=policy.vehicle.identity, now=now,
        mode=EnforcementMode.SOFTWARE, session_key=bytes(32), flight=bytes(16), peer_is_own_simulator=True,
    )  # fmt: skip
    assert not isinstance(found, Refusal) or found.slug == "malformed", found
    return not isinstance(found, Refusal)


def gate(*emits: Emission) -> FrameSession:
    """A gate whose step emits these commands, although no bundle with them would load."""
    made = FrameSession()
    made.observe(AUTOPILOT.pack(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 0, 3)))
    made.observe(CAMERA.pack(mavlink.MAVLink_heartbeat_message(30, 8, 0, 0, 0, 3)))
    declared = payload_of(payload.contract(emits), payload.ARGUMENTS, 0, payload.policy())
    made.open(
        Command(7, "look", MotionKind.HOLD, (), (), 20_000, 0, payload=declared, not_after_us=AT + 1, servos=(9,))
    )
    return made


def frame(number: int, *parameters: float, to: int = 100, again: int = 0) -> bytes:
    filled = [*parameters, *[0.0] * (7 - len(parameters))]
    return ADAPTER.pack(mavlink.MAVLink_command_long_message(1, to, number, again, *filled))


def passed(of: FrameSession, *frames: bytes, at_us: int = AT) -> int:
    return sum(isinstance(of.seal(each, at_us), bytes) for each in frames)


def test_a_bundle_with_payload_loads() -> None:
    assert loads(payload.emission(2_000, 0, 0, ONE, 0, 0, 0, NAN))


@rows("command", SMUGGLED)
def test_a_bundle_that_smuggles_a_command_is_refused_and_the_gate_lets_it_pass_nowhere(command: int) -> None:
    for to in Addressee:
        smuggled = payload.emission(command, ONE, to=to)
        assert not loads(smuggled)
        of = gate(smuggled)
        assert passed(of, *(frame(command, 1, to=component) for component in (1, 100, 154))) == 0


@pytest.mark.parametrize("channel", [1, 4, 8, 10])
def test_a_motors_output_is_no_payload(channel: int) -> None:
    smuggled = payload.emission(183, nearest_bits(channel, 1), nearest_bits(1_000, 1), to=Addressee.VEHICLE)
    assert not loads(smuggled)
    assert passed(gate(smuggled), frame(183, channel, 1_000, to=1)) == 0


def test_parameter_writes_and_other_messages_to_a_camera_are_refused() -> None:
    of = gate(payload.emission(2_000, 0, 0, ONE, 0, 0, 0, NAN))
    zeros: Any = (0.0,) * 4
    for message in (
        mavlink.MAVLink_param_set_message(1, 100, b"CAM_MODE", 1.0, 9),
        mavlink.MAVLink_command_int_message(1, 100, 0, 2_000, 0, 0, *zeros, 0, 0, 0.0),
        mavlink.MAVLink_param_request_list_message(1, 100),
    ):
        assert passed(of, ADAPTER.pack(message)) == 0


def test_a_flood_of_declared_commands_is_bounded() -> None:
    """Ten seconds of as many frames as a link carries: a command for each interval, and three repetitions of each."""
    every = payload.emission(2_000, 0, 0, ONE, 0, 0, 0, NAN, moment=EmissionMoment.TIME, amount=1_000_000)
    of, out = gate(every), 0
    for at_us in range(AT, AT + 10_000_000, 5_000):
        for again in (0, 1):
            out += passed(of, frame(2_000, 0, 0, 1, 0, 0, 0, nan, again=again), at_us=at_us)
    assert out == 10 * (1 + 3)


def test_another_component_and_another_time_are_refused() -> None:
    declared = payload.emission(2_000, 0, 0, ONE, 0, 0, 0, NAN)
    shot = (2_000, 0, 0, 1, 0, 0, 0, nan)
    of = gate(declared)
    assert passed(of, *(frame(*shot, to=component) for component in range(256) if component != 100)) == 0
    of.close()
    assert passed(of, frame(*shot), frame(*shot, again=1)) == 0
    of.chain.over = True
    assert passed(of, frame(*shot), frame(2_001, 0, nan, nan, nan, 0, 0, nan)) == 0


def test_a_pilots_camera_is_not_stopped_by_a_runtime_that_began_nothing() -> None:
    of = gate(payload.emission(2_000, 0, 0, ONE, 0, 0, 0, NAN))
    assert passed(of, frame(2_000, 0, 0, 1, 0, 0, 0, nan)) == 1
    of.close()
    assert passed(of, frame(2_001, 0, nan, nan, nan, 0, 0, nan), frame(1_001, -3, -3, -1, -1), frame(206)) == 0


def test_each_of_several_videos_is_ended_where_it_was_begun() -> None:
    """A heartbeat of another camera, a video of another component or another number leave the ends of the others."""
    videos = [payload.emission(2_500, nearest_bits(each, 1), to=to) for each in (1, 2) for to in (Addressee.VEHICLE, 1)]
    of = gate(*videos)
    places = [(each, to) for each in (1, 2) for to in (1, 100)]
    assert passed(of, *(frame(2_500, each, to=to) for each, to in places)) == 4
    of.observe(Codec(1, 101).pack(mavlink.MAVLink_heartbeat_message(30, 8, 0, 0, 0, 3)))
    of.close()
    for each, to in places:
        stops = [frame(2_501, each, 0, nan, nan, 0, 0, nan, to=to, again=again) for again in range(6)]
        assert passed(of, *stops) == 4
        assert passed(of, *(frame(2_501, each, 0, nan, nan, 0, 0, nan, to=other) for other in (0, 101, 154))) == 0


def test_the_ends_of_many_steps_are_bounded() -> None:
    of = gate()
    for step in range(4):
        videos = [payload.emission(2_500, nearest_bits(8 * step + each, 1)) for each in range(1, 9)]
        declared = payload_of(payload.contract(tuple(videos)), payload.ARGUMENTS, 0, payload.policy())
        of.open(Command(8 + step, "look", MotionKind.HOLD, (), (), 20_000, 0, payload=declared, not_after_us=AT))
        assert passed(of, *(frame(2_500, 8 * step + each) for each in range(1, 9))) == 8
    of.close()
    stops = [frame(2_501, each, 0, nan, nan, 0, 0, nan) for each in range(1, 33)]
    assert [passed(of, each) for each in stops] == [0] * 23 + [1] * 9, "the latest of them"


def test_a_camera_is_of_the_vehicle_that_was_heard() -> None:
    """Before any vehicle was heard, a heartbeat of the system 0 is of none."""
    of = FrameSession()
    of.observe(Codec(0, 105).pack(mavlink.MAVLink_heartbeat_message(30, 8, 0, 0, 0, 3)))
    of.observe(AUTOPILOT.pack(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 0, 3)))
    of.observe(CAMERA.pack(mavlink.MAVLink_heartbeat_message(30, 8, 0, 0, 0, 3)))
    shot = payload.emission(2_000, 0, 0, ONE, 0, 0, 0, NAN)
    declared = payload_of(payload.contract((shot,)), payload.ARGUMENTS, 0, payload.policy())
    of.open(Command(7, "look", MotionKind.HOLD, (), (), 20_000, 0, payload=declared, not_after_us=AT))
    assert [passed(of, frame(2_000, 0, 0, 1, 0, 0, 0, nan, to=each)) for each in (105, 100)] == [0, 1]


@pytest.mark.parametrize(("enable", "ends"), [(ONE, 4), (0, 0), (nearest_bits(-1, 1), 0), (NAN, 0)])
def test_a_trigger_that_was_enabled_is_disabled_and_no_other(enable: int, ends: int) -> None:
    of = gate(payload.emission(2_003, enable))
    assert passed(of, frame(2_003, value_of(enable))) == 1
    of.close()
    assert passed(of, frame(2_003, 1), frame(2_003, 0, -1, -1, to=1)) == 0
    assert passed(of, *(frame(2_003, 0, -1, -1) for _ in range(6))) == ends
