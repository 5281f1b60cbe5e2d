import json
import struct
from math import nan
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from reference.gateway_world import (
    NORTH,
    SYSTEM,
    GatewayWorld,
    acks,
    command_int,
    command_long,
    policy,
    proposals,
    reposition,
    setpoint,
    texts,
    told,
)
from reference.sources import CHECKOUT
from rtshcua.ground.gateway.accepted import COMMAND, AcceptedCommand, ArgumentSource
from rtshcua.ground.gateway.client_link import ClientLink
from rtshcua.ground.gateway.interface import (
    Action,
    ClientNote,
    ClientSettings,
    FlightEnded,
    Propose,
    RequestFrame,
    ToClient,
    Withhold,
)
from rtshcua.mavlink.modes import ARDUPILOT, PX4, CopterMode, Px4Mode

BEAT = frozenset({0})


def withheld(actions: list[Action]) -> list[frozenset[int]]:
    return [each.messages for each in actions if isinstance(each, Withhold)]


def beats(actions: list[Action]) -> list[tuple[int, int]]:
    """The armed bit and the mode of each HEARTBEAT to the client."""
    found = [message for message in told(actions) if message.get_type() == "HEARTBEAT"]
    return [(message.base_mode >> 7, message.custom_mode) for message in found]


def arm(wanted: float = 1, force: float = 0, *rest: float) -> Any:
    return command_long(400, wanted, force, *rest)


# ---------------------------------------------------------------- arming


def test_arming_on_the_ground_is_absorbed_and_shown_for_a_bounded_time() -> None:
    world = GatewayWorld()
    world.ready()
    actions = world.send(arm())
    assert acks(actions) == [(400, 0)]
    assert withheld(actions) == [BEAT]
    assert beats(actions) == [(1, Px4Mode.HOLD)], "at once, and not only with the next HEARTBEAT"
    assert texts(actions) == ["armed for you; a permitted take-off arms the vehicle"]
    assert proposals(actions) == []
    assert beats(world.report()) == [(1, Px4Mode.HOLD)]
    world.wait(19_000_000, step_us=500_000)
    assert beats(world.report()) == [(1, Px4Mode.HOLD)]
    assert withheld(world.wait(1_500_000)) == [frozenset()], "after 20 s without a take-off"
    assert beats(world.report()) == []


def test_the_vehicles_own_arming_ends_what_is_shown() -> None:
    world = GatewayWorld()
    world.ready()
    world.send(arm())
    actions = world.report(armed=True)
    assert withheld(actions) == [frozenset()]
    assert beats(actions) == []


def test_only_the_client_that_armed_sees_it() -> None:
    world = GatewayWorld()
    world.client(2, "other")
    world.ready()
    world.send(arm())
    assert [message.get_type() for message in told(world.report(), client=2)] == []


def test_mavsdk_arms_with_nan_in_the_other_parameters() -> None:
    world = GatewayWorld()
    world.ready()
    assert acks(world.send(arm(1, nan, nan, nan, nan, nan, nan))) == [(400, 0)]
    assert acks(world.send(command_int(400, 0, 1, x=0, y=0, z=0))) == [(400, 0)]


def test_disarming_ends_an_absorbed_arming() -> None:
    world = GatewayWorld()
    world.ready()
    world.send(arm())
    actions = world.send(arm(0))
    assert acks(actions) == [(400, 0)]
    assert withheld(actions) == [frozenset()]
    assert acks(world.send(arm(0))) == [(400, 0)], "nothing is armed"


def test_arming_that_would_have_an_effect_is_refused() -> None:
    """By hand: parameters 1 and 2, whether it is armed and in the air, and the result."""
    table = (
        (1, 21196, False, 2), (0, 21196, False, 2), (0, 21196, True, 2), (1, 1, False, 2), (0, 0, True, 1),
        (2, 0, False, 2), (nan, 0, False, 2), (1, 0, True, 0),
    )  # fmt: skip
    for one, two, flies, result in table:
        world = GatewayWorld()
        world.ready()
        if flies:
            world.fly()
        actions = world.send(arm(one, two))
        assert acks(actions) == [(400, result)], (one, two, flies)
        assert withheld(actions) == []


def test_a_vehicle_that_is_not_ready_is_not_shown_as_armed() -> None:
    world = GatewayWorld()
    world.ready()
    world.line(type="vehicle", ready=False, unready="no position yet")
    actions = world.send(arm())
    assert acks(actions) == [(400, 1)]
    assert texts(actions) == ["Arming denied: no position yet"]
    world.line(type="vehicle", ready=False)
    assert texts(world.send(arm())) == ["Arming denied: the vehicle is not ready"]


def test_arming_is_refused_where_no_take_off_could_follow() -> None:
    """By hand: the autopilot, the role, the charge, the answer. ArduPilot's prefix is what several clients look for."""
    world = GatewayWorld()
    world.ready()
    world.signals["battery"] = (3_000,)
    actions = world.send(arm())
    assert acks(actions) == [(400, 1)]
    (said,) = texts(actions)
    assert said.startswith("Arming denied: battery 30 %, accepted "), said
    assert withheld(actions) == []
    world = GatewayWorld(ARDUPILOT)
    world.client(2, "nobody", role="trainee")
    world.ready()
    actions = world.send(arm(), client=2)
    assert acks(actions, 2) == [(400, 2)]
    assert texts(actions, 2) == ["PreArm: no rule of bridge_inspection names the role trainee"]
    chunks = [message.text for message in told(actions, 2) if message.get_type() == "STATUSTEXT"]
    assert chunks == ["PreArm: no rule of bridge_inspection names the".ljust(50), "role trainee"]
    assert acks(world.send(arm())) == [(400, 0)], "another role may take off"


def test_while_the_vehicle_lands_arming_and_take_off_have_one_answer() -> None:
    """By hand: `landed_state`, and whether the flight is over. Touched down, the vehicle stays armed for a moment."""
    world = GatewayWorld()
    world.fly()
    for landed, lands in ((4, True), (1, True), (2, False)):
        world.vehicle(mavlink.MAVLink_extended_sys_state_message(0, landed))
        world.signals["landed"] = (landed,)
        for message, number, before in (
            (arm(), 400, "Arming denied: "),
            (command_long(22, 0, 0, 0, 0, 0, 0, 503), 22, "takeoff rejected: "),
        ):
            actions = world.send(message)
            if lands:
                assert (acks(actions), texts(actions)) == ([(number, 1)], [before + "the vehicle is still landing"])
            else:
                assert "landing" not in "".join(texts(actions))
    world.take(FlightEnded())
    world.report(armed=False, airborne=False)
    world.signals["landed"] = (1,)
    world.ready()
    assert acks(world.send(arm())) == [(400, 0)]


def test_arming_is_accepted_where_any_skill_may_take_off(tmp_path: Path) -> None:
    """`hop` demands less charge than `takeoff`, and both are asked."""
    take_off = (CHECKOUT / "skills/takeoff.rts").read_text()
    hop = take_off[take_off.index("skill takeoff") : take_off.index("  // What a MAVLink client")] + "}\n"
    policies = (CHECKOUT / "policies/bridge_inspection.rts").read_text()
    source = tmp_path / "hops.rts"
    source.write_text(
        policies.replace(
            "policy bridge_inspection", hop.replace("skill takeoff", "skill hop") + "policy bridge_inspection"
        )
        .replace("battery > 40 %", "battery > 20 %")
        .replace("  permit  goto by", "  permit  hop by role operator through agent\n  permit  goto by")
    )
    row = AcceptedCommand("hop", COMMAND, "MAV_CMD_NAV_VTOL_TAKEOFF", 84, "", (), ())
    world = GatewayWorld(under=policy(source), more=(row,))
    world.ready()
    for battery, result in ((3_000, 0), (1_500, 1)):
        world.signals["battery"] = (battery,)
        actions = world.send(arm())
        assert acks(actions) == [(400, result)], battery
        world.send(arm(0))


# ---------------------------------------------------------------- modes


@pytest.mark.parametrize(
    ("autopilot", "command", "mode"),
    [(ARDUPILOT, command_long(176, 1, 4), CopterMode.GUIDED), (PX4, command_long(176, 1, 6), Px4Mode.OFFBOARD)],
)
def test_a_mode_that_clients_ask_for_before_targets_is_shown_without_effect(
    autopilot: int, command: Any, mode: int
) -> None:
    world = GatewayWorld(autopilot)
    world.ready()
    actions = world.send(command)
    assert acks(actions) == [(176, 0)]
    assert beats(actions) == [(0, mode)]
    assert not [each for each in actions if isinstance(each, Propose)]
    assert beats(world.report()) == [(0, mode)]
    assert withheld(world.report(mode=Px4Mode.TAKEOFF if autopilot == PX4 else CopterMode.AUTO)) == [frozenset()]


def test_a_shown_mode_ends_after_a_bounded_time_and_the_vehicles_own_is_not_withheld() -> None:
    world = GatewayWorld(ARDUPILOT)
    world.ready()
    world.send(command_long(176, 1, 4))
    assert withheld(world.wait(21_000_000, step_us=500_000)) == [frozenset()]
    world.report(mode=CopterMode.GUIDED)
    actions = world.send(command_long(176, 1, 4))
    assert acks(actions) == [(176, 0)]
    assert withheld(actions) == []


def test_set_mode_is_acknowledged_as_the_autopilot_does() -> None:
    for autopilot, mode, wanted in ((ARDUPILOT, 4, [(11, 0)]), (PX4, Px4Mode.OFFBOARD, []), (ARDUPILOT, 1, [(11, 2)])):
        world = GatewayWorld(autopilot)
        world.ready()
        assert acks(world.send(mavlink.MAVLink_set_mode_message(SYSTEM, 1, mode))) == wanted
    world = GatewayWorld(ARDUPILOT)
    actions = world.send(mavlink.MAVLink_set_mode_message(SYSTEM, 128, 4))
    assert acks(actions) == [(11, 2)]
    assert texts(actions) == ["modes without a custom mode are refused"]
    for parameters in ((0, 4), (1, nan), (1, 300), (nan, 4), (1, -1), (1, 4.5)):
        assert acks(world.send(command_long(176, *parameters))) == [(176, 2)], parameters


def test_modes_that_stop_or_land_fly_only_in_the_air() -> None:
    for autopilot, main, sub, skill in (
        (PX4, 4, 3, "hover"), (PX4, 4, 5, "return_home"), (PX4, 4, 6, "emergency_land"), (ARDUPILOT, 5, 0, "hover"),
        (ARDUPILOT, 6, 0, "return_home"), (ARDUPILOT, 9, 0, "emergency_land"),
    ):  # fmt: skip
        world = GatewayWorld(autopilot)
        world.ready()
        actions = world.send(command_long(176, 1, main, sub))
        assert (acks(actions), proposals(actions)) == ([(176, 0)], []), "on the ground it has no effect"
        world.fly()
        actions = world.send(command_long(176, 1, main, sub))
        assert [each for each, *_ in proposals(actions)] == [skill]
        assert acks(actions) == []


# ---------------------------------------------------------------- parameters


def values(actions: list[Action]) -> list[tuple[str, float, int]]:
    found = [message for message in told(actions) if message.get_type() == "PARAM_VALUE"]
    return [(message.param_id, message.param_value, message.param_type) for message in found]


def test_a_parameter_that_only_gives_a_default_is_echoed_and_kept_for_this_client() -> None:
    world = GatewayWorld()
    world.client(2, "other")
    world.vehicle(mavlink.MAVLink_param_value_message(b"MIS_TAKEOFF_ALT", 2.5, 9, 100, 7))
    set_it = mavlink.MAVLink_param_set_message(SYSTEM, 1, b"MIS_TAKEOFF_ALT", 7.5, 9)
    actions = world.send(set_it)
    assert values(actions) == [("MIS_TAKEOFF_ALT", 7.5, 9)]
    assert texts(actions) == []
    read_it = mavlink.MAVLink_param_request_read_message(SYSTEM, 1, b"MIS_TAKEOFF_ALT", -1)
    assert values(world.send(read_it)) == [("MIS_TAKEOFF_ALT", 7.5, 9)]
    (other,) = told(world.send(read_it, client=2), client=2)
    assert (other.param_id, other.param_value) == ("MIS_TAKEOFF_ALT", 2.5)


def test_writes_of_other_parameters_are_answered_with_the_unchanged_value() -> None:
    world = GatewayWorld()
    world.vehicle(mavlink.MAVLink_param_value_message(b"RTL_ALT", 1500.0, 9, 100, 3))
    actions = world.send(mavlink.MAVLink_param_set_message(SYSTEM, 1, b"RTL_ALT", 100.0, 9))
    assert values(actions) == [("RTL_ALT", 1500.0, 9)]
    assert texts(actions) == ["parameter RTL_ALT stays as it is: writes are refused"]
    actions = world.send(mavlink.MAVLink_param_set_message(SYSTEM, 1, b"RTL_ALT", 1500.0, 9))
    assert values(actions) == [("RTL_ALT", 1500.0, 9)]
    assert texts(actions) == [], "nothing would change"
    actions = world.send(mavlink.MAVLink_param_set_message(SYSTEM, 1, b"NO_SUCH_PARAM", 1, 9))
    assert values(actions) == []
    assert texts(actions) == ["parameter NO_SUCH_PARAM is not set: writes are refused"]
    (asked,) = (each for each in world.wait() if isinstance(each, RequestFrame))
    message = mavlink.MAVLink(None).decode(bytearray(asked.frame))
    assert (message.get_type(), message.param_id) == ("PARAM_REQUEST_READ", "NO_SUCH_PARAM"), "its value is the answer"


# ---------------------------------------------------------------- setpoints and others


def test_setpoints_without_a_position_are_refused_with_a_text_once_in_five_seconds() -> None:
    world = GatewayWorld()
    world.fly()
    local = mavlink.MAVLink_set_position_target_local_ned_message(0, SYSTEM, 1, 1, 0xDC7, *[0.0] * 11)
    attitude = mavlink.MAVLink_set_attitude_target_message(0, SYSTEM, 1, 0, [1, 0, 0, 0], 0, 0, 0, 0.5)
    override = mavlink.MAVLink_rc_channels_override_message(SYSTEM, 1, *[1500] * 8)
    sticks = mavlink.MAVLink_manual_control_message(SYSTEM, 0, 0, 500, 0, 0)
    table = (
        (local, "local setpoints refused: send positions"),
        (attitude, "attitude and thrust setpoints refused: send positions"),
        (override, "RC override refused: send positions"),
        (sticks, "manual control refused: send positions"),
        (setpoint(mask=0xDC7), "setpoints other than a position refused: send positions"),
    )
    for message, text in table:
        said: list[str] = []
        for _ in range(120):  # 12 s at 10 Hz
            world.now_us += 100_000
            actions = world.send(message)
            assert acks(actions) == []
            said += texts(actions)
        assert said == [text] * 3


def test_a_refused_target_is_told_once_in_five_seconds_however_often_it_comes() -> None:
    world = GatewayWorld()
    world.fly()
    world.offboard()
    said: list[str] = []
    for _ in range(90):
        world.now_us += 100_000
        said += texts(world.send(setpoint(z=55)))
    assert said == ["goto denied: altitude 55 m, accepted 40 m (authority/out-of-scope)"] * 2
    home_unknown = GatewayWorld()
    home_unknown.gateway._state.seen._frames.pop(242)
    home_unknown.fly()
    home_unknown.offboard()
    home_unknown.gateway._state.seen._frames.pop(242)
    assert len(texts(home_unknown.send(setpoint(z=508, frame=5)))) == 1
    assert texts(home_unknown.send(setpoint(z=508, frame=5))) == []


def test_a_command_for_another_component_is_refused_with_a_text_and_no_answer_in_its_name() -> None:
    world = GatewayWorld()
    message = command_long(2000)
    message.target_component = 100
    actions = world.send(message)
    assert acks(actions) == []
    assert texts(actions) == ["command 2000 is for another component: refused"]
    assert [each.said["effect"] for each in actions if isinstance(each, ClientNote)] == ["refused"]


def test_an_integer_parameter_of_a_client_is_read_back_as_px4_encodes_it() -> None:
    """By hand: the octets of the integer 7, as a float, in place of the number 7."""
    (number,) = struct.unpack("<f", struct.pack("<i", 7))
    for autopilot, raw in ((PX4, number), (ARDUPILOT, 7.0)):
        world = GatewayWorld(autopilot)
        world.gateway._state.shadowed = frozenset({"MIS_TAKEOFF_ALT"})
        world.vehicle(mavlink.MAVLink_param_value_message(b"MIS_TAKEOFF_ALT", 0.0, 6, 1, 0))
        world.send(mavlink.MAVLink_param_set_message(SYSTEM, 1, b"MIS_TAKEOFF_ALT", raw, 6))
        (value,) = told(world.send(mavlink.MAVLink_param_request_read_message(SYSTEM, 1, b"MIS_TAKEOFF_ALT", -1)))
        assert value.param_value == raw, autopilot


def test_what_has_no_mapping_is_refused_and_recorded() -> None:
    """Commands that would change the vehicle are denied; others are not supported, as the autopilots say."""
    for command, result in ((246, 2), (185, 2), (179, 2), (241, 2), (420, 2), (2000, 3), (9999, 3), (115, 3), (519, 3)):
        world = GatewayWorld()
        actions = world.send(command_long(command, 1))
        assert acks(actions) == [(command, result)], command
        recorded = [json.loads(each.text) for each in actions if isinstance(each, ClientNote)]
        if command != 519:
            assert texts(actions) == [f"command {command} has no mapping"]
            assert recorded == [
                {
                    "client": "script",
                    "effect": "refused",
                    "command": command,
                    "reason": f"command {command} has no mapping",
                }
            ]
    world = GatewayWorld()
    assert acks(world.send(command_long(193, 1))) == [(193, 2)], "continue is not pause"
    signing = mavlink.MAVLink_setup_signing_message(SYSTEM, 1, [0] * 32, 0)
    assert texts(world.send(signing)) == ["signing set-up is refused"]
    assert texts(world.send(mavlink.MAVLink_gps_rtcm_data_message(0, 1, [0] * 180))) == ["message 233 is refused"]


def test_files_are_refused_with_the_protocols_own_answer() -> None:
    world = GatewayWorld()
    payload = [41, 0, 3, 4, 0, *[0] * 246]  # sequence 41, session 3, open file for reading
    (answer,) = told(world.send(mavlink.MAVLink_file_transfer_protocol_message(0, SYSTEM, 1, payload)))
    assert list(answer.payload[:13]) == [42, 0, 3, 129, 1, 4, 0, 0, 0, 0, 0, 0, 7]


def test_what_says_something_about_the_client_is_passed_over() -> None:
    world = GatewayWorld()
    for message in (
        mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3),
        mavlink.MAVLink_system_time_message(1, 1),
        mavlink.MAVLink_ping_message(1, 1, 0, 0),
        mavlink.MAVLink_command_ack_message(22, 0),
        mavlink.MAVLink_statustext_message(6, b"hello"),
    ):
        assert world.send(message) == []


def test_frames_for_another_system_are_not_answered() -> None:
    world = GatewayWorld()
    actions = world.send(mavlink.MAVLink_command_long_message(9, 1, 22, 0, 0, 0, 0, 0, 0, 0, 10))
    assert (acks(actions), texts(actions)) == ([], ["command 22 is for system 9: refused"])
    assert [each.said["effect"] for each in actions if isinstance(each, ClientNote)] == ["refused"]
    actions = world.send(mavlink.MAVLink_command_long_message(0, 154, 1000, 0, 0, 0, 0, 0, 0, 0, 0))
    assert (acks(actions), texts(actions)) == ([], ["command 1000 is for another component: refused"])
    assert world.send(mavlink.MAVLink_set_mode_message(9, 1, 4)) == []


def early(*frames: bytes, pilot: bool = False) -> tuple[list[Action], list[tuple[str, int]]]:
    """The answers to frames before a vehicle was heard, and the effects and commands of the records."""
    actions: list[Action] = []
    link = ClientLink(4, ClientSettings("script", "operator", pilot=pilot), 0, actions, 0)
    for frame in frames:
        link.answer_without_vehicle(frame, 0)
    said = [each.said for each in actions if isinstance(each, ClientNote)]
    answers = [each for each in actions if not isinstance(each, ClientNote)]
    return answers, [(each["effect"], each["command"]) for each in said]


@pytest.mark.parametrize("target", [(0, 0), (1, 1), (7, 1)])
def test_a_command_before_a_vehicle_was_heard_is_answered_from_whom_it_is_for(target: tuple[int, int]) -> None:
    speaker = mavlink.MAVLink(None, 245, 190)
    for message in (command_long(22), command_int(192, 6, x=0, y=0, z=0), command_long(32100, 1)):
        message.target_system, message.target_component = target
        frame = bytes(message.pack(speaker))
        actions, records = early(frame)
        reader = mavlink.MAVLink(None)
        text, ack = (reader.decode(bytearray(each.frame)) for each in actions if isinstance(each, ToClient))
        assert {each.client for each in actions if isinstance(each, ToClient)} == {4}
        assert text.text == "no vehicle was heard yet: ask again"
        assert (ack.command, ack.result, ack.target_system, ack.target_component) == (message.command, 1, 245, 190)
        assert (ack.get_srcSystem(), ack.get_srcComponent()) == (target[0] or 1, target[1] or 1)
        asks_for_control = message.command == 32100
        assert records == [("refused", message.command)]
        actions, records = early(frame, pilot=True)
        assert bool(actions) is asks_for_control, "the others went to the vehicle"
        assert records == [("refused" if asks_for_control else "passed", message.command)]
    beat = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(speaker)
    assert early(bytes(beat)) == early(b"\xfd") == ([], [])
    assert len(early(*[bytes(command_long(22).pack(speaker))] * 100)[1]) == 20, "more are counted"


YAW = "yaw is not flown: the autopilot turns the vehicle"


@pytest.mark.parametrize(
    ("autopilot", "yaw", "wanted"),
    [(PX4, nan, []), (PX4, 0.0, [YAW]), (PX4, 1.5, [YAW]), (ARDUPILOT, 0.0, []), (ARDUPILOT, 90.0, [YAW])],
)
def test_a_yaw_that_is_asked_for_is_told_once_of_each_client(autopilot: int, yaw: float, wanted: list[str]) -> None:
    world = GatewayWorld(autopilot)
    world.client(2, "script", rank=1)
    world.client(3, "other", rank=2)
    world.fly()
    for client, said in ((1, wanted), (1, []), (2, []), (3, wanted)):
        world.now_us += 1_000_000
        message = reposition(latitude=NORTH[0] + 10 * client + world.now_us % 7, z=20.0, frame=6)
        message.param4 = yaw
        assert texts(world.send(message, client), client) == said


def test_the_yaw_of_a_refused_step_is_not_told() -> None:
    world = GatewayWorld()
    world.fly()
    message = reposition(z=550)
    message.param4 = 0.5
    assert texts(world.send(message)) == ["goto denied: altitude 62 m, accepted 40 m (integrity/argument-out-of-range)"]
    message = reposition()
    message.param4 = 0.5
    assert texts(world.send(message)) == [YAW]


@pytest.mark.parametrize(("mask", "wanted"), [(0xDF8, []), (0x9F8, [YAW]), (0x5F8, [YAW]), (0x1F8, [YAW])])
def test_a_yaw_in_setpoints_is_told_once(mask: int, wanted: list[str]) -> None:
    world = GatewayWorld()
    world.fly()
    world.offboard()
    said = texts(world.send(setpoint(mask=mask)))
    for number in range(40):
        world.now_us += 100_000
        said += texts(world.send(setpoint(latitude=NORTH[0] + 100 * number, mask=mask)))
    assert said == wanted


def test_a_yaw_that_a_skill_reads_is_not_told() -> None:
    """A row of another library: `param4` is an argument."""
    source = ArgumentSource("altitude", ("param4",), 1_000, "home", "")
    row = AcceptedCommand("takeoff", COMMAND, "MAV_CMD_NAV_LOITER_UNLIM", 17, "", (), (source,))
    world = GatewayWorld(more=(row,))
    world.ready()
    actions = world.send(command_long(17, 0, 0, 0, 10))
    assert [each[0] for each in proposals(actions)] == ["takeoff"]
    assert texts(actions) == []


def test_long_texts_come_in_chunks_and_records_stay_short() -> None:
    world = GatewayWorld()
    world.client(3, "a" * 40)  # the longest name
    world.fly()
    actions = world.send(reposition(latitude=473_990_000, longitude=85_700_000), client=3)
    chunks = [message for message in told(actions, 3) if message.get_type() == "STATUSTEXT"]
    assert [message.chunk_seq for message in chunks] == list(range(len(chunks)))
    assert len({message.id for message in chunks}) == 1
    assert chunks[0].id > 0
    (note,) = (each for each in actions if isinstance(each, ClientNote))
    assert len(note.text) <= 200
    assert json.loads(note.text)["client"] == "a" * 40
    (said,) = texts(actions, 3)
    assert note.said["answer"] == said, "whole"


def test_a_long_text_in_a_record_is_cut_between_words() -> None:
    world = GatewayWorld()
    reason = "the way home from there is longer than the charge that is left for it permits, so it is refused"
    world.gateway._state.clients[1].link.record("refused", world.now_us, reason=reason)
    (note,) = (each for each in world.wait() if isinstance(each, ClientNote))
    assert note.said == {"client": "script", "effect": "refused", "reason": reason}
    assert json.loads(note.text)["reason"] == "the way home from there is longer than the charge that is left for it..."


def test_a_text_of_whole_chunks_ends_with_an_empty_one() -> None:
    world = GatewayWorld()
    link = world.gateway._state.clients[1].link
    link.text("x" * 100, world.now_us)
    chunks = [message.text for message in told(world.wait())]
    assert chunks == ["x" * 50, "x" * 50, ""]
    for number in range(70):
        link.text("y", world.now_us, key=str(number))
    assert len(texts(world.wait())) == 70


def test_records_beyond_the_rate_are_counted() -> None:
    world = GatewayWorld()
    recorded: list[Any] = []
    for at in range(100):
        sent = world.send(command_long(246, at))
        recorded += [json.loads(each.text) for each in sent if isinstance(each, ClientNote)]
    assert len(recorded) == 20
    world.now_us += 5_000_000
    (next_one,) = (json.loads(each.text) for each in world.send(command_long(246)) if isinstance(each, ClientNote))
    assert next_one["left_out"] == 80


def test_what_flies_is_recorded_at_any_rate() -> None:
    world = GatewayWorld()
    world.ready()
    for at in range(100):
        world.send(command_long(246, at))
    world.accept(world.send(command_long(22, 0, 0, 0, 0, 0, 0, 503)))
    world.dispatch(0)
    recorded = [json.loads(each.text) for each in world.done if isinstance(each, ClientNote)]
    assert [each["effect"] for each in recorded if each["effect"] != "refused"] == ["permitted"]
